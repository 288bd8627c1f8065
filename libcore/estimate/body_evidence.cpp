#include "estimate/body_evidence.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace ulna {
namespace {

using Kind = BodySensorKind;

// A component of the wrench through a link's joint (link axes, about its origin) is the dot product
// of this with the wrench about the base origin.
Vector6 joint_direction(const LinkMotion& link, Index component) {
  Vector6 direction = Vector6::Zero();
  const Vector3 axis = link.axes.col(component % 3);
  if (component < 3) {
    direction.head<3>() = axis;
  } else {
    direction.head<3>() = link.origin.cross(axis);
    direction.tail<3>() = axis;
  }
  return direction;
}

}  // namespace

Matrix3 cross_matrix(const Vector3& v) {
  Matrix3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

PlacedSensor placed_sensor(const BodySensor& sensor, const LinkMotion& link, const Vector3& base) {
  switch (sensor.frame) {
    case SensorFrame::kWorldAxes:
      return {sensor.orientation, link.origin + link.axes * sensor.position};
    case SensorFrame::kWorld:
      return {sensor.orientation, sensor.position - base};
    case SensorFrame::kLink:
      break;
  }
  return {link.axes * sensor.orientation, link.origin + link.axes * sensor.position};
}

Matrix6 isotropic_wrench(const Vector3& origin, double force, double moment) {
  const Matrix3 x = cross_matrix(origin);
  Matrix6 m;
  m.topLeftCorner<3, 3>() = force * Matrix3::Identity();
  m.topRightCorner<3, 3>() = -force * x;
  m.bottomLeftCorner<3, 3>() = force * x;
  m.bottomRightCorner<3, 3>() = (moment + force * origin.squaredNorm()) * Matrix3::Identity() -
                                force * origin * origin.transpose();
  return m;
}

BodyEvidence::BodyEvidence(std::shared_ptr<const SensorSuite> suite)
    : links(static_cast<std::size_t>(suite->body().size())), suite_(std::move(suite)) {
  for (Index s = 0; s < suite_->size(); ++s) {
    const BodySensor& sensor = suite_->sensor(s);
    switch (sensor.kind) {
      case Kind::kExternalWrench:
      case Kind::kFreeWrench:
        contacts.push_back({.sensor = s, .link = sensor.link});
        break;
      case Kind::kExternalForce:
      case Kind::kFreeForce:
        contacts.push_back({.sensor = s, .link = sensor.link, .components = 3});
        break;
      case Kind::kJointTorque:
        joints.push_back({.sensor = s, .row = suite_->row(s), .link = sensor.link});
        break;
      case Kind::kJointWrench:
        for (Index k = 0; k < 6; ++k) {
          joints.push_back(
              {.sensor = s, .row = suite_->row(s) + k, .link = sensor.link, .component = k});
        }
        break;
      default:
        break;
    }
  }
}

void BodyEvidence::gather(const BodyMotion& motion, const BodyState& state,
                          const VectorRef& y) noexcept {
  gather_motion(motion, y);
  gather_wrenches(motion, state, y);
  gather_joints(motion, y);
}

// Information of the motion sensors about each link's field, and of the prior.
void BodyEvidence::gather_motion(const BodyMotion& motion, const VectorRef& y) {
  const BodyPrior& prior = suite_->prior();
  const double joint_weight = 1.0 / (prior.joint_acceleration * prior.joint_acceleration);
  for (LinkEvidence& node : links) {
    node.info.setZero();
    node.rhs.setZero();
    node.weight = joint_weight;
    node.weighted = 0.0;
  }
  motion_rows = 0;
  motion_squares = 0.0;
  log_weights = 0.0;
  LinkEvidence& base = links[0];
  const double linear = 1.0 / (prior.base_acceleration * prior.base_acceleration);
  const double angular = 1.0 / (prior.base_angular_acceleration * prior.base_angular_acceleration);
  base.info.diagonal() << Vector3::Constant(linear), Vector3::Constant(angular);
  base.rhs[2] = linear * suite_->body().gravity();
  motion_squares += base.rhs[2] * suite_->body().gravity();

  const auto count = [&](double weight, double value) {
    ++motion_rows;
    motion_squares += weight * value * value;
    log_weights += 0.5 * (std::log(weight) - kLogTwoPi);
  };
  for (Index s = 0; s < suite_->size(); ++s) {
    const BodySensor& sensor = suite_->sensor(s);
    const Index row = suite_->row(s);
    LinkEvidence& node = links[static_cast<std::size_t>(sensor.link)];
    if (sensor.kind == Kind::kJointAcceleration) {
      if (!std::isfinite(y[row])) continue;
      const double weight = 1.0 / (sensor.deviation[0] * sensor.deviation[0]);
      node.weight += weight;
      node.weighted += weight * y[row];
      count(weight, y[row]);
      continue;
    }
    const bool turning = sensor.kind == Kind::kAngularAcceleration;
    if (!turning && sensor.kind != Kind::kAccelerometer) continue;
    const LinkMotion& link = motion.link(sensor.link);
    const PlacedSensor placed = placed_sensor(sensor, link, Vector3::Zero());
    // What the sensor would read without the unknown part of the field.
    Vector3 offset = link.drift.tail<3>();
    if (!turning) {
      offset = link.drift.head<3>() + offset.cross(placed.at) +
               link.turn.cross(link.turn.cross(placed.at - link.origin));
    }
    const Vector3 known = placed.axes.transpose() * offset;
    Vector3 weight = Vector3::Zero();
    Vector3 value = Vector3::Zero();
    for (Index k = 0; k < 3; ++k) {
      if (!std::isfinite(y[row + k])) continue;
      weight[k] = 1.0 / (sensor.deviation[k] * sensor.deviation[k]);
      value[k] = y[row + k] - known[k];
      count(weight[k], value[k]);
    }
    const Matrix3 w = placed.axes * weight.asDiagonal() * placed.axes.transpose();
    const Vector3 z = placed.axes * weight.cwiseProduct(value);
    if (turning) {
      node.info.bottomRightCorner<3, 3>() += w;
      node.rhs.tail<3>() += z;
      continue;
    }
    // y = [1, -[x]] field: its normal equations.
    const Matrix3 x = cross_matrix(placed.at);
    const Matrix3 wx = w * x;
    node.info.topLeftCorner<3, 3>() += w;
    node.info.topRightCorner<3, 3>() -= wx;
    node.info.bottomLeftCorner<3, 3>() += x * w;
    node.info.bottomRightCorner<3, 3>() -= x * wx;
    node.rhs.head<3>() += z;
    node.rhs.tail<3>() += placed.at.cross(z);
  }
}

// External wrenches as they are measured, about the base origin.
void BodyEvidence::gather_wrenches(const BodyMotion& motion, const BodyState& state,
                                   const VectorRef& y) {
  const BodyPrior& prior = suite_->prior();
  const double a = prior.untouched_force * prior.untouched_force;
  const double b = prior.untouched_moment * prior.untouched_moment;
  for (std::size_t i = 0; i < links.size(); ++i) {
    links[i].external.setZero();
    links[i].spread = isotropic_wrench(motion.link(static_cast<Index>(i)).origin, a, b);
  }
  for (ContactEvidence& contact : contacts) {
    const BodySensor& sensor = suite_->sensor(contact.sensor);
    const Index row = suite_->row(contact.sensor);
    const bool is_measured = sensor_rows(sensor.kind) > 0;
    const PlacedSensor placed = placed_sensor(sensor, motion.link(contact.link), state.position);
    contact.frame.topLeftCorner<3, 3>() = placed.axes;
    contact.frame.bottomLeftCorner<3, 3>().noalias() = cross_matrix(placed.at) * placed.axes;
    contact.frame.bottomRightCorner<3, 3>() = placed.axes;
    for (Index k = 0; k < contact.components; ++k) {
      double deviation = sensor.deviation[k];
      contact.mean[k] = 0.0;
      if (is_measured && std::isfinite(y[row + k])) {
        contact.mean[k] = y[row + k];
      } else if (is_measured) {
        deviation = k < 3 ? prior.force : prior.moment;
      }
      contact.variance[k] = deviation * deviation;
    }
    LinkEvidence& node = links[static_cast<std::size_t>(contact.link)];
    node.external.noalias() += contact.frame * contact.mean;
    node.spread.noalias() +=
        contact.frame * contact.variance.asDiagonal() * contact.frame.transpose();
  }
}

void BodyEvidence::gather_joints(const BodyMotion& motion, const VectorRef& y) {
  for (JointEvidence& extra : joints) {
    const double deviation =
        suite_->sensor(extra.sensor).deviation[std::max<Index>(extra.component, 0)];
    extra.variance = deviation * deviation;
    extra.value = y[extra.row];
    if (!std::isfinite(extra.value)) {  // a row of nothing
      extra.direction.setZero();
      extra.value = 0.0;
      extra.variance = 1.0;
    } else if (extra.component < 0) {
      extra.direction = motion.link(extra.link).hinge;
    } else {
      extra.direction = joint_direction(motion.link(extra.link), extra.component);
    }
  }
}

}  // namespace ulna
