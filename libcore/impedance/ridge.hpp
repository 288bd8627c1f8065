// Penalised least squares whose penalty is chosen by cross-validation: impulse responses have more
// values than a band-limited motion determines.
#pragma once

#include <vector>

#include "base/types.hpp"

namespace ulna {

struct Ridge {
  double penalty = 0.0;  // times the shape given, per row
  Vector theta;
  Matrix information;  // columns' Gram matrix + rows penalty shape
};

// Minimises |y - columns theta|^2 + rows penalty theta' shape theta. The penalty is the one of
// 10^-10 ... 10^1 (half decades) under which five contiguous parts of the rows are best predicted
// from the other four; shape must be positive semidefinite. fixed >= 0: that penalty.
Ridge ridge_fit(const Matrix& columns, const Vector& y, const Matrix& shape, double fixed = -1.0);

// Mean square of every column on the diagonal: a penalty that does not depend on units.
Matrix ridge_shape(const Matrix& columns);

// Sum of squared second differences of p neighbours, the first and last against zero.
Matrix roughness(Index p);

}  // namespace ulna
