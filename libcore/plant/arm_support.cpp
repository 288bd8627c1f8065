#include "plant/arm_support.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"

namespace ulna {
namespace {

constexpr double kGravity = 9.81;
// The arm within a thousandth of a degree of the vertical.
constexpr double kSmallestSine = 2e-5;
// Angles of a table in degrees are rounded when they become rad.
constexpr double kAngleRounding = 1e-9;

void check_curve(const SupportCurve& curve, const char* argument) {
  const Index n = curve.angle.size();
  const std::string name = std::string("the curve of the ") + argument + " arm";
  require(n >= 2 && curve.support.size() == n && curve.shear.size() == n, argument,
          name + " needs at least 2 angles, each with a support and a force along the arm");
  require(curve.angle.allFinite() && curve.support.allFinite() && curve.shear.allFinite(), argument,
          name + " holds a value that is no finite number");
  bool rises = curve.angle[0] >= 0.0 && curve.angle[n - 1] <= kPi + kAngleRounding;
  for (Index i = 1; i < n; ++i) rises = rises && curve.angle[i] > curve.angle[i - 1];
  require(rises, argument, name + " must have angles that increase from 0 to pi at most");
}

}  // namespace

std::array<double, 2> SupportCurve::at(double elevation) const noexcept {
  if (std::isnan(elevation)) return {kNaN, kNaN};
  const double* begin = angle.data();
  const double* end = begin + angle.size();
  const double* above = std::upper_bound(begin, end, elevation);
  if (above == end) return {support[angle.size() - 1], shear[angle.size() - 1]};
  const Index i = above - begin;
  if (i == 0) {
    const double share = std::max(elevation, 0.0) / angle[0];
    return {share * support[0], share * shear[0]};
  }
  const double share = (elevation - angle[i - 1]) / (angle[i] - angle[i - 1]);
  return {support[i - 1] + share * (support[i] - support[i - 1]),
          shear[i - 1] + share * (shear[i] - shear[i - 1])};
}

void check_support(const ArmSupport& support) {
  check_curve(support.left, "left");
  check_curve(support.right, "right");
  require(support.attachment > 0.0 && support.attachment <= 1.0, "attachment",
          "attachment must lie between 0 and 1");
  require(std::isfinite(support.mass) && support.mass >= 0.0, "mass_kg",
          "mass_kg must not be negative");
  require(std::abs(support.up.norm() - 1.0) < 1e-9, "up", "up must be a direction");
}

SupportWrenches support_wrenches(const ArmSupport& support, const SupportPose& pose) noexcept {
  SupportWrenches out;
  Point3 sum = Point3::Zero();
  Point3 moment = Point3::Zero();
  for (std::size_t side = 0; side < 2; ++side) {
    const SupportCurve& curve = side == 0 ? support.left : support.right;
    const Point3 arm = pose.elbow[side] - pose.shoulder[side];
    const Point3 along = arm.normalized();
    const double elevation = arm_elevation(arm, support.up);
    const Point3 upward = support.up - support.up.dot(along) * along;
    const double sine = upward.norm();
    const std::array<double, 2> size = curve.at(elevation);
    const bool upright = sine < kSmallestSine;
    Point3 force = upright ? Point3::Zero() : Point3(size[0] / sine * upward);
    if (support.along_arm) force += size[1] * along;
    const Point3 point = pose.shoulder[side] + support.attachment * arm;
    sum += force;
    moment -= (point - pose.hip).cross(force);
    out.force[side] = force;
    out.point[side] = point;
    out.elevation[side] = elevation;
    out.outside[side] = elevation > curve.angle[curve.angle.size() - 1] + kAngleRounding ||
                        (upright && size[0] != 0.0);
  }
  out.hip_force = -sum - support.mass * kGravity * support.up;
  out.hip_moment = moment;
  return out;
}

// atan2 keeps its digits near the vertical, where an arc cosine loses half of them.
double arm_elevation(const Point3& arm, const Point3& up) noexcept {
  return std::atan2(arm.cross(up).norm(), -arm.dot(up));
}

Point3 zxy_of_xyz(const Point3& angles) noexcept {
  const double cx = std::cos(angles[0]), sx = std::sin(angles[0]);
  const double cy = std::cos(angles[1]), sy = std::sin(angles[1]);
  const double cz = std::cos(angles[2]), sz = std::sin(angles[2]);
  const double r12 = -cy * sz;
  const double r22 = cx * cz - sx * sy * sz;
  const double cosine = std::hypot(r12, r22);
  const double x = std::atan2(sx * cz + cx * sy * sz, cosine);
  if (cosine < 1e-7) return {x, kNaN, kNaN};
  return {x, std::atan2(cx * sy * cz - sx * sz, cx * cy), std::atan2(-r12, r22)};
}

}  // namespace ulna
