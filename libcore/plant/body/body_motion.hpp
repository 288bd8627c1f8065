// Tree algorithms at one instant, in memory that is made once: kinematics, recursive Newton-Euler,
// composite inertia, centroidal momentum and its rate, Jacobians.
//
// Everything is told in one common frame, the base link's origin with the world's axes, so that
// what neighbours in the tree say to each other is added without a transformation: a wrench is
// (force, moment about the base origin), an acceleration field is (linear acceleration at the base
// origin of the rigid link thought to extend there, angular acceleration). With the velocities
// known, the field of link i is
//     A_i = A_base + sum over the hinges k on the way of S_k q''_k + K_i,     S_k = (p_k x s_k,
//     s_k)
// where K_i holds the products of velocities (Featherstone 2008, chapters 5 and 6, with classical
// instead of spatial accelerations). Accelerations are proper: a link that lies still has
// (0, 0, +g).
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "plant/body/body_tree.hpp"

namespace ulna {

// Where a body is and how it moves, world axes.
struct BodyState {
  Vector3 position = Vector3::Zero();          // of the base link's origin, m
  Matrix3 orientation = Matrix3::Identity();   // columns: axes of the base link
  Vector3 velocity = Vector3::Zero();          // of the base link's origin, m/s
  Vector3 angular_velocity = Vector3::Zero();  // of the base link, rad/s
  Vector angle;                                // of each hinge, rad
  Vector rate;                                 // rad/s
};

// One link in the common frame.
struct LinkMotion {
  Matrix3 axes = Matrix3::Identity();      // columns: link axes
  Vector3 origin = Vector3::Zero();        // from the base origin, m
  Vector3 turn = Vector3::Zero();          // angular velocity, rad/s
  Vector6 hinge = Vector6::Zero();         // S; zero for the base and for fixed links
  Vector6 drift = Vector6::Zero();         // K
  Vector6 acceleration = Vector6::Zero();  // A, after accelerate()
  double mass = 0.0;                       // kg
  Vector3 centre = Vector3::Zero();        // of mass, from the base origin, m
  Matrix3 inertia = Matrix3::Zero();       // about the centre of mass, kg m^2
  Vector6 gyroscopic = Vector6::Zero();    // wrench of the products of velocities
};

// Wrench that a link's inertia takes for an acceleration field, products of velocities left out.
inline Vector6 inertial_wrench(const LinkMotion& link, const Vector6& field) {
  Vector6 wrench;
  wrench.head<3>() = link.mass * (field.head<3>() + field.tail<3>().cross(link.centre));
  wrench.tail<3>() = link.inertia * field.tail<3>() + link.centre.cross(Vector3(wrench.head<3>()));
  return wrench;
}

// Columns: wrenches about the base origin of a unit force and moment along the link's axes, at its
// origin. Its transpose takes a wrench to the link's own frame.
Matrix6 wrench_frame(const LinkMotion& link);

class BodyMotion {
 public:
  explicit BodyMotion(std::shared_ptr<const BodyTree> body);

  const BodyTree& body() const noexcept { return *body_; }
  const std::shared_ptr<const BodyTree>& shared_body() const noexcept { return body_; }

  // Kinematics. The state must have as many angles and rates as the body has hinges (unchecked
  // here: the functions that take states from outside check them). Allocates nothing.
  void move(const BodyState& state);

  // After move(): acceleration fields of all links from the base link's proper acceleration (of its
  // origin, then angular; world axes) and the hinges'.
  void accelerate(const Vector6& base, const VectorRef& joint);

  const LinkMotion& link(Index i) const { return links_[static_cast<std::size_t>(i)]; }
  Vector3 position(Index link, const Vector3& point = Vector3::Zero()) const;  // in the world, m
  Vector6 velocity(Index link,
                   const Vector3& point = Vector3::Zero()) const;  // of the point, world
  // After accelerate(), of a point of a link (link axes): proper linear, then angular; world axes.
  Vector6 acceleration(Index link, const Vector3& point = Vector3::Zero()) const;

  // After accelerate(): torque of every hinge for external wrenches on the links (6 x links: force,
  // moment about the link's origin; link axes), and the wrench about the base origin (world axes)
  // that is still missing at the base, zero for wrenches that balance the motion. `joint_wrench`
  // (6 x links, may be null): what each parent exerts on its link, as `external`.
  void inverse_dynamics(const Eigen::Ref<const Matrix>& external, Eigen::Ref<Vector> torque,
                        Vector6& missing, Matrix* joint_wrench = nullptr);

  // After move(): of all velocities (base linear, base angular, hinges), (6 + n) x (6 + n).
  void mass_matrix(Eigen::Ref<Matrix> inertia);
  // Of a point of a link: linear then angular velocity for those velocities, 6 x (6 + n).
  void jacobian(Index link, const Vector3& point, Eigen::Ref<Matrix> jacobian) const;

  Vector3 centre_of_mass() const;  // in the world, m
  Vector3 centre_of_mass_velocity() const;
  // Linear momentum (kg m/s) and angular momentum about the centre of mass (kg m^2/s), world axes.
  Vector6 centroidal_momentum() const;
  // After accelerate(): its rate, gravity counted as an external force: the sum of all external
  // wrenches and the weight, about the centre of mass.
  Vector6 centroidal_momentum_rate() const;
  // All links as one rigid body, about the base origin, world axes.
  Matrix6 locked_inertia() const;

 private:
  std::shared_ptr<const BodyTree> body_;
  std::vector<LinkMotion> links_;
  std::vector<Vector6> wrench_;
  std::vector<Matrix6> composite_;
  Vector3 position_ = Vector3::Zero();
  Vector3 velocity_ = Vector3::Zero();
};

// Throws Error (kArgument, argument "angle", "rate", ...) unless the state has the body's sizes,
// holds finite numbers and a rotation.
void check_state(const BodyTree& body, const BodyState& state);

}  // namespace ulna
