// Quantiles and tails that intervals and tests need.
#pragma once

#include <vector>

#include "base/types.hpp"

namespace ulna {

// Inverse of the standard normal distribution, 0 < p < 1 (Acklam's start, one Halley step: 1e-15).
double normal_quantile(double p);

// Inverse of Student's t distribution with `dof` > 0 degrees of freedom.
double student_quantile(double p, double dof);

// P(X > x) for a chi-square variable with `dof` > 0 degrees of freedom.
double chi_square_tail(double x, double dof);

// Linear-interpolation quantile of a sample (Hyndman & Fan type 7, as numpy.quantile). NaN are left
// out; NaN when nothing is left.
double sample_quantile(std::vector<double> sample, double p);

}  // namespace ulna
