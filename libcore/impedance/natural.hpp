// Natural parameters: M, B and K row by row, then x0.
#pragma once

#include "base/types.hpp"

namespace ulna {

inline Index natural_size(Index n) { return 3 * n * n + n; }

// From the regression's parameters, (3 n + 1) x n, with positions centred on position_mean. x0 is
// NaN where K is singular.
Vector natural_of(const Matrix& theta, const Vector& position_mean);

// d natural / d vec(theta); NaN in the rows of x0 where K is singular.
Matrix natural_jacobian(const Matrix& theta);

// The n x n matrix that stands row by row in table(row, first ...).
inline Matrix matrix_of_row(const Matrix& table, Index row, Index first, Index n) {
  Matrix out(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) out(i, j) = table(row, first + i * n + j);
  }
  return out;
}

}  // namespace ulna
