// The ellipse of the symmetric part of an impedance matrix and the size of its antisymmetric part.
// Dyck 2013, (3.11) to (3.17) and (3.26); (3.17) with atan2, modulo 180 degrees.
#pragma once

#include <string>

#include "base/types.hpp"

namespace ulna {

// Units: those of the matrix, and their square for the area.
struct Ellipse {
  double major = 0.0;          // largest eigenvalue of the symmetric part
  double minor = 0.0;          // smallest
  double area = 0.0;           // pi major minor (3.15); not the area of an ellipse when minor < 0
  double shape = 0.0;          // major / minor (3.16); NaN unless minor > 0
  double angle_rad = 0.0;      // of the major axis to +x, in [0, pi)
  double antisymmetric = 0.0;  // k_a = (z_xy - z_yx) / 2
  double antisymmetry = 0.0;   // |k_a| / sqrt(minor major) (3.26); infinite when minor <= 0 < |k_a|
  bool angle_defined = true;  // false when the matrix is isotropic: every direction is a major axis
};

// z: 2 x 2, finite.
Ellipse ellipse_of(const Matrix& z);

// Antisymmetry for any size: spectral norm of the antisymmetric part over the geometric mean of the
// symmetric part's eigenvalues; equals (3.26) for 2 x 2.
double antisymmetry_of(const Matrix& z);

struct EllipseInterval {
  Ellipse value;
  // [low, high]; the angle's bounds may leave [0, pi) so that low <= value <= high.
  double major[2], minor[2], area[2], shape[2], angle_rad[2], antisymmetry[2];
};

// Percentile intervals over draws (rows: row-major 2 x 2 matrices). When the draws' angles spread
// over more than a right angle, the direction is not determined and angle_defined becomes false.
EllipseInterval ellipse_interval(const Matrix& z, const Matrix& draws, double level);

}  // namespace ulna
