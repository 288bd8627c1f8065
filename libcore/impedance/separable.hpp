// Least squares over a few parameters inside a box, for residuals from which the linear parameters
// have been projected away (variable projection, Golub and Pereyra 1973).
#pragma once

#include <functional>

#include "base/types.hpp"

namespace ulna {

struct BoxProblem {
  Vector low, high;  // bounds
  Vector scale;      // a change of a parameter that is small but visible
  std::function<Vector(const Vector&)> residual;
};

struct BoxSolution {
  Vector parameters;
  double cost = 0.0;  // sum of squares
  bool converged = false;
  int evaluations = 0;
};

// How far to go: kFine, central differences until nothing is gained; kCoarse, one-sided differences
// until a step gains less than a millionth of the cost.
enum class Effort { kFine, kCoarse };

// Levenberg-Marquardt with differences of step 1e-3 scale; parameters at a bound that push outwards
// rest there.
BoxSolution minimise_in_box(const BoxProblem& problem, const Vector& start,
                            Effort effort = Effort::kFine, int iterations = 60);

// Columns: d residual / d parameter, by central differences (one-sided at a bound).
Matrix residual_jacobian(const BoxProblem& problem, const Vector& at);

}  // namespace ulna
