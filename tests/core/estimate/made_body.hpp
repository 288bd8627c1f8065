// Bodies, motions and sensors for tests of the whole-body estimators: what is true is known.
#pragma once

#include <Eigen/Geometry>

#include "base/random.hpp"
#include "estimate/body_sensors.hpp"
#include "plant/body/human_body.hpp"

namespace ulna::made {

inline Vector3 three(Random& random, double scale) {
  return scale * Vector3(random.normal(), random.normal(), random.normal());
}

inline Matrix3 rotation(Random& random) {
  const Vector3 v = three(random, 1.0);
  return Eigen::AngleAxisd(v.norm(), v.normalized()).toRotationMatrix();
}

inline std::shared_ptr<const BodyTree> human(HumanJoints joints = HumanJoints::k48) {
  return std::make_shared<const BodyTree>(
      human_body({.height = 1.793, .mass = 72.7, .joints = joints}));
}

// Twelve links in any pose, one of them fixed, one massless.
inline std::shared_ptr<const BodyTree> small_tree(std::uint64_t seed) {
  Random random(seed);
  std::vector<BodyLink> links;
  for (Index i = 0; i < 12; ++i) {
    BodyLink link;
    link.name = "link" + std::to_string(i);
    link.parent = i == 0 ? -1 : random.below(i);
    link.position = three(random, 0.3);
    link.orientation = rotation(random);
    if (i > 0 && i != 4) link.joint = "joint" + std::to_string(i);
    link.axis = three(random, 1.0).normalized();
    link.massless = i == 7;
    if (!link.massless) {
      link.mass = 0.5 + random.uniform();
      link.centre = three(random, 0.1);
      const Matrix3 r = rotation(random);
      link.inertia = r * Vector3(0.03, 0.04, 0.05).asDiagonal() * r.transpose();
      link.inertia = (0.5 * (link.inertia + link.inertia.transpose())).eval();
    }
    links.push_back(link);
  }
  return std::make_shared<const BodyTree>(BodyTree(std::move(links)));
}

// Where a body is, how it moves and what touches it.
struct Truth {
  BodyState state;
  Vector6 base;     // proper acceleration, world axes
  Vector joint;     // acceleration
  Matrix external;  // 6 x links
  Vector torque;
  Matrix joint_wrench;
};

// External wrenches on the named links, of which the first balances the motion; on all others as
// small ones as a prior of untouched links allows.
inline Truth make_truth(std::shared_ptr<const BodyTree> body, std::uint64_t seed,
                        const std::vector<Index>& touched,
                        const BodyPrior& prior = {.untouched_force = 0.0,
                                                  .untouched_moment = 0.0}) {
  Random random(seed, 1);
  Truth t;
  const Index n = body->dofs();
  t.state.position = three(random, 1.0);
  t.state.orientation = rotation(random);
  t.state.angular_velocity = three(random, 0.5);
  t.state.angle.resize(n);
  t.state.rate.resize(n);
  t.joint.resize(n);
  for (Index k = 0; k < n; ++k) {
    t.state.angle[k] = 0.5 * random.normal();
    t.state.rate[k] = random.normal();
    t.joint[k] = 3.0 * random.normal();
  }
  t.base.head<3>() = three(random, 1.0) + Vector3(0, 0, body->gravity());
  t.base.tail<3>() = three(random, 1.0);
  t.external.resize(6, body->size());
  for (Index i = 0; i < body->size(); ++i) {
    t.external.col(i) << three(random, prior.untouched_force),
        three(random, prior.untouched_moment);
  }
  for (const Index link : touched) {
    t.external.col(link).head<3>() = three(random, 50.0);
    t.external.col(link).tail<3>() = three(random, 10.0);
  }
  BodyMotion motion(body);
  motion.move(t.state);
  motion.accelerate(t.base, t.joint);
  t.torque.resize(n);
  t.joint_wrench.resize(6, body->size());
  Vector6 missing;
  motion.inverse_dynamics(t.external, t.torque, missing);
  // What is missing at the base origin is put on the first touched link.
  const LinkMotion& link = motion.link(touched.at(0));
  const Vector3 force = missing.head<3>();
  t.external.col(touched[0]).head<3>() += link.axes.transpose() * force;
  t.external.col(touched[0]).tail<3>() +=
      link.axes.transpose() * (missing.tail<3>() - link.origin.cross(force));
  motion.inverse_dynamics(t.external, t.torque, missing, &t.joint_wrench);
  return t;
}

// What the sensors of a suite read, without noise. Wrench sensors of one link share its wrench:
// the last one reads what the others left.
inline Vector readings(const SensorSuite& suite, const Truth& t) {
  BodyMotion motion(suite.shared_body());
  motion.move(t.state);
  motion.accelerate(t.base, t.joint);
  Vector y = Vector::Zero(suite.rows());
  for (Index s = 0; s < suite.size(); ++s) {
    const BodySensor& sensor = suite.sensor(s);
    const LinkMotion& link = motion.link(sensor.link);
    const Matrix3 axes = sensor.frame == SensorFrame::kLink
                             ? Matrix3(link.axes * sensor.orientation)
                             : sensor.orientation;
    const Index row = suite.row(s);
    switch (sensor.kind) {
      case BodySensorKind::kAccelerometer:
        y.segment<3>(row) =
            axes.transpose() * motion.acceleration(sensor.link, sensor.position).head<3>();
        break;
      case BodySensorKind::kAngularAcceleration:
        y.segment<3>(row) = axes.transpose() * motion.acceleration(sensor.link).tail<3>();
        break;
      case BodySensorKind::kJointAcceleration:
        y[row] = t.joint[suite.body().dof(sensor.link)];
        break;
      case BodySensorKind::kJointTorque:
        y[row] = t.torque[suite.body().dof(sensor.link)];
        break;
      case BodySensorKind::kJointWrench:
        y.segment<6>(row) = t.joint_wrench.col(sensor.link);
        break;
      case BodySensorKind::kExternalWrench:
      case BodySensorKind::kExternalForce: {
        // About the sensor's place, in its axes.
        const Vector3 force = link.axes * t.external.col(sensor.link).head<3>();
        const Vector3 moment = link.axes * t.external.col(sensor.link).tail<3>();
        const Vector3 at = sensor.frame == SensorFrame::kWorld
                               ? Vector3(sensor.position - t.state.position)
                               : Vector3(link.origin + link.axes * sensor.position);
        y.segment<3>(row) = axes.transpose() * force;
        if (sensor.kind == BodySensorKind::kExternalWrench) {
          y.segment<3>(row + 3) = axes.transpose() * (moment - (at - link.origin).cross(force));
        }
        break;
      }
      default:
        break;
    }
  }
  return y;
}

inline Vector noisy(const SensorSuite& suite, const Vector& y, std::uint64_t seed,
                    std::uint64_t stream) {
  Random random(seed, stream);
  Vector noisy = y;
  const Vector deviation = suite.deviations();
  for (Index k = 0; k < y.size(); ++k) noisy[k] += deviation[k] * random.normal();
  return noisy;
}

// The suit of the overhead study: 17 sensors, all joint accelerations, two shoes.
inline std::vector<BodySensor> suit(const BodyTree& body) {
  std::vector<BodySensor> sensors;
  for (const std::string& name : suit_links()) {
    const Index link = body.at_link(name);
    sensors.push_back({.name = "imu_" + name,
                       .kind = BodySensorKind::kAccelerometer,
                       .link = link,
                       .position = body.link(link).centre,
                       .deviation = Vector::Constant(1, 0.1)});
  }
  for (Index k = 0; k < body.dofs(); ++k) {
    const Index link = body.link_of_dof(k);
    sensors.push_back({.name = "ddq_" + body.link(link).joint,
                       .kind = BodySensorKind::kJointAcceleration,
                       .link = link,
                       .deviation = Vector::Constant(1, 0.5)});
  }
  for (const char* foot : {"RightFoot", "LeftFoot"}) {
    sensors.push_back({.name = std::string("shoe_") + foot,
                       .kind = BodySensorKind::kExternalWrench,
                       .link = body.at_link(foot),
                       .position = {0.05, 0.0, -0.06},
                       .deviation = Eigen::Vector2d(2.0, 0.5)});
  }
  return sensors;
}

}  // namespace ulna::made
