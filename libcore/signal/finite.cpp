#include "signal/finite.hpp"

#include <cmath>
#include <string>

#include "base/error.hpp"

namespace ulna {

void require_finite(MatrixRef values, const char* argument, Index first_row) {
  for (Index j = 0; j < values.cols(); ++j) {
    // 0 x is 0 for every finite x and NaN for the rest: one vectorised pass decides for the column.
    if ((values.col(j).array() * 0.0).sum() == 0.0) continue;
    for (Index i = 0; i < values.rows(); ++i) {
      const double x = values(i, j);
      if (std::isfinite(x)) continue;
      const std::string where =
          "row " + std::to_string(first_row + i) + ", channel " + std::to_string(j);
      throw Error(Fault::kData, argument,
                  std::string(argument) + " holds " +
                      (std::isnan(x) ? "NaN" : "an infinite value") + " at " + where +
                      " (both counted from 0): cut or repair these rows first",
                  where);
    }
  }
}

}  // namespace ulna
