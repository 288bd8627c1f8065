#include "stats/beta.hpp"

#include <algorithm>
#include <cmath>

namespace ulna {
namespace {

constexpr double kTiniest = 1e-300;

}  // namespace

// By its continued fraction (DLMF 8.17.22), evaluated with Lentz's method on the side where it
// converges.
double beta_regularised(double a, double b, double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  if (x > (a + 1.0) / (a + b + 2.0)) return 1.0 - beta_regularised(b, a, 1.0 - x);
  const double front = std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) +
                                a * std::log(x) + b * std::log1p(-x)) /
                       a;
  double c = 1.0;
  double d = 1.0 / std::max(1.0 - (a + b) * x / (a + 1.0), kTiniest);
  double value = d;
  for (int m = 1; m < 500; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    double change = 1.0;
    for (const double term : {even, odd}) {
      d = 1.0 + term * d;
      c = 1.0 + term / c;
      if (std::abs(d) < kTiniest) d = kTiniest;
      if (std::abs(c) < kTiniest) c = kTiniest;
      d = 1.0 / d;
      change *= d * c;
    }
    value *= change;
    if (std::abs(change - 1.0) < 1e-15) break;
  }
  return front * value;
}

}  // namespace ulna
