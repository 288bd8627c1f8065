#include "plant/rigid_tree.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <set>

#include "base/error.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

// A unit axis may be off by what decimals in a file allow.
constexpr double kUnitTolerance = 1e-6;

void check_body(const RigidBody& body, Index index) {
  const std::string what = "body '" + body.name + "' ";
  require(!body.name.empty(), "name", "body " + std::to_string(index) + " has no name");
  require(body.parent < index, "parent", what + "must come after its parent");
  require(body.parent >= -1, "parent", what + "has no such parent");
  require(body.position.allFinite() && body.orientation.allFinite() && body.axis.allFinite() &&
              body.centre.allFinite() && body.inertia.allFinite() && std::isfinite(body.mass) &&
              std::isfinite(body.reference),
          "body", what + "holds a number that is not finite");
  require(body.massless ? body.mass == 0.0 : body.mass > 0.0, "mass",
          what + (body.massless ? "is a massless frame with a mass" : "must have a positive mass"));
  require((body.orientation.transpose() * body.orientation - Matrix3::Identity()).norm() <
                  kUnitTolerance &&
              body.orientation.determinant() > 0.0,
          "orientation", what + "has an orientation that is no rotation");
  require(body.joint.empty() || std::fabs(body.axis.norm() - 1.0) < kUnitTolerance, "axis",
          what + "has a joint axis whose length is not 1");
  if (!body.massless) check_inertia(body.inertia, what);
}

}  // namespace

void check_inertia(const Matrix3& inertia, const std::string& what) {
  require((inertia - inertia.transpose()).norm() <= 1e-12 * inertia.norm(), "inertia",
          what + "has an inertia that is not symmetric");
  const Vector3 moments = Eigen::SelfAdjointEigenSolver<Matrix3>(inertia).eigenvalues();
  require(moments[0] > 0.0, "inertia", what + "has a principal moment that is not positive");
  require(moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9), "inertia",
          what + "breaks the triangle inequality of principal moments");
}

RigidTree::RigidTree(std::vector<RigidBody> bodies, const Vector3& gravity)
    : bodies_(std::move(bodies)), gravity_(gravity) {
  require(gravity.allFinite(), "gravity", "gravity must be finite");
  std::set<std::string> names;
  for (Index i = 0; i < static_cast<Index>(bodies_.size()); ++i) {
    const RigidBody& body = bodies_[static_cast<std::size_t>(i)];
    check_body(body, i);
    require(names.insert("body " + body.name).second, "name",
            "two bodies have the name '" + body.name + "'");
    if (body.joint.empty()) continue;
    require(names.insert("joint " + body.joint).second, "joint",
            "two joints have the name '" + body.joint + "'");
    hinges_.push_back(i);
  }
}

std::vector<std::string> RigidTree::joint_names() const {
  std::vector<std::string> names;
  for (const Index body : hinges_) names.push_back(bodies_[static_cast<std::size_t>(body)].joint);
  return names;
}

Vector RigidTree::reference() const {
  Vector reference(joints());
  for (Index j = 0; j < joints(); ++j) {
    reference[j] =
        bodies_[static_cast<std::size_t>(hinges_[static_cast<std::size_t>(j)])].reference;
  }
  return reference;
}

void RigidTree::check_size(const VectorRef& values, const char* argument) const {
  require(values.size() == joints(), argument,
          std::string(argument) + " has " + std::to_string(values.size()) + " numbers, " +
              std::to_string(joints()) + " joints are there");
  require_finite(values, argument);
}

std::vector<RigidTree::Pose> RigidTree::poses(const VectorRef& angle) const {
  check_size(angle, "angle");
  std::vector<Pose> poses;
  Index joint = 0;
  for (const RigidBody& body : bodies_) {
    const Pose parent = body.parent < 0 ? Pose{Vector3::Zero(), Matrix3::Identity()}
                                        : poses[static_cast<std::size_t>(body.parent)];
    Matrix3 turn = Matrix3::Identity();
    if (!body.joint.empty()) {
      turn = Eigen::AngleAxisd(angle[joint++] - body.reference, body.axis).toRotationMatrix();
    }
    poses.push_back({parent.position + parent.orientation * body.position,
                     parent.orientation * body.orientation * turn});
  }
  return poses;
}

Vector RigidTree::newton_euler(const VectorRef& angle, const VectorRef& rate,
                               const VectorRef& acceleration, const Vector3& gravity) const {
  const std::vector<Pose> pose = poses(angle);
  const std::size_t count = bodies_.size();
  // Angular velocity and acceleration, linear acceleration of the frame; gravity is an
  // acceleration of the world upwards.
  std::vector<Vector3> w(count), dw(count), a(count), force(count), moment(count);
  Index joint = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const RigidBody& body = bodies_[i];
    const bool on_world = body.parent < 0;
    const auto p = static_cast<std::size_t>(std::max<Index>(body.parent, 0));
    const Vector3 wp = on_world ? Vector3::Zero() : w[p];
    const Vector3 dwp = on_world ? Vector3::Zero() : dw[p];
    const Vector3 arm = pose[i].position - (on_world ? Vector3::Zero() : pose[p].position);
    a[i] = (on_world ? Vector3(-gravity) : a[p]) + dwp.cross(arm) + wp.cross(wp.cross(arm));
    w[i] = wp;
    dw[i] = dwp;
    if (!body.joint.empty()) {
      const Vector3 axis = pose[i].orientation * body.axis;
      w[i] += axis * rate[joint];
      dw[i] += axis * acceleration[joint] + wp.cross(axis) * rate[joint];
      ++joint;
    }
    const Vector3 c = pose[i].orientation * body.centre;
    const Matrix3 inertia = pose[i].orientation * body.inertia * pose[i].orientation.transpose();
    force[i] = body.mass * (a[i] + dw[i].cross(c) + w[i].cross(w[i].cross(c)));
    moment[i] = inertia * dw[i] + w[i].cross(inertia * w[i]) + c.cross(force[i]);
  }
  Vector torque(joints());
  for (std::size_t i = count; i-- > 0;) {
    const RigidBody& body = bodies_[i];
    if (!body.joint.empty()) torque[--joint] = moment[i].dot(pose[i].orientation * body.axis);
    if (body.parent < 0) continue;
    const auto p = static_cast<std::size_t>(body.parent);
    force[p] += force[i];
    moment[p] += moment[i] + (pose[i].position - pose[p].position).cross(force[i]);
  }
  return torque;
}

Vector RigidTree::inverse_dynamics(const VectorRef& angle, const VectorRef& rate,
                                   const VectorRef& acceleration) const {
  check_size(rate, "rate");
  check_size(acceleration, "acceleration");
  return newton_euler(angle, rate, acceleration, gravity_);
}

Vector RigidTree::gravity_torque(const VectorRef& angle) const {
  const Vector rest = Vector::Zero(joints());
  return newton_euler(angle, rest, rest, gravity_);
}

Matrix RigidTree::inertia(const VectorRef& angle) const {
  const Vector rest = Vector::Zero(joints());
  Matrix m(joints(), joints());
  for (Index j = 0; j < joints(); ++j) {
    m.col(j) = newton_euler(angle, rest, Vector::Unit(joints(), j), Vector3::Zero());
  }
  return 0.5 * (m + m.transpose());  // symmetric but for rounding
}

}  // namespace ulna
