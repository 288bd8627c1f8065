// A planar robot of two joints, seen by simulations and virtual sensors: kinematics and dynamics of
//   I(q) q'' + C(q, q') q' + F_r(q') = tau + J(q)^T F_ext                (5.1) of Dyck 2013,
// q the joint angles, tau the motor torques, F_ext the force by the human on the robot's handle.
// Units: rad, N m, N, m, kg m^2; frame: the robot's base.
#pragma once

#include <Eigen/Dense>
#include <string>

#include "base/types.hpp"

namespace ulna {

using Vector2 = Eigen::Vector2d;
using Matrix2 = Eigen::Matrix2d;

// All that a step of a simulation needs at one state, computed together to share sines and cosines.
struct RobotState {
  Vector2 position;       // of the handle
  Matrix2 jacobian;       // d position / d q
  Matrix2 jacobian_rate;  // its time derivative
  Matrix2 inertia;        // I(q)
  Matrix2 coriolis;       // C(q, q'), with I' - 2 C skew-symmetric
  Vector2 friction;       // F_r(q')
};

// Immutable, shared by threads. A new mechanism is one class.
class PlanarRobot {
 public:
  virtual ~PlanarRobot() = default;

  virtual std::string name() const = 0;  // as it appears in provenance

  // True when x and y never act on each other, so that an experiment may use x alone.
  virtual bool has_independent_axes() const { return false; }

  virtual RobotState at(const Vector2& angle, const Vector2& rate) const = 0;

  // Angles that bring the handle there; throws Error (kData) when it is out of reach. The joint
  // limits are not looked at.
  virtual Vector2 angles(const Vector2& position) const = 0;

  // What is wrong with these angles, as "joint 2 is at 150.0 deg, beyond its limits of ...";
  // empty when they are within the limits.
  virtual std::string broken_limit(const Vector2& angle) const = 0;

  // Parameters that the dynamics are linear in, and 2 x count with regressor * parameters =
  // inverse dynamics without an external force, dry friction left out.
  virtual Vector parameters() const = 0;
  virtual Matrix regressor(const Vector2& angle, const Vector2& rate,
                           const Vector2& acceleration) const = 0;
};

// Motor torque for a motion under an external force.
Vector2 inverse_dynamics(const PlanarRobot& robot, const Vector2& angle, const Vector2& rate,
                         const Vector2& acceleration, const Vector2& force);

// Joint acceleration under motor torque and an external force.
Vector2 forward_dynamics(const PlanarRobot& robot, const Vector2& angle, const Vector2& rate,
                         const Vector2& torque, const Vector2& force);

// Smallest over largest singular value of a Jacobian: 1 where all directions are alike, 0 at a
// singular pose. Below kSingular forces and motions there cannot be told from each other.
double jacobian_quality(const Matrix2& jacobian);
inline constexpr double kSingular = 1e-3;

// Throws Error (kData, detail "row R") at the first row that is out of reach or, unless
// ignore_limits, beyond the joint limits. positions, result: rows x 2.
Matrix inverse_kinematics(const PlanarRobot& robot, MatrixRef positions, bool ignore_limits);

// Throws Error (kData) unless the handle can be there: reachable, within the limits, not singular.
// `what` opens the sentence, as "the handle".
Vector2 usable_angles(const PlanarRobot& robot, const Vector2& position, const char* argument,
                      const std::string& what);

}  // namespace ulna
