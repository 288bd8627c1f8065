#include "plant/body/body_motion.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

// Turns the columns of `axes` by an angle about an axis told in these columns.
void turn_columns(Matrix3& axes, const Vector3& axis, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  for (int k = 0; k < 3; ++k) {
    if (axis[k] != 1.0) continue;  // most hinges of a body turn about an axis of their frame
    const int a = (k + 1) % 3;
    const int b = (k + 2) % 3;
    const Vector3 first = axes.col(a);
    axes.col(a) = c * first + s * axes.col(b);
    axes.col(b) = c * axes.col(b) - s * first;
    return;
  }
  axes = (axes * Eigen::AngleAxisd(angle, axis).toRotationMatrix()).eval();
}

}  // namespace

Matrix6 wrench_frame(const LinkMotion& link) {
  Matrix6 frame;
  frame.topLeftCorner<3, 3>() = link.axes;
  frame.topRightCorner<3, 3>().setZero();
  for (int k = 0; k < 3; ++k) {
    frame.block<3, 1>(3, k) = link.origin.cross(Vector3(link.axes.col(k)));
  }
  frame.bottomRightCorner<3, 3>() = link.axes;
  return frame;
}

BodyMotion::BodyMotion(std::shared_ptr<const BodyTree> body)
    : body_(std::move(body)),
      links_(static_cast<std::size_t>(body_->size())),
      wrench_(links_.size(), Vector6::Zero()),
      composite_(links_.size(), Matrix6::Zero()) {
  for (Index i = 0; i < body_->size(); ++i) {
    links_[static_cast<std::size_t>(i)].mass = body_->link(i).mass;
  }
}

void BodyMotion::move(const BodyState& state) {
  position_ = state.position;
  velocity_ = state.velocity;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const BodyLink& fixed = body_->links()[i];
    LinkMotion& link = links_[i];
    if (i == 0) {
      link.axes = state.orientation;
      link.turn = state.angular_velocity;
    } else {
      const LinkMotion& parent = links_[static_cast<std::size_t>(fixed.parent)];
      link.axes = parent.axes * fixed.orientation;
      const Vector3 arm = parent.axes * fixed.position;
      link.origin = parent.origin + arm;
      link.turn = parent.turn;
      link.drift = parent.drift;
      link.drift.head<3>() += parent.turn.cross(parent.turn.cross(arm));
      const Index k = body_->dof(static_cast<Index>(i));
      if (k >= 0) {
        turn_columns(link.axes, fixed.axis, state.angle[k] - fixed.reference);
        const Vector3 axis = link.axes * fixed.axis;
        link.hinge.head<3>() = link.origin.cross(axis);
        link.hinge.tail<3>() = axis;
        link.turn += axis * state.rate[k];
        const Vector3 twist = parent.turn.cross(axis) * state.rate[k];
        link.drift.head<3>() += link.origin.cross(twist);
        link.drift.tail<3>() += twist;
      }
    }
    if (fixed.mass <= 0.0) continue;
    const Vector3 reach = link.axes * fixed.centre;
    link.centre = link.origin + reach;
    link.inertia.noalias() = link.axes * fixed.inertia * link.axes.transpose();
    const Vector3 force = fixed.mass * link.turn.cross(link.turn.cross(reach));
    link.gyroscopic.head<3>() = force;
    link.gyroscopic.tail<3>() =
        link.turn.cross(link.inertia * link.turn) + link.centre.cross(force);
  }
}

void BodyMotion::accelerate(const Vector6& base, const VectorRef& joint) {
  links_[0].acceleration = base;
  for (std::size_t i = 1; i < links_.size(); ++i) {
    LinkMotion& link = links_[i];
    const auto parent = static_cast<std::size_t>(body_->links()[i].parent);
    // Fields are added to the parent's; the difference of the drifts is the step between the two.
    link.acceleration = links_[parent].acceleration + (link.drift - links_[parent].drift);
    const Index k = body_->dof(static_cast<Index>(i));
    if (k >= 0) link.acceleration += link.hinge * joint[k];
  }
}

Vector3 BodyMotion::position(Index i, const Vector3& point) const {
  return position_ + link(i).origin + link(i).axes * point;
}

Vector6 BodyMotion::velocity(Index i, const Vector3& point) const {
  Vector6 velocity;
  velocity.head<3>() = velocity_;
  // Along the way from the base: each link turns about its origin.
  Vector3 from = position(i, point) - position_;
  for (Index j = i; j >= 0; j = body_->parent(j)) {
    velocity.head<3>() += link(j).turn.cross(from - link(j).origin);
    from = link(j).origin;
  }
  velocity.tail<3>() = link(i).turn;
  return velocity;
}

Vector6 BodyMotion::acceleration(Index i, const Vector3& point) const {
  const LinkMotion& at = link(i);
  const Vector3 reach = at.axes * point;
  Vector6 acceleration = at.acceleration;
  acceleration.head<3>() += Vector3(at.acceleration.tail<3>()).cross(at.origin + reach) +
                            at.turn.cross(at.turn.cross(reach));
  return acceleration;
}

void BodyMotion::inverse_dynamics(const Eigen::Ref<const Matrix>& external,
                                  Eigen::Ref<Vector> torque, Vector6& missing,
                                  Matrix* joint_wrench) {
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const LinkMotion& link = links_[i];
    const auto column = external.col(static_cast<Index>(i));
    const Vector3 force = link.axes * column.head<3>();
    wrench_[i].setZero();
    if (link.mass > 0.0) {
      wrench_[i] = inertial_wrench(link, link.acceleration) + link.gyroscopic;
    }
    wrench_[i].head<3>() -= force;
    wrench_[i].tail<3>() -= link.axes * column.tail<3>() + link.origin.cross(force);
  }
  for (std::size_t i = links_.size(); i-- > 1;) {
    const Index k = body_->dof(static_cast<Index>(i));
    if (k >= 0) torque[k] = links_[i].hinge.dot(wrench_[i]);
    wrench_[static_cast<std::size_t>(body_->links()[i].parent)] += wrench_[i];
  }
  missing = wrench_[0];
  if (joint_wrench == nullptr) return;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const LinkMotion& link = links_[i];
    const Vector3 force = wrench_[i].head<3>();
    joint_wrench->col(static_cast<Index>(i)).head<3>() = link.axes.transpose() * force;
    joint_wrench->col(static_cast<Index>(i)).tail<3>() =
        link.axes.transpose() * (wrench_[i].tail<3>() - link.origin.cross(force));
  }
}

namespace {

Matrix6 spatial_inertia(const LinkMotion& link) {
  Matrix3 cross;
  cross << 0.0, -link.centre.z(), link.centre.y(), link.centre.z(), 0.0, -link.centre.x(),
      -link.centre.y(), link.centre.x(), 0.0;
  Matrix6 inertia;
  inertia.topLeftCorner<3, 3>() = link.mass * Matrix3::Identity();
  inertia.topRightCorner<3, 3>() = -link.mass * cross;
  inertia.bottomLeftCorner<3, 3>() = link.mass * cross;
  inertia.bottomRightCorner<3, 3>() = link.inertia - link.mass * cross * cross;
  return inertia;
}

}  // namespace

void BodyMotion::mass_matrix(Eigen::Ref<Matrix> inertia) {
  inertia.setZero();
  for (std::size_t i = 0; i < links_.size(); ++i) {
    composite_[i] = links_[i].mass > 0.0 ? spatial_inertia(links_[i]) : Matrix6::Zero();
  }
  for (std::size_t i = links_.size(); i-- > 1;) {
    composite_[static_cast<std::size_t>(body_->links()[i].parent)] += composite_[i];
  }
  inertia.topLeftCorner<6, 6>() = composite_[0];
  for (Index i = body_->size() - 1; i > 0; --i) {
    const Index k = body_->dof(i);
    if (k < 0) continue;
    const Vector6 wrench = composite_[static_cast<std::size_t>(i)] * link(i).hinge;
    for (Index j = i; j > 0; j = body_->parent(j)) {
      const Index l = body_->dof(j);
      if (l < 0) continue;
      inertia(6 + k, 6 + l) = inertia(6 + l, 6 + k) = link(j).hinge.dot(wrench);
    }
    inertia.block<6, 1>(0, 6 + k) = wrench;
    inertia.block<1, 6>(6 + k, 0) = wrench.transpose();
  }
}

void BodyMotion::jacobian(Index i, const Vector3& point, Eigen::Ref<Matrix> jacobian) const {
  jacobian.setZero();
  const Vector3 at = link(i).origin + link(i).axes * point;
  for (int k = 0; k < 3; ++k) {
    jacobian(k, k) = jacobian(3 + k, 3 + k) = 1.0;
    jacobian.block<3, 1>(0, 3 + k) = Vector3::Unit(k).cross(at);
  }
  for (Index j = i; j > 0; j = body_->parent(j)) {
    const Index k = body_->dof(j);
    if (k < 0) continue;
    const Vector3 axis = link(j).hinge.tail<3>();
    jacobian.block<3, 1>(0, 6 + k) = axis.cross(at - link(j).origin);
    jacobian.block<3, 1>(3, 6 + k) = axis;
  }
}

Vector3 BodyMotion::centre_of_mass() const {
  Vector3 moment = Vector3::Zero();
  for (const LinkMotion& link : links_) moment += link.mass * link.centre;
  return position_ + moment / body_->mass();
}

Vector3 BodyMotion::centre_of_mass_velocity() const {
  return centroidal_momentum().head<3>() / body_->mass();
}

Vector6 BodyMotion::centroidal_momentum() const {
  const Vector3 centre = centre_of_mass() - position_;
  Vector6 momentum = Vector6::Zero();
  for (Index i = 0; i < body_->size(); ++i) {
    const LinkMotion& at = link(i);
    if (at.mass <= 0.0) continue;
    const Vector3 linear = at.mass * velocity(i, body_->link(i).centre).head<3>();
    momentum.head<3>() += linear;
    momentum.tail<3>() += at.inertia * at.turn + (at.centre - centre).cross(linear);
  }
  return momentum;
}

Vector6 BodyMotion::centroidal_momentum_rate() const {
  const Vector3 centre = centre_of_mass() - position_;
  Vector6 rate = Vector6::Zero();  // about the base origin first
  for (const LinkMotion& at : links_) {
    if (at.mass > 0.0) rate += inertial_wrench(at, at.acceleration) + at.gyroscopic;
  }
  rate.tail<3>() -= centre.cross(Vector3(rate.head<3>()));
  // Proper accelerations hold the weight, which has no moment about the centre of mass.
  rate[2] -= body_->mass() * body_->gravity();
  return rate;
}

Matrix6 BodyMotion::locked_inertia() const {
  Matrix6 inertia = Matrix6::Zero();
  for (const LinkMotion& at : links_) {
    if (at.mass > 0.0) inertia += spatial_inertia(at);
  }
  return inertia;
}

void check_state(const BodyTree& body, const BodyState& state) {
  const auto check_size = [&](const Vector& values, const char* argument) {
    require(values.size() == body.dofs(), argument,
            std::string(argument) + " has " + std::to_string(values.size()) +
                " numbers, the body has " + std::to_string(body.dofs()) + " joints");
    require_finite(values, argument);
  };
  check_size(state.angle, "angle");
  check_size(state.rate, "rate");
  require(state.position.allFinite() && state.velocity.allFinite() &&
              state.angular_velocity.allFinite() && state.orientation.allFinite(),
          "state", "position, velocity and orientation of the base must be finite");
  // Orientations from files have as many as six digits.
  require((state.orientation.transpose() * state.orientation - Matrix3::Identity()).norm() < 1e-4 &&
              state.orientation.determinant() > 0.0,
          "orientation", "the orientation of the base is no rotation");
}

}  // namespace ulna
