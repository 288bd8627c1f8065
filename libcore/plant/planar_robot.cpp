#include "plant/planar_robot.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {

Vector2 inverse_dynamics(const PlanarRobot& robot, const Vector2& angle, const Vector2& rate,
                         const Vector2& acceleration, const Vector2& force) {
  const RobotState s = robot.at(angle, rate);
  return s.inertia * acceleration + s.coriolis * rate + s.friction - s.jacobian.transpose() * force;
}

Vector2 forward_dynamics(const PlanarRobot& robot, const Vector2& angle, const Vector2& rate,
                         const Vector2& torque, const Vector2& force) {
  const RobotState s = robot.at(angle, rate);
  return s.inertia.inverse() *
         (torque + s.jacobian.transpose() * force - s.coriolis * rate - s.friction);
}

double jacobian_quality(const Matrix2& jacobian) {
  // With p the sum and q the product of the singular values, their squares are the roots of
  // z^2 - (p^2 - 2 q) z + q^2.
  const double sum_squares = jacobian.squaredNorm();
  const double product = std::abs(jacobian.determinant());
  const double root =
      std::sqrt(std::max(0.0, (sum_squares - 2.0 * product) * (sum_squares + 2.0 * product)));
  const double largest_square = 0.5 * (sum_squares + root);
  return largest_square > 0.0 ? product / largest_square : 0.0;
}

Matrix inverse_kinematics(const PlanarRobot& robot, MatrixRef positions, bool ignore_limits) {
  Matrix angles(positions.rows(), 2);
  for (Index i = 0; i < positions.rows(); ++i) {
    const std::string row = "row " + std::to_string(i);
    try {
      const Vector2 angle = robot.angles(Vector2(positions(i, 0), positions(i, 1)));
      angles.row(i) = angle.transpose();
      const std::string broken = ignore_limits ? std::string() : robot.broken_limit(angle);
      if (!broken.empty()) throw Error(Fault::kData, "position", broken);
    } catch (const Error& failure) {
      throw Error(failure.fault(), failure.argument(), row + ": " + failure.what(), row);
    }
  }
  return angles;
}

Vector2 usable_angles(const PlanarRobot& robot, const Vector2& position, const char* argument,
                      const std::string& what) {
  const auto refuse = [&](const std::string& why) {
    throw Error(Fault::kData, argument,
                sentence(4, what, " cannot be at (", position.x(), ", ", position.y(),
                         ") m in the robot's frame: ", why));
  };
  Vector2 angle = Vector2::Zero();
  try {
    angle = robot.angles(position);
  } catch (const Error& failure) {
    refuse(failure.what());
  }
  const std::string broken = robot.broken_limit(angle);
  if (!broken.empty()) refuse(broken);
  if (jacobian_quality(robot.at(angle, Vector2::Zero()).jacobian) < kSingular) {
    refuse("the pose is singular, one direction cannot be moved in; move it away from there");
  }
  return angle;
}

}  // namespace ulna
