// Natural parameters: M, B and K row by row, then x0.
#pragma once

#include "base/types.hpp"

namespace ulna {

inline Index natural_size(Index n) { return 3 * n * n + n; }

// The n x n matrix that stands row by row in table(row, first ...).
inline Matrix matrix_of_row(const Matrix& table, Index row, Index first, Index n) {
  Matrix out(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) out(i, j) = table(row, first + i * n + j);
  }
  return out;
}

}  // namespace ulna
