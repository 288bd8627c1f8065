// A recording of the thesis' robot that is exact: angles are sums of sines, whose derivatives are
// known, and torques follow from the inverse dynamics under the force of a known arm.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/random.hpp"
#include "plant/capstan_robot.hpp"
#include "record/record.hpp"

namespace ulna {

struct MadeRobot {
  CapstanParameters robot;
  double duration_s = 30.0;
  double rate_hz = 500.0;
  double range_rad = 0.15;  // of every joint
  Vector2 centre = Vector2(0.8, 0.9);
  bool contact = true;  // an arm holds the handle
  Matrix2 m = (Matrix2() << 1.3, 0.3, 0.3, 0.9).finished();
  Matrix2 b = (Matrix2() << 9.0, 1.0, 2.0, 6.0).finished();
  Matrix2 k = (Matrix2() << 120.0, 20.0, 35.0, 80.0).finished();
  double angle_noise = 0.0, torque_noise = 0.0, acceleration_noise = 0.0;
  // The reference is the motion before this disturbance, as a controller that is not perfect.
  double wobble_rad = 0.0;
  std::uint64_t seed = 0;
};

struct MadeLog {
  std::shared_ptr<Record> record;
  Matrix force;  // truth, rows x 2
};

inline Channel made_channel(const std::string& name, const std::string& unit,
                            Role role = Role::kOther, int axis = 0) {
  Channel c;
  c.name = name;
  c.unit = unit;
  c.role = role;
  c.axis = axis;
  return c;
}

// Channels theta_1, theta_2, tau_1, tau_2, a_x, a_y, ref_1, ref_2, x, y.
inline MadeLog make_robot_log(const MadeRobot& made) {
  const CapstanRobot robot(made.robot);
  const auto rows = static_cast<Index>(made.duration_s * made.rate_hz);
  Random phases(made.seed, 1);
  constexpr int kLines = 8;
  std::array<std::array<double, kLines>, 2> phase{};
  std::array<std::array<double, kLines>, 2> shaken{};
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < kLines; ++i) {
      phase[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)] =
          2.0 * kPi * phases.uniform();
      shaken[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)] =
          2.0 * kPi * phases.uniform();
    }
  }
  Random noise(made.seed, 2);
  Record::Parts parts;
  parts.rate_hz = made.rate_hz;
  parts.values.resize(rows, 10);
  Matrix force(rows, 2);
  const Vector2 home = robot.at(made.centre, Vector2::Zero()).position;
  for (Index row = 0; row < rows; ++row) {
    const double t = static_cast<double>(row) / made.rate_hz;
    Vector2 q = made.centre;
    Vector2 command = made.centre;
    Vector2 rate = Vector2::Zero();
    Vector2 second = Vector2::Zero();
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < kLines; ++i) {
        // The joints have lines of their own, up to 2 Hz.
        const double w = 2.0 * kPi * (0.12 + 0.23 * i + 0.05 * j);
        const auto add = [&](double amplitude, double at, bool commanded) {
          q[j] += amplitude * std::sin(at);
          rate[j] += amplitude * w * std::cos(at);
          second[j] -= amplitude * w * w * std::sin(at);
          if (commanded) command[j] += amplitude * std::sin(at);
        };
        const auto a = static_cast<std::size_t>(j);
        const auto b = static_cast<std::size_t>(i);
        add(made.range_rad / 4.0, w * t + phase[a][b], true);
        add(made.wobble_rad / 4.0, 1.03 * w * t + shaken[a][b], false);
        // The wobble's frequency differs; its derivatives follow it.
        rate[j] += 0.03 * made.wobble_rad / 4.0 * w * std::cos(1.03 * w * t + shaken[a][b]);
        second[j] -= (1.03 * 1.03 - 1.0) * made.wobble_rad / 4.0 * w * w *
                     std::sin(1.03 * w * t + shaken[a][b]);
      }
    }
    const RobotState s = robot.at(q, rate);
    const Vector2 velocity = s.jacobian * rate;
    const Vector2 acceleration = s.jacobian * second + s.jacobian_rate * rate;
    Vector2 f = Vector2::Zero();
    if (made.contact) {
      f = -(made.m * acceleration + made.b * velocity + made.k * (s.position - home));
    }
    force.row(row) = f.transpose();
    const Vector2 torque = inverse_dynamics(robot, q, rate, second, f);
    auto out = parts.values.row(row);
    for (Index j = 0; j < 2; ++j) {
      out[j] = q[j] + made.angle_noise * noise.normal();
      out[2 + j] = torque[j] + made.torque_noise * noise.normal();
      out[4 + j] = acceleration[j] + made.acceleration_noise * noise.normal();
      out[6 + j] = command[j];
      out[8 + j] = s.position[j];
    }
  }
  parts.channels = {made_channel("theta_1", "rad"),
                    made_channel("theta_2", "rad"),
                    made_channel("tau_1", "Nm"),
                    made_channel("tau_2", "Nm"),
                    made_channel("a_x", "m/s^2"),
                    made_channel("a_y", "m/s^2"),
                    made_channel("ref_1", "rad"),
                    made_channel("ref_2", "rad"),
                    made_channel("x", "m", Role::kPosition, 0),
                    made_channel("y", "m", Role::kPosition, 1)};
  return {std::make_shared<Record>(Record::make(std::move(parts))), std::move(force)};
}

// Force at the rows of a sensed record (those of the source from its dropped rows on).
inline Matrix truth_at(const MadeLog& log, const Record& sensed) {
  const Index dropped = (log.record->rows() - sensed.rows()) / 2;
  return log.force.middleRows(dropped, sensed.rows());
}

}  // namespace ulna
