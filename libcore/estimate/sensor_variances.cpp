#include "estimate/sensor_variances.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

// A row that is checked by less than this share of itself says nothing about its variance.
constexpr double kLeastFreedom = 1e-6;

BodyRecording every(const BodyRecording& r, Index stride) {
  const Index count = (r.frames() + stride - 1) / stride;
  const auto take = [&](const Matrix& m) {
    Matrix part(m.size() == 0 ? 0 : count, m.cols());
    for (Index i = 0; i < part.rows(); ++i) part.row(i) = m.row(i * stride);
    return part;
  };
  return {take(r.angle),    take(r.rate),        take(r.measured),
          take(r.position), take(r.orientation), take(r.angular_velocity)};
}

struct Sums {
  Vector squares;   // of innovations
  Vector expected;  // of their deviations, squared
  Vector count;
  Vector freedom;  // of the variance: squared shares that the estimate leaves
};

Sums sum_groups(const BodyTorques& torques, const Vector& deviation,
                const std::vector<Index>& groups, Index number) {
  Sums sums{Vector::Zero(number), Vector::Zero(number), Vector::Zero(number), Vector::Zero(number)};
  for (Index row = 0; row < torques.innovation.cols(); ++row) {
    const Index g = groups[static_cast<std::size_t>(row)];
    if (g < 0) continue;
    for (Index i = 0; i < torques.innovation.rows(); ++i) {
      const double v = torques.innovation(i, row);
      if (!std::isfinite(v)) continue;
      const double d = torques.innovation_deviation(i, row);
      sums.squares[g] += v * v;
      sums.expected[g] += d * d;
      sums.count[g] += 1.0;
      const double share = d / deviation[row];
      sums.freedom[g] += share * share * share * share;
    }
  }
  return sums;
}

}  // namespace

std::vector<Index> variance_groups(const SensorSuite& suite) {
  std::vector<Index> groups;
  Index next = 0;
  for (const BodySensor& sensor : suite.sensors()) {
    // Rows of one unit: three of an accelerometer or of a force, three of a moment.
    for (Index k = 0; k < sensor_rows(sensor.kind); ++k) groups.push_back(next + k / 3);
    next += (sensor_rows(sensor.kind) + 2) / 3;
  }
  return groups;
}

SensorVariances sensor_variances(const SensorSuite& suite, const BodyRecording& recording,
                                 const VarianceOptions& options, Token* token) {
  check_recording(suite, recording);
  require(options.steps > 0 && options.frames > 0 && options.tolerance > 0.0 &&
              options.least > 0.0 && options.least <= 1.0,
          "options", "steps, frames and tolerance must be positive, and least between 0 and 1");
  require(recording.frames() > 0, "recording", "the recording holds no frames");
  const std::vector<Index> groups =
      options.groups.empty() ? variance_groups(suite) : options.groups;
  require(static_cast<Index>(groups.size()) == suite.rows(), "groups",
          sentence(10, "there are ", suite.rows(), " rows of measurements and ", groups.size(),
                   " groups"));
  Index number = 0;
  for (const Index g : groups) {
    require(g >= -1 && g < suite.rows(), "groups",
            sentence(10, "group ", g, " is not between -1 and ", suite.rows() - 1));
    number = std::max(number, g + 1);
  }
  const Index stride = (recording.frames() + options.frames - 1) / options.frames;
  const BodyRecording part = every(recording, stride);
  KeepOptions keep;
  keep.threads = options.threads;

  const auto run = [&](const Vector& deviation) {
    return estimate_recording(std::make_shared<const SensorSuite>(suite.with_deviations(deviation)),
                              part, {}, keep, 12, nullptr);
  };
  SensorVariances result;
  const Vector given = suite.deviations();
  result.deviation = given;
  BodyTorques now = run(result.deviation);
  for (Index k = 0; k < options.steps && !result.converged; ++k) {
    step(token, static_cast<double>(k) / static_cast<double>(options.steps));
    result.log_likelihood.push_back(now.log_likelihood);
    const Sums sums = sum_groups(now, result.deviation, groups, number);
    const auto stepped = [&](bool fast) {
      Vector deviation = result.deviation;
      for (Index row = 0; row < suite.rows(); ++row) {
        const Index g = groups[static_cast<std::size_t>(row)];
        if (g < 0) continue;
        const double variance = deviation[row] * deviation[row];
        if (sums.expected[g] <= kLeastFreedom * variance * sums.count[g]) continue;
        const double ratio =
            fast ? sums.squares[g] / sums.expected[g]
                 : 1.0 + (sums.squares[g] - sums.expected[g]) / (variance * sums.count[g]);
        // A step of at most ten times, either way: innovations of exact data would give zero.
        deviation[row] = std::max(deviation[row] * std::sqrt(std::clamp(ratio, 1e-2, 1e2)),
                                  options.least * given[row]);
      }
      return deviation;
    };
    Vector next = stepped(true);
    BodyTorques then = run(next);
    if (then.log_likelihood < now.log_likelihood) {
      next = stepped(false);
      then = run(next);
    }
    result.converged = true;
    for (Index row = 0; row < suite.rows(); ++row) {
      const Index g = groups[static_cast<std::size_t>(row)];
      if (g < 0) continue;
      const double old = result.deviation[row];
      const double error = 0.05 / std::sqrt(2.0 * std::max(sums.freedom[g], 1e-9));
      const double change = std::fabs(next[row] / old - 1.0);
      result.converged = result.converged && change < std::max(options.tolerance, error);
    }
    result.deviation = next;
    now = std::move(then);
  }
  result.log_likelihood.push_back(now.log_likelihood);
  result.freedom.setZero(suite.rows());
  const Sums sums = sum_groups(now, result.deviation, groups, number);
  for (Index row = 0; row < suite.rows(); ++row) {
    const Index g = groups[static_cast<std::size_t>(row)];
    if (g < 0) continue;
    result.freedom[row] = sums.freedom[g];
  }
  return result;
}

Vector relative_errors(const SensorSuite& suite, const BodyRecording& recording,
                       const BodyTorques& torques) {
  require(
      torques.innovation.rows() == recording.frames() && torques.innovation.cols() == suite.rows(),
      "torques", "the torques are not of this recording, or hold no innovations");
  Vector errors = Vector::Constant(suite.size(), kNaN);
  for (Index s = 0; s < suite.size(); ++s) {
    const Index rows = sensor_rows(suite.sensor(s).kind);
    double wrong = 0.0, all = 0.0;
    for (Index row = suite.row(s); row < suite.row(s) + rows; ++row) {
      for (Index i = 0; i < recording.frames(); ++i) {
        const double v = torques.innovation(i, row);
        if (!std::isfinite(v)) continue;
        wrong += v * v;
        all += recording.measured(i, row) * recording.measured(i, row);
      }
    }
    if (rows > 0 && all > 0.0) errors[s] = std::sqrt(wrong / all);
  }
  return errors;
}

}  // namespace ulna
