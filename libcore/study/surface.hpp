// A polynomial through the good runs of a study, to stand in for those that failed.
//
// Legendre polynomials in the factors' quantiles, least squares; how rich a polynomial, the good
// runs that lie nearest to the failed ones decide: they are left out of the fit and predicted, as
// the failed ones will be (they lie in corners, so a good fit elsewhere says little).
#pragma once

#include <cstdint>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "study/sobol_sequence.hpp"

namespace ulna {

struct Surface {
  // Terms: products of Legendre polynomials of these degrees, each a list of (factor, degree).
  std::vector<std::vector<std::pair<Index, int>>> terms;
  Vector coefficients;
  double validation_r2 = 0.0;  // 1 - error / variance over the runs left out

  double value(const VectorRef& point) const;  // point in the unit cube
};

Surface fit_surface(const PointRows& points, const Vector& y, const std::vector<bool>& failed,
                    std::uint64_t seed, Token* token);

}  // namespace ulna
