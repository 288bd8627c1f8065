#include "impedance/viscoelastic.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "impedance/misfit_errors.hpp"
#include "impedance/torque_noise.hpp"
#include "signal/finite.hpp"
#include "signal/savgol.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr double kLeastMotion = 1.0 * kDegree;  // of a joint that is assessed
constexpr double kPoorShare = 0.5;              // of the variance that a line must explain

bool has_channel(const Record& record, const std::string& name) {
  return std::any_of(record.channels().begin(), record.channels().end(),
                     [&](const Channel& c) { return c.name == name; });
}

// Rows of a channel; refuses what is not finite with the row.
Vector finite_column(const Record& record, const std::string& name) {
  const Vector values = record.column(record.find(name));
  for (Index i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    throw Error(Fault::kData, name,
                "channel " + name + " is not finite in row " + std::to_string(i) +
                    ": remove the row or the trial",
                "row " + std::to_string(i));
  }
  return values;
}

Matrix joint_channels(const Record& record, const char* prefix,
                      const std::vector<std::string>& joints) {
  Matrix values(record.rows(), static_cast<Index>(joints.size()));
  for (Index j = 0; j < values.cols(); ++j) {
    values.col(j) = finite_column(record, prefix + joints[static_cast<std::size_t>(j)]);
  }
  return values;
}

// Motion and motor torque of the device.
struct DeviceLog {
  Matrix angle, rate, acceleration, motor;
  Matrix loss;  // empty: not logged
};

// A window of 0.11 s passes 5 Hz at order 4.
SavgolSpec smoother_of(double rate_hz) {
  const int half = std::max(3, static_cast<int>(std::lround(0.055 * rate_hz)));
  return {.window = 2 * half + 1, .order = 4};
}

void smooth_trials(const Record& record, const Matrix& from, int derivative, Matrix& to) {
  const SavgolSpec spec = smoother_of(record.rate_hz());
  for (const Trial& trial : record.trials()) {
    const Index rows = trial.end - trial.begin;
    Matrix out(rows, derivative + 1);
    for (Index j = 0; j < from.cols(); ++j) {
      const Vector column = from.col(j).segment(trial.begin, rows);
      savgol_apply(spec, record.rate_hz(), column, derivative, out);
      to.col(j).segment(trial.begin, rows) = out.col(derivative);
    }
  }
}

DeviceLog device_log(const Record& record, const std::vector<std::string>& joints,
                     bool needs_acceleration) {
  DeviceLog log;
  log.angle = joint_channels(record, "theta_", joints);
  log.motor = joint_channels(record, "tau_motor_", joints);
  const bool rates = has_channel(record, "theta_dot_" + joints[0]);
  const bool accelerations = has_channel(record, "theta_ddot_" + joints[0]);
  if (rates) log.rate = joint_channels(record, "theta_dot_", joints);
  if (accelerations) log.acceleration = joint_channels(record, "theta_ddot_", joints);
  if (rates && (accelerations || !needs_acceleration)) {
    if (!accelerations) log.acceleration = Matrix::Zero(log.angle.rows(), log.angle.cols());
    if (has_channel(record, "tau_loss_" + joints[0])) {
      log.loss = joint_channels(record, "tau_loss_", joints);
    }
    return log;
  }
  const Matrix raw = log.angle;
  const Matrix motor = log.motor;
  for (Matrix* m : {&log.rate, &log.acceleration}) m->resize(raw.rows(), raw.cols());
  smooth_trials(record, raw, 0, log.angle);
  smooth_trials(record, raw, 1, log.rate);
  smooth_trials(record, raw, 2, log.acceleration);
  smooth_trials(record, motor, 0, log.motor);
  return log;
}

Matrix torque_of(const DeviceLog& log, const NominalModel& nominal, const NominalTerms& terms) {
  Matrix torque(log.angle.rows(), log.angle.cols());
  NominalTerms bodies = terms;
  const bool logged =
      log.loss.size() > 0 && terms.damping && terms.friction == NominalFriction::kEngine;
  if (logged) {
    bodies.damping = false;
    bodies.friction = NominalFriction::kNone;
  }
  for (Index i = 0; i < torque.rows(); ++i) {
    const Vector angle = log.angle.row(i).transpose();
    const Vector rate = log.rate.row(i).transpose();
    const Vector acceleration = log.acceleration.row(i).transpose();
    torque.row(i) =
        nominal.torque(angle, rate, acceleration, bodies).transpose() - log.motor.row(i);
  }
  if (logged) torque += log.loss;
  return torque;
}

// Regressors: angle, then rate and one where they are wanted.
Matrix regressors_of(const Vector& angle, const Vector& rate, const ViscoelasticOptions& o) {
  Matrix x(angle.size(), 1 + (o.damping ? 1 : 0) + (o.intercept ? 1 : 0));
  Index c = 0;
  x.col(c++) = angle;
  if (o.damping) x.col(c++) = rate;
  if (o.intercept) x.col(c++).setOnes();
  return x;
}

struct Line {
  Vector theta;
  Matrix inverse;  // of the Gram matrix
  double condition = kInfinity;
};

Line fit_line(const Matrix& x, const Vector& y) {
  Line line;
  Vector scale = x.colwise().norm().transpose();
  for (Index c = 0; c < scale.size(); ++c) {
    if (!(scale[c] > 0.0)) return line;
  }
  const Matrix unit = x * scale.cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Matrix> svd(unit, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Vector values = svd.singularValues();
  const double least = values[values.size() - 1];
  line.condition = least > 0.0 ? values[0] / least : kInfinity;
  line.theta = scale.cwiseInverse().cwiseProduct(svd.solve(y));
  const Matrix back = scale.cwiseInverse().asDiagonal() * svd.matrixV();
  line.inverse = back * values.cwiseAbs2().cwiseInverse().asDiagonal() * back.transpose();
  return line;
}

void check_options(const ViscoelasticOptions& o) {
  const auto positive = [](double value, const char* argument) {
    require(std::isfinite(value) && value > 0.0, argument,
            std::string(argument) + " must be a positive number");
  };
  positive(o.hac_lag_s, "hac_lag_s");
  positive(o.block_s, "block_s");
  positive(o.condition_limit, "condition_limit");
  require(o.level > 0.5 && o.level < 1.0, "level", "level must be between 0.5 and 1");
  require(o.bootstrap >= 50 && o.bootstrap <= 10'000'000, "bootstrap",
          "bootstrap must be between 50 and ten million");
}

std::vector<Index> chosen_joints(const Record& record, const NominalModel& nominal,
                                 const ViscoelasticOptions& o) {
  const std::vector<std::string>& joints = nominal.joints();
  std::vector<Index> chosen;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Index c = record.find("theta_" + joints[j]);
    const bool moved = record.channels()[static_cast<std::size_t>(c)].role == Role::kPosition;
    const bool named = std::find(o.joints.begin(), o.joints.end(), joints[j]) != o.joints.end();
    if (o.joints.empty() ? moved : named) chosen.push_back(static_cast<Index>(j));
  }
  for (const std::string& name : o.joints) {
    require(std::find(joints.begin(), joints.end(), name) != joints.end(), "joints",
            "the device has no joint '" + name + "'; its joints are: " + join(joints));
  }
  require(!chosen.empty(), "joints",
          "no channel theta_<joint> has the role position: name the joints to "
          "assess");
  return chosen;
}

// Channels of the human joint that a device joint turns: of the same name in a rigid coupling, else
// the one whose torque of the muscles is there. "" where the record does not say.
std::string human_of(const Record& record, const std::string& joint, bool last) {
  if (has_channel(record, "q_" + joint)) return joint;
  return last && has_channel(record, "q_elbow_flexion") ? "elbow_flexion" : "";
}

void set_truth(const Record& record, const std::string& human, const Vector& torque,
               const ViscoelasticOptions& o, Viscoelasticity& v) {
  if (human.empty() || !has_channel(record, "tau_muscle_" + human)) return;
  const Vector muscle = finite_column(record, "tau_muscle_" + human);
  const Vector q = finite_column(record, "q_" + human);
  const Vector q_dot = finite_column(record, "q_dot_" + human);
  const Line line = fit_line(regressors_of(q, q_dot, o), muscle);
  ViscoelasticOptions alone = o;
  alone.damping = false;
  alone.intercept = true;
  const Line slope = fit_line(regressors_of(q, q_dot, alone), muscle);
  v.truth.known = true;
  if (line.theta.size() > 0) v.truth.k = -line.theta[0];
  if (line.theta.size() > 0 && o.damping) v.truth.d = -line.theta[1];
  if (slope.theta.size() > 0) v.truth.k_alone = -slope.theta[0];
  const Vector residual = torque - muscle;
  v.model_residual_rms = std::sqrt(residual.squaredNorm() / static_cast<double>(residual.size()));
  v.model_residual_max = residual.cwiseAbs().maxCoeff();
}

void set_errors(const Record& record, const Matrix& x, const Vector& angle, const Vector& rate,
                const Vector& torque, const Line& line, const ViscoelasticOptions& o, Token* token,
                Viscoelasticity& v) {
  const Vector residual = torque - x * line.theta;
  const double about = o.intercept ? torque.mean() : 0.0;
  v.r_squared = 1.0 - residual.squaredNorm() /
                          std::max(1e-300, (torque.array() - about).matrix().squaredNorm());
  v.residual_rms = std::sqrt(residual.squaredNorm() / static_cast<double>(v.rows));
  const TorqueNoise noise = torque_noise(record, x * line.inverse, angle, rate, torque);
  v.noise_rms = noise.rms;
  const Vector half = student_quantile(0.5 + 0.5 * o.level, noise.dof) * noise.error;
  const MisfitErrors misfit = misfit_errors(record, x, torque, line.inverse, o, token);
  // K is minus the slope: low and high change their places.
  const auto set = [&](Index c, double value, double& error, double(&interval)[2],
                       double& misfit_error, double(&misfit_interval)[2]) {
    error = noise.error[c];
    interval[0] = value - half[c];
    interval[1] = value + half[c];
    misfit_error = misfit.error[c];
    misfit_interval[0] = value - misfit.half_high[c];
    misfit_interval[1] = value + misfit.half_low[c];
  };
  set(0, v.k, v.k_error, v.k_interval, v.k_misfit_error, v.k_misfit_interval);
  if (o.damping) set(1, v.d, v.d_error, v.d_interval, v.d_misfit_error, v.d_misfit_interval);
}

Viscoelasticity assess_joint(const Record& record, const std::string& joint, bool last,
                             const Vector& theta, const Vector& theta_dot, const Vector& torque,
                             const ViscoelasticOptions& o, Token* token) {
  Viscoelasticity v;
  v.joint = joint;
  v.level = o.level;
  v.rows = torque.size();
  const std::string human = human_of(record, joint, last);
  require(!o.human_angle || !human.empty(), "human_angle",
          "the record holds no true human angle q_ for joint '" + joint + "'");
  const Vector angle = o.human_angle ? finite_column(record, "q_" + human) : theta;
  const Vector rate = o.human_angle ? finite_column(record, "q_dot_" + human) : theta_dot;
  const Matrix x = regressors_of(angle, rate, o);
  if (v.rows < 10 * x.cols()) {
    throw Error(Fault::kData, "record",
                "only " + std::to_string(v.rows) + " rows are there to identify " +
                    std::to_string(x.cols()) + " parameters of joint '" + joint + "'; at least " +
                    std::to_string(10 * x.cols()) + " are needed");
  }
  const double way = angle.maxCoeff() - angle.minCoeff();
  if (!(way >= kLeastMotion)) {
    throw Error(Fault::kAnalysis, "record",
                sentence(3, "joint '", joint, "' moves by ", way / kDegree,
                         " degrees, which does not determine its stiffness: "
                         "move it further"),
                "joint " + joint);
  }
  const Line line = fit_line(x, torque);
  v.condition = line.condition;
  if (!(line.condition <= o.condition_limit)) {
    throw Error(Fault::kAnalysis, "record",
                sentence(3, "the movement of joint '", joint,
                         "' does not determine its stiffness and damping (condition number ",
                         line.condition, ", limit ", o.condition_limit, "): move it further"),
                "joint " + joint);
  }
  v.k = -line.theta[0];
  if (o.damping) v.d = -line.theta[1];
  if (o.intercept) v.offset = line.theta[x.cols() - 1];
  set_errors(record, x, angle, rate, torque, line, o, token, v);
  set_truth(record, human, torque, o, v);
  if (v.r_squared < kPoorShare) {
    v.warnings.push_back(sentence(3, "A line explains ", 100.0 * v.r_squared,
                                  " % of the torque of joint '", joint,
                                  "': stiffness and damping are averages of what changes along "
                                  "the movement."));
  }
  if (v.k_interval[1] < 0.0) {
    v.warnings.push_back("The torque of joint '" + joint +
                         "' grows with the angle: the muscles pull like an anti-spring (K < 0), "
                         "not like a resistance.");
  }
  return v;
}

}  // namespace

ViscoelasticOptions ViscoelasticOptions::published() {
  ViscoelasticOptions o;
  o.terms = {.inertia = false, .damping = false, .friction = NominalFriction::kNone};
  o.human_angle = true;
  o.damping = false;
  return o;
}

Matrix nominal_human_torque(const Record& record, const NominalModel& nominal,
                            const NominalTerms& terms) {
  return torque_of(device_log(record, nominal.joints(), true), nominal, terms);
}

std::vector<Viscoelasticity> identify_viscoelasticity(const Record& record,
                                                      const NominalModel& nominal,
                                                      const ViscoelasticOptions& options,
                                                      Token* token) {
  check_options(options);
  const std::vector<Index> chosen = chosen_joints(record, nominal, options);
  const bool accelerated =
      options.terms.inertia || options.terms.friction == NominalFriction::kEngine;
  const DeviceLog log = device_log(record, nominal.joints(), accelerated);
  const Matrix torque = torque_of(log, nominal, options.terms);
  std::vector<Viscoelasticity> found;
  for (const Index j : chosen) {
    found.push_back(assess_joint(record, nominal.joints()[static_cast<std::size_t>(j)],
                                 j + 1 == torque.cols(), log.angle.col(j), log.rate.col(j),
                                 torque.col(j), options, token));
  }
  step(token, 1.0);
  return found;
}

}  // namespace ulna
