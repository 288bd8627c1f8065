#include "impedance/state_functions.hpp"

#include <algorithm>

namespace ulna {
namespace {

constexpr double kLeastRate = 0.05;  // of the largest: a sign below it is a joint at rest

// Columns T_0 ... T_degree of a variable scaled to -1 to 1.
Matrix chebyshev_of(const VectorRef& variable, int degree) {
  const double low = variable.minCoeff();
  const double half = std::max(0.5 * (variable.maxCoeff() - low), 1e-300);
  const Vector u = (variable.array() - low) / half - 1.0;
  Matrix t(u.size(), degree + 1);
  t.col(0).setOnes();
  if (degree > 0) t.col(1) = u;
  for (Index p = 2; p <= degree; ++p) t.col(p) = 2.0 * u.cwiseProduct(t.col(p - 1)) - t.col(p - 2);
  return t;
}

}  // namespace

Index state_function_count(StateDegrees degrees) {
  Index count = degrees.angle + 2;
  for (int k = 1; k <= degrees.rate; ++k) count += 2 * (degrees.angle + 1 - k);
  return count;
}

Matrix state_functions(const VectorRef& angle, const VectorRef& rate, StateDegrees degrees) {
  const Matrix of_angle = chebyshev_of(angle, degrees.angle);
  const double most = std::max(rate.cwiseAbs().maxCoeff(), 1e-300);
  Matrix functions(angle.size(), state_function_count(degrees));
  functions.leftCols(of_angle.cols()) = of_angle;
  functions.col(of_angle.cols()) = rate;
  Index c = of_angle.cols() + 1;
  for (const double sign : {1.0, -1.0}) {
    const Vector part = (sign / most * rate).cwiseMax(0.0);
    if (part.maxCoeff() < kLeastRate) continue;
    Vector power = part;
    for (int k = 1; k <= degrees.rate; ++k) {
      const Index count = degrees.angle + 1 - k;
      functions.middleCols(c, count) = of_angle.leftCols(count).array().colwise() * power.array();
      c += count;
      power.array() *= part.array();
    }
  }
  return functions.leftCols(c);
}

}  // namespace ulna
