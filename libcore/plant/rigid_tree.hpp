// A tree of rigid bodies on hinges in closed form: kinematics and the recursive Newton-Euler
// equations (Featherstone 2008, chapter 5), written out in world axes. It is the nominal model
// beside the engine, and each proves the other.
#pragma once

#include <string>
#include <vector>

#include "base/types.hpp"

namespace ulna {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

struct RigidBody {
  std::string name = {};
  Index parent = -1;                          // -1: the world; parents come first
  Vector3 position = Vector3::Zero();         // of the body's frame in the parent, m
  Matrix3 orientation = Matrix3::Identity();  // columns: body axes in the parent
  std::string joint = {};                     // "": fixed to the parent
  Vector3 axis = Vector3::UnitZ();            // of the hinge, body axes, length 1
  double reference = 0.0;                     // angle at which the body stands as written, rad
  double mass = 0.0;                          // kg
  Vector3 centre = Vector3::Zero();           // of mass, body axes, m
  Matrix3 inertia = Matrix3::Zero();          // about the centre of mass, body axes, kg m^2
  bool massless = false;                      // a frame between two hinges at one point
};

class RigidTree {
 public:
  // Throws Error (kArgument) that names the body: parents that come later, masses that are not
  // positive, inertias that no body has, numbers that are not finite, axes of no length, names that
  // occur twice.
  explicit RigidTree(std::vector<RigidBody> bodies,
                     const Vector3& gravity = Vector3(0.0, 0.0, -9.81));

  const std::vector<RigidBody>& bodies() const noexcept { return bodies_; }
  const Vector3& gravity() const noexcept { return gravity_; }
  Index joints() const noexcept { return static_cast<Index>(hinges_.size()); }
  std::vector<std::string> joint_names() const;
  Vector reference() const;

  struct Pose {
    Vector3 position;     // of the body's frame in the world, m
    Matrix3 orientation;  // columns: body axes in the world
  };
  std::vector<Pose> poses(const VectorRef& angle) const;  // one a body

  // Torque at each hinge for a motion, without friction: M(q) a + c(q, v) + g(q), N m.
  Vector inverse_dynamics(const VectorRef& angle, const VectorRef& rate,
                          const VectorRef& acceleration) const;
  Vector gravity_torque(const VectorRef& angle) const;
  Matrix inertia(const VectorRef& angle) const;

 private:
  Vector newton_euler(const VectorRef& angle, const VectorRef& rate, const VectorRef& acceleration,
                      const Vector3& gravity) const;
  void check_size(const VectorRef& values, const char* argument) const;

  std::vector<RigidBody> bodies_;
  std::vector<Index> hinges_;  // body of each joint
  Vector3 gravity_;
};

// Throws Error (kArgument, argument "inertia") unless a body can have it; `what` begins the
// sentence.
void check_inertia(const Matrix3& inertia, const std::string& what);

}  // namespace ulna
