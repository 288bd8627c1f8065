// What is measured on a body, and what is assumed where nothing is: the model Y d + b_Y = y of
// Latella et al. 2021, (5), with the prior on d of its section II-C.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "plant/body/body_motion.hpp"

namespace ulna {

enum class BodySensorKind {
  kAccelerometer,        // 3 rows: proper acceleration of the sensor's place, sensor axes, m/s^2
  kAngularAcceleration,  // 3 rows: of the link, sensor axes, rad/s^2
  kJointAcceleration,    // 1 row: of a hinge, rad/s^2
  kExternalWrench,       // 6 rows: force and moment about the sensor's place, sensor axes, N, N m
  kExternalForce,        // 3 rows: force at the sensor's place, without a moment, N
  kFreeWrench,           // no rows: something touches the link, nobody knows how
  kFreeForce,            // no rows: likewise, as a force at one place (a hand on a wall)
  kJointTorque,          // 1 row: of a hinge, N m
  kJointWrench,          // 6 rows: of the parent on the link, about the joint, link axes
};

// What a sensor's place and axes are fixed to.
enum class SensorFrame {
  kLink,       // place and axes are the link's
  kWorldAxes,  // the place is the link's, the axes are the world's
  kWorld,      // place and axes are the world's: a force plate (wrenches only)
};

// One sensor, or one contact. The wrenches of one link add up: two plates under one foot, a tool in
// a hand, a device on a pelvis. A link on which nothing is named is untouched.
struct BodySensor {
  std::string name;
  BodySensorKind kind = BodySensorKind::kAccelerometer;
  Index link = -1;                            // for joints: the link that the joint carries
  Vector3 position = Vector3::Zero();         // m
  Matrix3 orientation = Matrix3::Identity();  // columns: sensor axes
  SensorFrame frame = SensorFrame::kLink;
  // Standard deviation of the noise, one a row; one number for all rows; two numbers for forces and
  // moments of a wrench. Of free wrenches: how large they may be (none: as the prior says).
  Vector deviation = {};
};

// Standard deviations of what is assumed before anything is measured (mean: rest, untouched).
struct BodyPrior {
  double base_acceleration = 100.0;          // of the base link's origin about +g upwards, m/s^2
  double base_angular_acceleration = 300.0;  // rad/s^2
  double joint_acceleration = 300.0;         // rad/s^2
  double force = 1000.0;                     // of a free or missing component, N
  double moment = 300.0;                     // N m
  double untouched_force = 1e-3;             // on every link, N
  double untouched_moment = 1e-4;            // N m
};

Index sensor_rows(BodySensorKind kind);

class SensorSuite {
 public:
  // Throws Error (kArgument) that names the sensor: unknown links, joints of fixed links, names
  // that occur twice, orientations that are no rotation, deviations that are missing or not
  // positive, and (argument "prior") priors that are not positive.
  SensorSuite(std::shared_ptr<const BodyTree> body, std::vector<BodySensor> sensors,
              const BodyPrior& prior = {});

  const BodyTree& body() const noexcept { return *body_; }
  const std::shared_ptr<const BodyTree>& shared_body() const noexcept { return body_; }
  const std::vector<BodySensor>& sensors() const noexcept { return sensors_; }
  const BodySensor& sensor(Index i) const { return sensors_[static_cast<std::size_t>(i)]; }
  const BodyPrior& prior() const noexcept { return prior_; }
  Index size() const noexcept { return static_cast<Index>(sensors_.size()); }
  Index rows() const noexcept { return rows_; }  // of the measurement vector y
  Index row(Index sensor) const { return first_[static_cast<std::size_t>(sensor)]; }
  Index find(const std::string& name) const;   // -1 where there is none
  std::vector<std::string> row_names() const;  // "shoe_right.force_x", ...

  // The same sensors with other deviations, one a row of y. Throws as the constructor.
  SensorSuite with_deviations(const VectorRef& deviation) const;
  Vector deviations() const;  // one a row of y

 private:
  std::shared_ptr<const BodyTree> body_;
  std::vector<BodySensor> sensors_;  // deviations as long as the rows (6 or 3 for free ones)
  BodyPrior prior_;
  std::vector<Index> first_;
  Index rows_ = 0;
};

}  // namespace ulna
