// A passive device that carries both arms from a hip belt, as an exoskeleton for overhead work
// (Latella et al. 2021, sections II-E and IV).
//
// Each upper arm is pushed perpendicular to itself in the vertical plane that holds it, with a
// force that depends on its elevation; the published mapping lays the same force into a frame that
// rolls with the humerus and is not in balance. What the arms get, force and moment, the hip takes,
// so that all wrenches on the person sum to the device's weight and to no moment.
#pragma once

#include <array>

#include "base/types.hpp"

namespace ulna {

using Point3 = Eigen::Vector3d;

// Force on one arm over its elevation: straight between the entries and from the first one to
// nothing at 0, the hanging arm; above the last angle its value is held.
struct SupportCurve {
  Vector angle;    // rad, increasing from 0 to pi at most
  Vector support;  // N, perpendicular to the arm, positive upward
  Vector shear;    // N, along the arm, positive toward the elbow

  // Support and shear at an elevation, rad; NaN at NaN.
  std::array<double, 2> at(double elevation) const noexcept;
};

struct ArmSupport {
  SupportCurve left;
  SupportCurve right;
  double attachment =
      0.6895;              // where it holds the upper arm, a share of its length from the shoulder
  double mass = 1.8;       // kg, its weight acts at the hip
  bool along_arm = false;  // the shear acts as well
  Point3 up = Point3::UnitZ();  // of the world, of unit length
};

// World axes, m; left arm first.
struct SupportPose {
  std::array<Point3, 2> shoulder;
  std::array<Point3, 2> elbow;
  Point3 hip;  // where the belt sits
};

// On the person, world axes, N and N m.
struct SupportWrenches {
  std::array<Point3, 2> force;  // at `point`, without a moment
  std::array<Point3, 2> point;
  Point3 hip_force;
  Point3 hip_moment;  // about the hip point
  std::array<double, 2> elevation;
  // The elevation is above the curve, or the arm stands upright so that no plane holds it and the
  // vertical (and there is no force).
  std::array<bool, 2> outside;
};

// Throws Error (kArgument) that says what cannot be: curves, attachment, mass, direction.
void check_support(const ArmSupport& support);

// Of a checked support; allocates nothing. A coordinate that is NaN makes the wrenches that depend
// on it NaN; the arms must have a length.
SupportWrenches support_wrenches(const ArmSupport& support, const SupportPose& pose) noexcept;

// Angle of the upper arm (shoulder to elbow, any length) from hanging, 0 to pi.
double arm_elevation(const Point3& arm, const Point3& up) noexcept;

// u'_x, u'_y, u'_z of R = R_z R_x R_y from u of R = R_x R_y R_z (equations 13 to 16). Within 1e-7
// of the singularity u'_y and u'_z are NaN.
Point3 zxy_of_xyz(const Point3& angles) noexcept;

}  // namespace ulna
