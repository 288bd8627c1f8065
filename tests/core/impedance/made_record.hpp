// Records with a known impedance: every axis moves along its own sum of sinusoids, whose
// derivatives are known, and the force is what (3.2) says.
#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/random.hpp"
#include "impedance/natural.hpp"
#include "record/record.hpp"

namespace ulna {

struct Truth {
  Matrix m, b, k;
  Vector x0;

  Vector natural() const {
    const Index n = m.rows();
    Vector out(natural_size(n));
    Index at = 0;
    for (const Matrix* matrix : {&m, &b, &k}) {
      for (Index i = 0; i < n; ++i) {
        for (Index j = 0; j < n; ++j) out[at++] = (*matrix)(i, j);
      }
    }
    out.tail(n) = x0;
    return out;
  }
};

// Participants of Table 3.2 of Dyck 2013 (sinusoidal perturbations), 1 to 6.
inline Truth participant(int number) {
  static constexpr double kTable[6][12] = {
      {1.33, -0.93, -0.96, 1.89, 5.75, -3.39, -0.94, 10.60, 42.45, -34.38, -23.02, 125.43},
      {1.30, -0.76, -0.85, 1.36, 5.77, -3.69, -1.49, 9.12, 45.14, -33.40, -35.25, 112.49},
      {1.53, -0.91, -0.99, 1.71, 6.02, -4.27, -2.40, 10.47, 39.52, -30.34, -26.10, 108.60},
      {1.42, -1.01, -1.05, 1.88, 4.75, -3.81, -2.59, 9.61, 36.61, -43.45, -42.97, 151.45},
      {1.27, -0.91, -0.98, 2.07, 4.81, -3.19, -1.83, 11.89, 38.98, -25.03, -31.46, 164.95},
      {1.11, -0.74, -0.81, 1.67, 3.16, -1.96, -0.67, 8.23, 22.64, -17.28, -30.26, 93.75}};
  const double* v = kTable[number - 1];
  const auto matrix = [&](int first) {
    return Matrix{{v[first], v[first + 1]}, {v[first + 2], v[first + 3]}};
  };
  return {matrix(0), matrix(4), matrix(8), Vector{{-0.003, 0.529}}};
}

struct Recording {
  double rate_hz = 250.0;
  double duration_s = 40.0;  // of each trial
  double band_hz = 3.0;
  int trials = 1;
  int segments = 1;  // of each trial
  bool reference = true;
  double force_noise = 0.0;  // N, white
  double force_delay_s = 0.0;
  std::uint64_t seed = 1;
  // Replaces the motion of an axis: (axis, t) -> position, velocity, acceleration, about 0.
  std::function<Vector(Index, double)> motion;
};

inline Record make_record(const Truth& truth, const Recording& r) {
  const Index n = truth.m.rows();
  const Index each = static_cast<Index>(std::lround(r.duration_s * r.rate_hz));
  constexpr int kLines = 10;
  Record::Parts parts;
  parts.values = Matrix::Zero(each * r.trials, r.reference ? 3 * n : 2 * n);
  for (int trial = 0; trial < r.trials; ++trial) {
    Random random(r.seed, static_cast<std::uint64_t>(trial));
    Matrix phase(kLines, n), frequency(kLines, n);
    for (double& p : phase.reshaped()) p = 2.0 * kPi * random.uniform();
    for (Index a = 0; a < n; ++a) {
      for (int l = 0; l < kLines; ++l) {
        frequency(l, a) =
            r.band_hz * (l + (static_cast<double>(a) + 0.5) / static_cast<double>(n)) / kLines;
      }
    }
    // Position, velocity, acceleration and reference of all axes at a time.
    const auto state = [&](double t) {
      Matrix s = Matrix::Zero(n, 4);
      for (Index a = 0; a < n; ++a) {
        if (r.motion) {
          s.row(a).head(3) = r.motion(a, t).transpose();
          continue;
        }
        for (int l = 0; l < kLines; ++l) {
          const double w = 2.0 * kPi * frequency(l, a);
          const double angle = w * t + phase(l, a);
          s(a, 0) += 0.004 * std::cos(angle);
          s(a, 1) -= 0.004 * w * std::sin(angle);
          s(a, 2) -= 0.004 * w * w * std::cos(angle);
          s(a, 3) += 0.005 * std::cos(angle + 0.1 * w);  // the robot follows late
        }
      }
      return s;
    };
    const Index first = each * trial;
    for (Index i = 0; i < each; ++i) {
      const double t = static_cast<double>(i) / r.rate_hz;
      const Matrix now = state(t);
      const Matrix then = state(t - r.force_delay_s);
      const Vector force = -(truth.m * then.col(2) + truth.b * then.col(1) +
                             truth.k * (then.col(0) + Vector::Constant(n, 0.1) - truth.x0));
      parts.time.push_back(static_cast<double>(first + i) / r.rate_hz + trial);
      auto row = parts.values.row(first + i);
      row.head(n) = now.col(0).transpose().array() + 0.1;  // about a place that is not 0
      for (Index a = 0; a < n; ++a) row[n + a] = force[a] + r.force_noise * random.normal();
      if (r.reference) row.tail(n) = now.col(3).transpose().array() + 0.1;
    }
    parts.trials.push_back({first, first + each});
    for (int s = 0; r.segments > 1 && s < r.segments; ++s) {
      parts.segments.push_back(
          {first + each * s / r.segments, first + each * (s + 1) / r.segments, trial});
    }
  }
  static const char* const kAxes[] = {"x", "y", "z", "u", "v", "w"};
  const auto channels = [&](const std::string& before, const std::string& after, Role role,
                            const std::string& unit) {
    for (Index a = 0; a < n; ++a) {
      Channel channel;
      channel.name = before + kAxes[a] + after;
      channel.unit = unit;
      channel.role = role;
      channel.axis = static_cast<int>(a);
      parts.channels.push_back(std::move(channel));
    }
  };
  channels("", "", Role::kPosition, "m");
  channels("F_", "", Role::kForce, "N");
  if (r.reference) channels("", "_ref", Role::kReference, "m");
  parts.rate_hz = r.rate_hz;
  return Record::make(std::move(parts));
}

}  // namespace ulna
