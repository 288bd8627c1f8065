#include "ident/virtual_sensor.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/words.hpp"
#include "ident/wide.hpp"
#include "record/append.hpp"
#include "signal/butterworth.hpp"

namespace ulna {

namespace {

using Vector8 = Eigen::Matrix<double, 8, 1>;  // angle, rate, acceleration (joint or handle), torque
using Sensitivity = Eigen::Matrix<double, 2, 8>;

struct Channels {
  std::vector<Index> angle, torque, acceleration, reference, measured;
  bool reference_is_angle = true;
};

// Joint acceleration from the row's last measured pair.
Vector2 joint_acceleration(const RobotState& s, const Vector2& rate, const Vector2& measured,
                           bool accelerometer) {
  if (!accelerometer) return measured;
  return s.jacobian.inverse() * (measured - s.jacobian_rate * rate);  // (5.3)
}

Vector2 force_of(const PlanarRobot& robot, const Vector8& in, bool accelerometer) {
  const Vector2 rate = in.segment<2>(2);
  const RobotState s = robot.at(in.head<2>(), rate);
  const Vector2 second = joint_acceleration(s, rate, in.segment<2>(4), accelerometer);
  const Vector2 torque = s.inertia * second + s.coriolis * rate + s.friction - in.tail<2>();
  return s.jacobian.transpose().inverse() * torque;
}

// Central differences: the steps keep rounding and curvature below 1e-8 of the derivative.
Sensitivity sensitivity_of(const PlanarRobot& robot, const Vector8& in, bool accelerometer) {
  Sensitivity out;
  for (Index k = 0; k < 8; ++k) {
    const double h = 1e-5 * std::max(1.0, std::abs(in[k]));
    Vector8 up = in;
    Vector8 down = in;
    up[k] += h;
    down[k] -= h;
    out.col(k) =
        (force_of(robot, up, accelerometer) - force_of(robot, down, accelerometer)) / (2.0 * h);
  }
  return out;
}

// Covariance of value, rate and acceleration of a smoothed signal whose samples carry white noise
// of variance one: the Gram matrix of the smoother's three impulse responses.
Eigen::Matrix3d noise_gain(const PrepareReport& report, const PrepareOptions& options) {
  Index settle = 0;
  if (report.lowpass_hz > 0.0) {
    settle = settle_samples(
        butterworth_lowpass(report.lowpass_order, report.lowpass_hz, report.rate_hz), 1e-8);
  }
  const Index rows = 2 * report.window + 2 * settle + 1;
  Record::Parts parts;
  parts.rate_hz = report.rate_hz;
  parts.values = Matrix::Zero(rows, 2);
  parts.values.row(rows / 2).setOnes();
  parts.channels.resize(2);
  parts.channels[0].name = "impulse";
  parts.channels[1].name = "same";
  PrepareOptions same = options;
  same.window = report.window;
  same.order = report.order;
  same.lowpass_order = report.lowpass_order;
  same.lowpass_hz = report.lowpass_hz > 0.0 ? report.lowpass_hz : -1.0;
  same.corrected = false;
  const Prepared prepared = prepare(Record::make(std::move(parts)), {{0}, {1}, {}}, same);
  const Matrix response = prepared.trials[0].table().leftCols(3);
  return response.transpose() * response;
}

Channels find_channels(const Record& record, const VirtualSensorOptions& options) {
  Channels out;
  const auto two = [&](const std::string& word, const char* argument) {
    const std::vector<Index> found = channels_of(record, word, argument);
    require(found.size() == 2, argument,
            std::string(argument) + " stands for " + std::to_string(found.size()) +
                " channels; the robot has two joints and its handle two axes");
    return found;
  };
  out.angle = two(first_word(record, options.angle, {"theta", "q"}), "angle");
  require_unit(record, out.angle, "rad", "name the joint angles, or correct the unit in a map");
  out.torque = two(first_word(record, options.torque, {"tau"}), "torque");
  require_unit(record, out.torque, "Nm", "name the motor torques, or correct the unit in a map");
  if (!options.acceleration.empty()) {
    out.acceleration = two(options.acceleration, "acceleration");
    require_unit(record, out.acceleration, "m/s^2",
                 "give the accelerometer's unit in a map (1 g is 9.80665 m/s^2)");
  }
  if (!options.reference.empty()) {
    out.reference = two(options.reference, "reference");
    out.reference_is_angle =
        record.channels()[static_cast<std::size_t>(out.reference[0])].unit == "rad";
    if (!out.reference_is_angle) {
      require_unit(record, out.reference, "m", "name commanded joint angles or positions");
    }
  }
  for (const Index c : record.with_role(Role::kForce)) {
    if (record.channels()[static_cast<std::size_t>(c)].unit == "N") out.measured.push_back(c);
  }
  // In pairs through the smoother; anything else is no planar force.
  if (out.measured.size() != 2) out.measured.clear();
  return out;
}

void check_options(const VirtualSensorOptions& o, Index parameters) {
  require(o.least_quality > 0.0 && o.least_quality < 1.0, "least_quality",
          "the least quality of the Jacobian must lie between 0 and 1");
  const std::pair<const char*, double> errors[] = {
      {"torque_scale_error", o.torque_scale_error},
      {"acceleration_scale_error", o.acceleration_scale_error},
      {"torque_noise_nm", o.torque_noise},
      {"angle_noise_rad", o.angle_noise},
      {"angle_step_rad", o.angle_step},
      {"acceleration_noise_m_s2", o.acceleration_noise}};
  for (const auto& [name, value] : errors) {
    require(std::isfinite(value) && value >= 0.0, name,
            std::string(name) + " is a standard deviation: a finite number of at least 0");
  }
  if (o.parameter_covariance.size() == 0) return;
  const Matrix& c = o.parameter_covariance;
  require(c.rows() == parameters && c.cols() == parameters && c.allFinite(), "parameter_covariance",
          sentence(6, "the covariance of the robot's parameters must be ", parameters, " x ",
                   parameters, " and finite; it is ", c.rows(), " x ", c.cols()));
  require((c - c.transpose()).norm() <= 1e-9 * c.norm() && c.diagonal().minCoeff() >= 0.0,
          "parameter_covariance",
          "the covariance of the robot's parameters must be symmetric "
          "with variances of at least 0");
}

void refuse_singular(const Record& record, Index row, const Vector2& angle, double quality,
                     double least) {
  throw Error(
      Fault::kData, "angle",
      sentence(4, "row ", row, " (", record.time()[static_cast<std::size_t>(row)],
               " s): the pose (", angle[0] / kDegree, ", ", angle[1] / kDegree,
               ") deg is near a singular one, the condition of the Jacobian is ",
               quality > 0.0 ? 1.0 / quality : std::numeric_limits<double>::infinity(), " (limit ",
               1.0 / least,
               "): the force along one direction cannot be seen from the joints; leave these rows "
               "out"),
      "row " + std::to_string(row));
}

Channel channel(const std::string& name, const char* unit, Role role, int axis,
                const std::string& source) {
  Channel out;
  out.name = name;
  out.unit = unit;
  out.frame = "robot";
  out.role = role;
  out.axis = axis;
  out.source_name = source;
  out.source_unit = unit;
  return out;
}

}  // namespace

VirtualForce sense_force(const Record& record, const PlanarRobot& robot,
                         const VirtualSensorOptions& options, Token* token) {
  const Index parameters = robot.parameters().size();
  check_options(options, parameters);
  const Channels channels = find_channels(record, options);
  const bool accelerometer = !channels.acceleration.empty();
  const bool have_reference = !channels.reference.empty();
  const PrepareOptions wide = wide_options(
      record, have_reference && channels.reference_is_angle ? channels.reference : channels.angle,
      options.prepare);
  Prepared main = prepare(record, {channels.angle, channels.torque, channels.reference}, wide,
                          options.threads, token);
  drop_transients(main, record);
  // Further pairs through the same smoother.
  const auto beside = [&](const std::vector<Index>& pair) {
    if (pair.empty()) return Prepared{};
    Prepared out = prepare(record, {channels.angle, pair, {}}, wide, options.threads, token);
    drop_transients(out, record);
    return out;
  };
  const Prepared acceleration = beside(channels.acceleration);
  const Prepared measured = beside(channels.measured);

  Index rows = 0;
  for (const PreparedTrial& trial : main.trials) rows += trial.rows();
  const Index columns = 6 + (have_reference ? 2 : 0) + (measured.trials.empty() ? 0 : 2);
  Record::Parts parts;
  parts.values.resize(rows, columns);
  const bool uncertain = options.parameter_covariance.size() > 0;
  const Index scale_first = uncertain ? parameters : 0;
  std::vector<std::string> names;
  std::vector<double> scale_errors;
  if (uncertain) {
    for (Index i = 0; i < parameters; ++i) names.push_back("parameter " + std::to_string(i + 1));
  }
  const bool torque_scale = options.torque_scale_error > 0.0;
  const bool acceleration_scale = accelerometer && options.acceleration_scale_error > 0.0;
  for (int j = 1; torque_scale && j <= 2; ++j) {
    names.push_back("torque scale " + std::to_string(j));
    scale_errors.push_back(options.torque_scale_error);
  }
  for (int j = 1; acceleration_scale && j <= 2; ++j) {
    names.push_back("acceleration scale " + std::to_string(j));
    scale_errors.push_back(options.acceleration_scale_error);
  }
  VirtualForce out{record, {}, {}, {}, accelerometer, 1.0, 0, main.report};
  ForceErrors& errors = out.errors;
  errors.names = names;
  errors.sensitivity.assign(names.size(), Matrix(rows, 2));
  errors.covariance =
      Matrix::Zero(static_cast<Index>(names.size()), static_cast<Index>(names.size()));
  if (uncertain) {
    errors.covariance.topLeftCorner(parameters, parameters) = options.parameter_covariance;
  }
  for (std::size_t i = 0; i < scale_errors.size(); ++i) {
    const Index k = scale_first + static_cast<Index>(i);
    errors.covariance(k, k) = scale_errors[i] * scale_errors[i];
  }
  const double angle_variance =
      options.angle_noise * options.angle_noise + options.angle_step * options.angle_step / 12.0;
  const bool noisy =
      angle_variance > 0.0 || options.torque_noise > 0.0 || options.acceleration_noise > 0.0;
  const Eigen::Matrix3d gain = noisy ? noise_gain(main.report, wide) : Eigen::Matrix3d::Zero();
  out.random = Matrix::Zero(rows, 2 * kNoiseSources);

  Index at = 0;
  for (std::size_t t = 0; t < main.trials.size(); ++t) {
    const PreparedTrial& trial = main.trials[t];
    for (Index i = 0; i < trial.rows(); ++i, ++at) {
      if (i % 4096 == 0) step(token, static_cast<double>(at) / static_cast<double>(rows));
      Vector8 in;
      in << trial.position().row(i).transpose(), trial.velocity().row(i).transpose(),
          (accelerometer ? acceleration.trials[t].force().row(i) : trial.acceleration().row(i))
              .transpose(),
          trial.force().row(i).transpose();
      const Vector2 angle = in.head<2>();
      const Vector2 rate = in.segment<2>(2);
      const RobotState s = robot.at(angle, rate);
      const double quality = jacobian_quality(s.jacobian);
      if (quality < out.worst_quality) {
        out.worst_quality = quality;
        out.worst_row = trial.begin() + i;
      }
      if (!(quality >= options.least_quality)) {
        refuse_singular(record, trial.begin() + i, angle, quality, options.least_quality);
      }
      const Vector2 second = joint_acceleration(s, rate, in.segment<2>(4), accelerometer);
      const Matrix2 back = s.jacobian.transpose().inverse();
      const Vector2 force =
          back * (s.inertia * second + s.coriolis * rate + s.friction - in.tail<2>());
      auto row = parts.values.row(at);
      row.segment<2>(0) = s.position.transpose();
      row.segment<2>(2) = force.transpose();
      Index next = 4;
      if (have_reference) {
        const Vector2 command = trial.reference().row(i).transpose();
        row.segment<2>(next) =
            (channels.reference_is_angle ? robot.at(command, Vector2::Zero()).position : command)
                .transpose();
        next += 2;
      }
      row.segment<2>(next) = (s.jacobian * second + s.jacobian_rate * rate).transpose();
      next += 2;
      if (!measured.trials.empty()) row.segment<2>(next) = measured.trials[t].force().row(i);

      if (uncertain) {
        const Matrix y = back * robot.regressor(angle, rate, second);
        for (Index k = 0; k < parameters; ++k) {
          errors.sensitivity[static_cast<std::size_t>(k)].row(at) = y.col(k).transpose();
        }
      }
      std::size_t k = static_cast<std::size_t>(scale_first);
      for (Index j = 0; torque_scale && j < 2; ++j) {
        errors.sensitivity[k++].row(at) = -(back.col(j) * in[6 + j]).transpose();
      }
      if (acceleration_scale) {
        const Matrix2 mass = back * s.inertia * s.jacobian.inverse();
        for (Index j = 0; j < 2; ++j) {
          errors.sensitivity[k++].row(at) = (mass.col(j) * in[4 + j]).transpose();
        }
      }
      if (!noisy) continue;
      const Sensitivity d = sensitivity_of(robot, in, accelerometer);
      for (Index axis = 0; axis < 2; ++axis) {
        double from_angle = 0.0;
        for (Index j = 0; j < 2; ++j) {
          // An accelerometer's noise is its own; without one, acceleration shares the angle's.
          Eigen::Vector3d parts_of(d(axis, j), d(axis, 2 + j),
                                   accelerometer ? 0.0 : d(axis, 4 + j));
          from_angle += parts_of.dot(gain * parts_of);
        }
        const double value = gain(0, 0);
        out.random(at, axis) =
            options.torque_noise * std::sqrt(value) * d.row(axis).tail<2>().norm();
        out.random(at, 2 + axis) = std::sqrt(angle_variance * std::max(from_angle, 0.0));
        out.random(at, 4 + axis) = accelerometer ? options.acceleration_noise * std::sqrt(value) *
                                                       d.row(axis).segment<2>(4).norm()
                                                 : 0.0;
      }
    }
    const auto first = record.time().begin() + trial.begin();
    parts.time.insert(parts.time.end(), first, first + trial.rows());
    parts.trials.push_back({at - trial.rows(), at});
    for (const Segment& segment : record.segments()) {
      if (segment.trial != static_cast<int>(t)) continue;
      const Index begin = std::max<Index>(segment.begin - trial.begin(), 0);
      const Index end = std::min(segment.end - trial.begin(), trial.rows());
      const Index base = at - trial.rows();
      if (begin < end) parts.segments.push_back({base + begin, base + end, static_cast<int>(t)});
    }
  }
  out.total = out.random.leftCols(2).cwiseAbs2() + out.random.middleCols(2, 2).cwiseAbs2() +
              out.random.rightCols(2).cwiseAbs2();
  if (!errors.names.empty()) out.total += systematic_error(errors).cwiseAbs2();
  out.total = out.total.cwiseSqrt();

  const std::string from = accelerometer ? "accelerometer" : "differentiated angles";
  const char* const axes[] = {"x", "y"};
  const auto name_of = [&](Index c) { return record.channels()[static_cast<std::size_t>(c)].name; };
  for (int j = 0; j < 2; ++j)
    parts.channels.push_back(channel(axes[j], "m", Role::kPosition, j, "forward kinematics"));
  for (int j = 0; j < 2; ++j)
    parts.channels.push_back(
        channel(std::string("F_") + axes[j], "N", Role::kForce, j, "virtual sensor"));
  for (int j = 0; have_reference && j < 2; ++j)
    parts.channels.push_back(channel(std::string(axes[j]) + "_ref", "m", Role::kReference, j,
                                     name_of(channels.reference[static_cast<std::size_t>(j)])));
  for (int j = 0; j < 2; ++j)
    parts.channels.push_back(channel(std::string("a_") + axes[j], "m/s^2", Role::kOther, 0, from));
  for (std::size_t j = 0; !measured.trials.empty() && j < 2; ++j) {
    const std::string name = name_of(channels.measured[j]);
    parts.channels.push_back(channel(name + "_measured", "N", Role::kOther, 0, name));
  }
  parts.rate_hz = record.rate_hz();
  parts.provenance = record.provenance();
  parts.provenance.push_back(
      sentence(6, "virtual force sensor: F = J^-T (I q'' + C q' + F_r - tau) of the ", robot.name(),
               ", q'' from ", from, ", window ", main.report.window, ", low pass at ",
               main.report.lowpass_hz, " Hz, ", main.report.dropped_rows,
               " rows dropped at either end of a trial"));
  out.record = Record::make(std::move(parts));
  return out;
}

}  // namespace ulna
