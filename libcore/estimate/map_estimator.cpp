#include "estimate/map_estimator.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "base/error.hpp"

namespace ulna {

MapEstimator::MapEstimator(std::shared_ptr<const SensorSuite> suite, const ModelDeviation& model)
    : suite_(std::move(suite)),
      model_(model),
      motion_(suite_->shared_body()),
      evidence_(suite_),
      blocks_(evidence_.links.size()),
      rows_(evidence_.joints.size()) {
  for (const double d :
       {model.force, model.moment, model.linear_acceleration, model.angular_acceleration}) {
    require(std::isfinite(d) && d >= 0.0, "model",
            "deviations of the model must be finite and not negative");
  }
  const BodyTree& body = suite_->body();
  frame_.torque.setZero(body.dofs());
  frame_.joint_acceleration.setZero(body.dofs());
  frame_.external.setZero(6, body.size());
  frame_.joint_wrench.setZero(6, body.size());
  frame_.acceleration.setZero(6, body.size());
}

const MapFrame& MapEstimator::update(const BodyState& state, const VectorRef& y) noexcept {
  frame_.usable = state.angle.allFinite() && state.rate.allFinite() &&
                  state.orientation.allFinite() && state.position.allFinite() &&
                  state.angular_velocity.allFinite();
  if (!frame_.usable) {
    frame_.torque.setConstant(kNaN);
    frame_.joint_acceleration.setConstant(kNaN);
    frame_.base_acceleration.setConstant(kNaN);
    frame_.external.setConstant(kNaN);
    frame_.joint_wrench.setConstant(kNaN);
    frame_.acceleration.setConstant(kNaN);
    return frame_;
  }
  motion_.move(state);
  evidence_.gather(motion_, state, y);
  upwards();
  downwards();
  return frame_;
}

// Leaves to base: what each subtree says about the field of its parent and the wrench on it.
void MapEstimator::upwards() {
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    Block& block = blocks_[i];
    const LinkEvidence& given = evidence_.links[i];
    const LinkMotion& link = motion_.link(static_cast<Index>(i));
    block.info = given.info;
    block.rhs = given.rhs;
    block.slope.setZero();
    block.offset = -given.external;
    if (link.mass > 0.0) {
      const Matrix3 x = cross_matrix(link.mass * link.centre);
      block.slope.topLeftCorner<3, 3>().diagonal().setConstant(link.mass);
      block.slope.topRightCorner<3, 3>() = -x;
      block.slope.bottomLeftCorner<3, 3>() = x;
      block.slope.bottomRightCorner<3, 3>() = link.inertia - x * cross_matrix(link.centre);
      block.offset += inertial_wrench(link, link.drift) + link.gyroscopic;
    }
    block.noise = given.spread + isotropic_wrench(link.origin, model_.force * model_.force,
                                                  model_.moment * model_.moment);
  }
  for (Index i = static_cast<Index>(blocks_.size()) - 1; i > 0; --i) step_to_parent(i);
}

// Over joint i: a = parent's a + S q'' + error, with q'' of known mean and variance.
void MapEstimator::step_to_parent(Index i) {
  Block& block = blocks_[static_cast<std::size_t>(i)];
  Block& parent = blocks_[static_cast<std::size_t>(motion_.body().parent(i))];
  const LinkMotion& link = motion_.link(i);
  const LinkEvidence& given = evidence_.links[static_cast<std::size_t>(i)];
  // Covariance of the step, about the base origin: errors at the link's origin, and the hinge.
  const double a = model_.linear_acceleration * model_.linear_acceleration;
  const double b = model_.angular_acceleration * model_.angular_acceleration;
  const Matrix3 x = cross_matrix(link.origin);
  Matrix6 step;
  step.topLeftCorner<3, 3>() = a * Matrix3::Identity() - b * x * x;
  step.topRightCorner<3, 3>() = b * x;
  step.bottomLeftCorner<3, 3>() = -b * x;
  step.bottomRightCorner<3, 3>() = b * Matrix3::Identity();
  Vector6 mean = Vector6::Zero();
  if (motion_.body().dof(i) >= 0) {
    step.noalias() += (link.hinge / given.weight) * link.hinge.transpose();
    mean = link.hinge * (given.weighted / given.weight);
  }
  // The subtree's own information about a: (1 + step info)^-1, which bears a singular step.
  Matrix6 system = Matrix6::Identity();
  system.noalias() += step * block.info;
  const Eigen::PartialPivLU<Matrix6> solver(system);
  block.gain = solver.inverse();
  block.step.noalias() = block.gain * step;
  block.shift = block.gain * mean;
  block.shift.noalias() += block.step * block.rhs;

  Matrix6 slope;
  slope.noalias() = block.slope * block.gain;
  Vector6 offset = block.offset;
  offset.noalias() += block.slope * block.shift;
  Matrix6 noise = block.noise;
  const Matrix6 spread = block.slope * block.step;
  noise.noalias() += spread * block.slope.transpose();
  Matrix6 info;
  info.noalias() = block.info * block.gain;
  // Of the parent's field: information of the subtree less what the step loses of it.
  Vector6 rhs = block.rhs;
  rhs.noalias() -= block.info * block.shift;
  measure_joint(i, slope, offset, noise, info, rhs);
  parent.info += 0.5 * (info + info.transpose());
  parent.rhs += rhs;
  parent.slope += slope;
  parent.offset += offset;
  parent.noise += noise;
}

// Measured components of the wrench through joint i, one after the other.
void MapEstimator::measure_joint(Index i, Matrix6& slope, Vector6& offset, Matrix6& noise,
                                 Matrix6& info, Vector6& rhs) {
  for (std::size_t l = 0; l < rows_.size(); ++l) {
    const JointEvidence& given = evidence_.joints[l];
    if (given.link != i) continue;
    Row& row = rows_[l];
    row.spread.noalias() = noise * given.direction;
    row.variance = given.direction.dot(row.spread) + given.variance;
    row.slope.noalias() = slope.transpose() * given.direction;
    row.offset = given.direction.dot(offset) - given.value;
    info.noalias() += (row.slope / row.variance) * row.slope.transpose();
    rhs -= row.slope * (row.offset / row.variance);
    slope.noalias() -= (row.spread / row.variance) * row.slope.transpose();
    offset -= row.spread * (row.offset / row.variance);
    noise.noalias() -= (row.spread / row.variance) * row.spread.transpose();
  }
}

void MapEstimator::downwards() {
  // At the base the wrenches must balance: slope a + offset + noise = 0.
  Block& base = blocks_[0];
  const Eigen::LLT<Matrix6> balance(base.noise);
  Matrix6 system = base.info;
  const Matrix6 weighted = balance.solve(base.slope);
  system.noalias() += base.slope.transpose() * weighted;
  Vector6 rhs = base.rhs;
  rhs.noalias() -= weighted.transpose() * base.offset;
  base.field = system.llt().solve(rhs);
  Vector6 missing = base.offset;
  missing.noalias() += base.slope * base.field;
  base.pull = balance.solve(missing);

  const BodyTree& body = motion_.body();
  const double b = model_.angular_acceleration * model_.angular_acceleration;
  for (Index i = 1; i < body.size(); ++i) {
    Block& block = blocks_[static_cast<std::size_t>(i)];
    const Block& parent = blocks_[static_cast<std::size_t>(body.parent(i))];
    block.pull = parent.pull;
    // Joint rows in the opposite order: each hides what was measured before it.
    for (std::size_t l = rows_.size(); l-- > 0;) {
      if (evidence_.joints[l].link != i) continue;
      const Row& row = rows_[l];
      const double lacking = row.slope.dot(parent.field) + row.offset;
      block.pull +=
          evidence_.joints[l].direction * ((lacking - row.spread.dot(block.pull)) / row.variance);
    }
    block.field = block.shift;
    block.field.noalias() += block.gain * parent.field;
    block.field.noalias() -= block.step * (block.slope.transpose() * block.pull);
    const Index k = body.dof(i);
    if (k < 0) continue;
    const LinkEvidence& given = evidence_.links[static_cast<std::size_t>(i)];
    const LinkMotion& link = motion_.link(i);
    const double turned = link.hinge.tail<3>().dot((block.field - parent.field).tail<3>());
    frame_.joint_acceleration[k] = (turned + b * given.weighted) / (1.0 + b * given.weight);
  }

  for (Index i = body.size() - 1; i >= 0; --i) {
    Block& block = blocks_[static_cast<std::size_t>(i)];
    const LinkEvidence& given = evidence_.links[static_cast<std::size_t>(i)];
    const LinkMotion& link = motion_.link(i);
    Vector6 external = given.external;
    external.noalias() += given.spread * block.pull;
    Vector6 error;  // of the link's Newton and Euler equations
    error.noalias() =
        isotropic_wrench(link.origin, model_.force * model_.force, model_.moment * model_.moment) *
        block.pull;
    block.wrench = -external - error;
    if (link.mass > 0.0) {
      block.wrench += inertial_wrench(link, block.field + link.drift) + link.gyroscopic;
    }
    const auto told = [&](const Vector6& wrench, auto&& column) {
      const Vector3 force = wrench.head<3>();
      column.template head<3>() = link.axes.transpose() * force;
      column.template tail<3>() =
          link.axes.transpose() * (wrench.tail<3>() - link.origin.cross(force));
    };
    told(external, frame_.external.col(i));
    const Vector6 field = block.field + link.drift;
    auto acceleration = frame_.acceleration.col(i);
    acceleration.head<3>() =
        link.axes.transpose() * (field.head<3>() + field.tail<3>().cross(link.origin));
    acceleration.tail<3>() = link.axes.transpose() * field.tail<3>();
  }
  for (Index i = body.size() - 1; i > 0; --i) {
    Block& block = blocks_[static_cast<std::size_t>(i)];
    const LinkMotion& link = motion_.link(i);
    blocks_[static_cast<std::size_t>(body.parent(i))].wrench += block.wrench;
    const Vector3 force = block.wrench.head<3>();
    frame_.joint_wrench.col(i).head<3>() = link.axes.transpose() * force;
    frame_.joint_wrench.col(i).tail<3>() =
        link.axes.transpose() * (block.wrench.tail<3>() - link.origin.cross(force));
    if (body.dof(i) >= 0) frame_.torque[body.dof(i)] = link.hinge.dot(block.wrench);
  }
  frame_.joint_wrench.col(0).setZero();
  frame_.base_acceleration = base.field;
}

}  // namespace ulna
