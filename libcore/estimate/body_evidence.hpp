// What one frame of measurements says about each link, in the common frame of BodyMotion: the
// information of the motion sensors, and the external wrenches with their covariance. Both solvers
// start from it.
#pragma once

#include "estimate/body_sensors.hpp"

namespace ulna {

inline constexpr double kLogTwoPi = 1.8378770664093454836;  // ln(2 pi)

struct LinkEvidence {
  // About the link's acceleration field without its drift: normal equations.
  Matrix6 info = Matrix6::Zero();
  Vector6 rhs = Vector6::Zero();
  double weight = 0.0, weighted = 0.0;  // of the hinge's acceleration: 1/variance, mean/variance
  Vector6 external = Vector6::Zero();   // net external wrench as measured, about the base origin
  Matrix6 spread = Matrix6::Zero();     // its covariance
};

// A named external wrench.
struct ContactEvidence {
  Index sensor = 0;
  Index link = 0;
  Index components = 6;                // 3: a force without moment
  Matrix6 frame = Matrix6::Zero();     // columns: unit components, about the base origin
  Vector6 variance = Vector6::Zero();  // of each component
  Vector6 mean = Vector6::Zero();
};

// A measured component of a joint's wrench.
struct JointEvidence {
  Index sensor = 0;
  Index row = 0;  // of y
  Index link = 0;
  Index component = -1;  // of the wrench in link axes; -1: the hinge's torque
  double variance = 1.0;
  // The component is the dot product of this with the wrench about the base origin. Zero: missing.
  Vector6 direction = Vector6::Zero();
  double value = 0.0;
};

class BodyEvidence {
 public:
  explicit BodyEvidence(std::shared_ptr<const SensorSuite> suite);

  // motion: moved to `state`. Allocates nothing.
  void gather(const BodyMotion& motion, const BodyState& state, const VectorRef& y) noexcept;

  std::vector<LinkEvidence> links;
  std::vector<ContactEvidence> contacts;
  std::vector<JointEvidence> joints;
  Index motion_rows = 0;        // that were there
  double motion_squares = 0.0;  // sum of weight x value^2, the base's prior included
  double log_weights = 0.0;     // of the normal densities of those rows, the exponent left out

 private:
  void gather_motion(const BodyMotion& motion, const VectorRef& y);
  void gather_wrenches(const BodyMotion& motion, const BodyState& state, const VectorRef& y);
  void gather_joints(const BodyMotion& motion, const VectorRef& y);

  std::shared_ptr<const SensorSuite> suite_;
};

// Axes and place of a sensor in the common frame; base: the base origin in the world.
struct PlacedSensor {
  Matrix3 axes;
  Vector3 at;
};
PlacedSensor placed_sensor(const BodySensor& sensor, const LinkMotion& link, const Vector3& base);

Matrix3 cross_matrix(const Vector3& v);  // cross_matrix(v) x = v.cross(x)

// Covariance about the base origin of an isotropic wrench at a link's origin (variances of force
// and moment).
Matrix6 isotropic_wrench(const Vector3& origin, double force, double moment);

}  // namespace ulna
