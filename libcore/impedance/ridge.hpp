// Penalised least squares whose penalty is chosen by cross-validation: impulse responses have more
// values than a band-limited motion determines.
#pragma once

#include "base/token.hpp"
#include "base/types.hpp"

namespace ulna {

struct Ridge {
  double penalty = 0.0;  // times the shape given, per row
  double rank = 0.0;     // effective number of values determined: trace of the hat matrix
  Vector theta;
  Matrix information;  // columns' Gram matrix + rows (base + penalty shape)
};

// Minimises |y - columns theta|^2 + rows theta' (base + penalty shape) theta; shape and base
// (empty: none) must be positive semidefinite. Five contiguous parts of the rows are predicted from
// the other four under each penalty of least ... 10^13 least (half decades); chosen is the largest
// whose error exceeds the least by no more than its standard error over the parts, so that what the
// motion does not determine stays small (Breiman et al. 1984, the rule of one standard error).
// A token only cancels.
Ridge ridge_fit(const Matrix& columns, const Vector& y, const Matrix& shape, Token* token,
                const Matrix& base = {}, double least = 1e-10);

// Mean square of every column on the diagonal: a penalty that does not depend on units.
Matrix ridge_shape(const Matrix& columns);

// Sum of squared second differences of p neighbours, the first and last against zero.
Matrix roughness(Index p);

}  // namespace ulna
