#include "sim/joint_log.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"
#include "sim/coloured.hpp"

namespace ulna::sim {
namespace {

// Columns side by side.
class JointColumns {
 public:
  explicit JointColumns(Index rows) : rows_(rows) {}

  void add(std::string name, const char* unit, const Vector& values, Role role = Role::kOther,
           int axis = 0) {
    Channel channel;
    channel.name = std::move(name);
    channel.unit = unit;
    channel.role = role;
    channel.axis = axis;
    channels_.push_back(std::move(channel));
    values_.push_back(values);
  }

  void fill(Record::Parts& parts) {
    parts.values.resize(rows_, static_cast<Index>(values_.size()));
    for (std::size_t c = 0; c < values_.size(); ++c) {
      parts.values.col(static_cast<Index>(c)) = values_[c];
    }
    parts.channels = std::move(channels_);
  }

 private:
  Index rows_;
  std::vector<Channel> channels_;
  std::vector<Vector> values_;
};

const char* word(TorqueUpdate mode) {
  switch (mode) {
    case TorqueUpdate::kHeld:
      return "held";
    case TorqueUpdate::kImplicitDamping:
      return "at every step with its damping in the joints";
    case TorqueUpdate::kEveryStep:
      break;
  }
  return "at every step";
}

const char* word(MotionShape shape) {
  switch (shape) {
    case MotionShape::kLogistic:
      return "logistic";
    case MotionShape::kMinimumJerk:
      return "minimum jerk";
    case MotionShape::kRamp:
      return "ramp";
    case MotionShape::kSinusoid:
      break;
  }
  return "sinusoid";
}

std::vector<std::string> provenance_lines(const Protocol& p, const Mobilisation& m) {
  std::vector<std::string> lines;
  lines.push_back(
      sentence(6, "mobilised: ", p.donned ? "donned at the start" : "fell from the reference",
               ", settled ", p.settle_s, " s, at the start after ", m.start_s, " s"));
  std::string control = sentence(6, "mobilised: kp ", p.control.kp, ", ki ", p.control.ki, ", kd ",
                                 p.control.kd, ", torque ", word(p.control.mode));
  if (p.control.mode == TorqueUpdate::kHeld)
    control += sentence(6, " for ", p.control.hold_s, " s");
  lines.push_back(control);
  lines.push_back(sentence(6, "mobilised: ", word(p.motion.shape), " of ", p.motion.duration_s,
                           " s a way, ", p.motion.speeds.size(), " speed(s), ", p.motion.repeats,
                           " repeat(s)"));
  const char* kind = p.excitation.kind == ExcitationKind::kConstant        ? "constant"
                     : p.excitation.kind == ExcitationKind::kStretchReflex ? "stretch reflex"
                                                                           : "velocity dependent";
  lines.push_back(sentence(
      6, "mobilised: excitation ", kind, ", flexors ", p.excitation.flexors, ", extensors ",
      p.excitation.balanced ? std::string("balanced") : sentence(6, p.excitation.extensors)));
  if (m.status != RunStatus::kOk) {
    lines.push_back(std::string("mobilised: ended as ") + ulna::sim::word(m.status) + ": " +
                    m.reason);
  }
  return lines;
}

// The log has the device's losses as they were.
constexpr NominalTerms kRigidBodies{.damping = false, .friction = NominalFriction::kNone};

const char* const kDeviceChannels[] = {"theta_", "theta_dot_", "theta_ddot_", "tau_motor_"};

// Rows x joints of the channels "<prefix><joint>".
Matrix channels_of(const Record& record, const char* prefix,
                   const std::vector<std::string>& joints) {
  Matrix values(record.rows(), static_cast<Index>(joints.size()));
  for (Index j = 0; j < values.cols(); ++j) {
    values.col(j) = record.column(record.find(prefix + joints[static_cast<std::size_t>(j)]));
  }
  return values;
}

enum class SensorStream : std::uint64_t { kAngle = 8, kRate, kAcceleration, kTorque, kSlow };
constexpr std::uint64_t kStreamsOfARun = 16;
constexpr std::uint64_t kStreamsOfAJoint = std::uint64_t{1} << 40;

Random sensor_random(std::uint64_t seed, std::uint64_t run, SensorStream stream, Index joint) {
  return Random(seed, static_cast<std::uint64_t>(joint) * kStreamsOfAJoint + run * kStreamsOfARun +
                          static_cast<std::uint64_t>(stream));
}

constexpr double kMostError = 1e6;  // beyond any sensor, and its square is a number

void check_sensor(double value, const char* argument) {
  require(std::isfinite(value) && value >= 0.0, argument,
          std::string(argument) + " must be 0 or more");
  require(value <= kMostError, argument,
          sentence(6, argument, " is ", value, "; it must be at most ", kMostError));
}

}  // namespace

JointLog::JointLog(const MobilisedPlant& plant, std::vector<Index> moved, double rate_hz)
    : plant_(plant), moved_(std::move(moved)), rate_hz_(rate_hz) {}

Vector JointLog::apart(const Vector& angle, const Vector& human) const {
  Vector apart = Vector::Zero(static_cast<Index>(moved_.size()));
  for (std::size_t k = 0; k < moved_.size(); ++k) {
    const Index h = plant_.counterparts()[static_cast<std::size_t>(moved_[k])];
    if (h >= 0) apart[static_cast<Index>(k)] = human[h] - angle[moved_[k]];
  }
  return apart;
}

void JointLog::donned(MobilisedRun& run) {
  donned_apart_ = apart(run.device_angle(), run.human_angle());
}

void JointLog::before_step(MobilisedRun& run, const VectorRef& reference) {
  Row row;
  row.angle = run.device_angle();
  row.rate = run.device_rate();
  row.reference = reference;
  row.human = run.human_angle();
  row.human_rate = run.human_rate();
  rows_.push_back(std::move(row));
}

void JointLog::after_step(const MobilisedRun& run) {
  Row& row = rows_.back();
  row.acceleration = run.device_acceleration();
  row.motor = run.motor_torque();
  row.loss = run.device_loss();
  row.muscle = run.muscle_torque();
  row.activation = run.activation();
  row.extras = run.extras();
  row.whole = true;
}

Index JointLog::whole_rows() const {
  const auto rows = static_cast<Index>(rows_.size());
  return rows > 0 && !rows_.back().whole ? rows - 1 : rows;
}

Record JointLog::record(const Protocol& protocol, const Mobilisation& m) const {
  const Index rows = whole_rows();
  JointColumns columns(rows);
  const auto column = [&](Vector Row::*field, Index j) {
    Vector values(rows);
    for (Index i = 0; i < rows; ++i) values[i] = (rows_[static_cast<std::size_t>(i)].*field)[j];
    return values;
  };
  const std::vector<std::string>& device = plant_.device_joints();
  const auto axis_of = [this](Index j) {
    const auto found = std::find(moved_.begin(), moved_.end(), j);
    return found == moved_.end() ? -1 : static_cast<int>(found - moved_.begin());
  };
  const auto add = [&](const char* prefix, const char* unit, Vector Row::*field, Role role) {
    for (std::size_t j = 0; j < device.size(); ++j) {
      const int axis = role == Role::kOther ? -1 : axis_of(static_cast<Index>(j));
      columns.add(prefix + device[j], unit, column(field, static_cast<Index>(j)),
                  axis < 0 ? Role::kOther : role, std::max(axis, 0));
    }
  };
  add("theta_", "rad", &Row::angle, Role::kPosition);
  add("theta_dot_", "rad/s", &Row::rate, Role::kOther);
  add("theta_ddot_", "rad/s^2", &Row::acceleration, Role::kOther);
  add("tau_motor_", "Nm", &Row::motor, Role::kOther);
  add("tau_loss_", "Nm", &Row::loss, Role::kOther);
  Matrix hum(rows, static_cast<Index>(device.size()));
  for (Index i = 0; i < rows; ++i) {
    const Row& r = rows_[static_cast<std::size_t>(i)];
    hum.row(i) =
        (plant_.nominal().torque(r.angle, r.rate, r.acceleration, kRigidBodies) + r.loss - r.motor)
            .transpose();
  }
  for (std::size_t j = 0; j < device.size(); ++j) {
    const int axis = axis_of(static_cast<Index>(j));
    columns.add("tau_hum_" + device[j], "Nm", hum.col(static_cast<Index>(j)),
                axis < 0 ? Role::kOther : Role::kForce, std::max(axis, 0));
  }
  add("theta_ref_", "rad", &Row::reference, Role::kReference);
  const std::vector<std::string>& human = plant_.human_joints();
  for (std::size_t j = 0; j < human.size(); ++j) {
    columns.add("q_" + human[j], "rad", column(&Row::human, static_cast<Index>(j)));
  }
  for (std::size_t j = 0; j < human.size(); ++j) {
    columns.add("q_dot_" + human[j], "rad/s", column(&Row::human_rate, static_cast<Index>(j)));
  }
  for (std::size_t j = 0; j < human.size(); ++j) {
    columns.add("tau_muscle_" + human[j], "Nm", column(&Row::muscle, static_cast<Index>(j)));
  }
  for (std::size_t k = 0; k < plant_.muscles().size(); ++k) {
    columns.add("a_" + plant_.muscles()[k], "1", column(&Row::activation, static_cast<Index>(k)));
  }
  for (std::size_t k = 0; k < plant_.extras().size(); ++k) {
    columns.add(plant_.extras()[k].name, plant_.extras()[k].unit.c_str(),
                column(&Row::extras, static_cast<Index>(k)));
  }
  Record::Parts parts;
  columns.fill(parts);
  parts.rate_hz = rate_hz_;
  parts.provenance = provenance_lines(protocol, m);
  return Record::make(std::move(parts));
}

// A joint that rests on a limit is held by more than its motor.
void JointLog::notice_limits(Mobilisation& m) const {
  constexpr double kTouch = 1e-4;  // rad
  const Matrix range = plant_.device_range();
  const Vector limit = plant_.motor_limit();
  const Index rows = whole_rows();
  for (Index j = 0; j < range.rows(); ++j) {
    Index touching = 0;
    for (Index i = 0; i < rows; ++i) {
      const double angle = rows_[static_cast<std::size_t>(i)].angle[j];
      touching += angle < range(j, 0) + kTouch || angle > range(j, 1) - kTouch ? 1 : 0;
    }
    if (touching == 0) continue;
    m.notes.push_back(sentence(3, "Joint '", plant_.device_joints()[static_cast<std::size_t>(j)],
                               "' rests on a limit of its range in ",
                               100.0 * static_cast<double>(touching) / static_cast<double>(rows),
                               " % of the rows: the limit holds it there beside its motor."));
  }
  for (Index i = 0; i < rows; ++i) {
    const Vector& motor = rows_[static_cast<std::size_t>(i)].motor;
    m.saturated_rows += (motor.cwiseAbs().array() >= limit.array() * (1.0 - 1e-12)).any() ? 1 : 0;
  }
  if (m.saturated_rows > 0) {
    m.notes.push_back(
        sentence(6, "A motor is at its limit in ", m.saturated_rows, " of ", rows, " rows."));
  }
}

void JointLog::finish(const Protocol& protocol, Mobilisation& m) const {
  if (whole_rows() < 2) return;
  m.largest_slip = 0.0;
  for (Index i = 0; i < whole_rows(); ++i) {
    const Row& row = rows_[static_cast<std::size_t>(i)];
    m.largest_slip = std::max(m.largest_slip,
                              (apart(row.angle, row.human) - donned_apart_).cwiseAbs().maxCoeff());
  }
  notice_limits(m);
  m.record = record(protocol, m);
}

Record with_errors(const Record& record, const NominalModel& nominal, const JointSensors& sensors,
                   std::uint64_t seed, std::uint64_t run) {
  check_sensor(sensors.angle_rad, "angle_rad");
  check_sensor(sensors.rate_rad_s, "rate_rad_s");
  check_sensor(sensors.acceleration_rad_s2, "acceleration_rad_s2");
  check_sensor(sensors.torque_nm, "torque_nm");
  check_sensor(sensors.slow_torque_nm, "slow_torque_nm");
  require(std::isfinite(sensors.slow_hz) && sensors.slow_hz > 0.0, "slow_hz",
          "slow_hz must be positive");
  const std::vector<std::string>& joints = nominal.joints();
  const double rms[] = {sensors.angle_rad, sensors.rate_rad_s, sensors.acceleration_rad_s2,
                        sensors.torque_nm};
  Matrix measured[4];
  for (std::size_t s = 0; s < 4; ++s) {
    measured[s] = channels_of(record, kDeviceChannels[s], joints);
    for (Index j = 0; j < measured[s].cols(); ++j) {
      const auto stream = static_cast<SensorStream>(
          static_cast<std::uint64_t>(SensorStream::kAngle) + static_cast<std::uint64_t>(s));
      Random random = sensor_random(seed, run, stream, j);
      for (Index i = 0; rms[s] > 0.0 && i < record.rows(); ++i) {
        measured[s](i, j) += rms[s] * random.normal();
      }
    }
  }
  for (Index j = 0; sensors.slow_torque_nm > 0.0 && j < measured[3].cols(); ++j) {
    ColouredNoise slow(sensors.slow_torque_nm, sensors.slow_hz, 0.7, 1.0 / record.rate_hz(),
                       sensor_random(seed, run, SensorStream::kSlow, j));
    for (Index i = 0; i < record.rows(); ++i) measured[3](i, j) += slow.next();
  }
  Record::Parts parts = record.parts();
  for (Index j = 0; j < measured[0].cols(); ++j) {
    const std::string& joint = joints[static_cast<std::size_t>(j)];
    for (std::size_t s = 0; s < 4; ++s) {
      parts.values.col(record.find(kDeviceChannels[s] + joint)) = measured[s].col(j);
    }
  }
  const Matrix true_rate = channels_of(record, "theta_dot_", joints);
  const Matrix true_acceleration = channels_of(record, "theta_ddot_", joints);
  Matrix loss = channels_of(record, "tau_loss_", joints);
  Matrix hum(loss.rows(), loss.cols());
  for (Index i = 0; i < record.rows(); ++i) {
    const Vector angle = measured[0].row(i).transpose();
    const Vector rate = measured[1].row(i).transpose();
    const Vector acceleration = measured[2].row(i).transpose();
    // Losses are known as well as the rate is.
    const Vector wrong =
        nominal.loss(rate, acceleration) -
        nominal.loss(true_rate.row(i).transpose(), true_acceleration.row(i).transpose());
    loss.row(i) += wrong.transpose();
    hum.row(i) = nominal.torque(angle, rate, acceleration, kRigidBodies).transpose() + loss.row(i) -
                 measured[3].row(i);
  }
  for (Index j = 0; j < hum.cols(); ++j) {
    const std::string& joint = joints[static_cast<std::size_t>(j)];
    parts.values.col(record.find("tau_loss_" + joint)) = loss.col(j);
    parts.values.col(record.find("tau_hum_" + joint)) = hum.col(j);
  }
  parts.provenance.push_back(sentence(6, "measured: rms errors ", rms[0], " rad, ", rms[1],
                                      " rad/s, ", rms[2], " rad/s^2, ", rms[3], " Nm, slow ",
                                      sensors.slow_torque_nm, " Nm below ", sensors.slow_hz,
                                      " Hz, seed ", seed, ", run ", run));
  return Record::make(std::move(parts));
}

LocalImpedance local_impedance(MuscleProbe& probe, const VectorRef& angle, const VectorRef& rate,
                               const VectorRef& activation) {
  // Curves of muscles are piecewise quadratic: the central difference is exact within a piece, and
  // rounding of 1e-12 N m over this step leaves 1e-8.
  constexpr double kStep = 1e-4;
  const Index n = angle.size();
  LocalImpedance local{Matrix(n, n), Matrix(n, n)};
  for (Index j = 0; j < n; ++j) {
    const Vector away = Vector::Unit(n, j) * kStep;
    local.k.col(j) = -(probe.torque(angle + away, rate, activation) -
                       probe.torque(angle - away, rate, activation)) /
                     (2.0 * kStep);
    local.d.col(j) = -(probe.torque(angle, rate + away, activation) -
                       probe.torque(angle, rate - away, activation)) /
                     (2.0 * kStep);
  }
  return local;
}

}  // namespace ulna::sim
