#include "stats/distributions.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "stats/beta.hpp"

namespace ulna {
namespace {

constexpr double kTiny = 1e-300;

double student_cdf(double t, double dof) {
  const double tail = 0.5 * beta_regularised(0.5 * dof, 0.5, dof / (dof + t * t));
  return t > 0.0 ? 1.0 - tail : tail;
}

}  // namespace

double normal_quantile(double p) {
  require(p > 0.0 && p < 1.0, "p", "a probability must lie strictly between 0 and 1");
  // 1 - p is exact here, and the lower tail keeps its digits where the upper one is lost beside 1.
  if (p > 0.5) return -normal_quantile(1.0 - p);
  static constexpr double a[] = {-3.969683028665376e+01, 2.209460984245205e+02,
                                 -2.759285104469687e+02, 1.383577518672690e+02,
                                 -3.066479806614716e+01, 2.506628277459239e+00};
  static constexpr double b[] = {-5.447609879822406e+01, 1.615858368580409e+02,
                                 -1.556989798598866e+02, 6.680131188771972e+01,
                                 -1.328068155288572e+01};
  static constexpr double c[] = {-7.784894002430293e-03, -3.223964580411365e-01,
                                 -2.400758277161838e+00, -2.549732539343734e+00,
                                 4.374664141464968e+00,  2.938163982698783e+00};
  static constexpr double d[] = {7.784695709041462e-03, 3.224671290700398e-01,
                                 2.445134137142996e+00, 3.754408661907416e+00};
  const auto tail = [&](double q) {
    return (((((c[0] * q + c[1]) * q + c[2]) * q + c[3]) * q + c[4]) * q + c[5]) /
           ((((d[0] * q + d[1]) * q + d[2]) * q + d[3]) * q + 1.0);
  };
  double x = 0.0;
  if (p < 0.02425) {
    x = tail(std::sqrt(-2.0 * std::log(p)));
  } else {
    const double q = p - 0.5;
    const double r = q * q;
    x = (((((a[0] * r + a[1]) * r + a[2]) * r + a[3]) * r + a[4]) * r + a[5]) * q /
        (((((b[0] * r + b[1]) * r + b[2]) * r + b[3]) * r + b[4]) * r + 1.0);
  }
  const double error = 0.5 * std::erfc(-x / std::sqrt(2.0)) - p;
  const double u = error * std::sqrt(2.0 * kPi) * std::exp(0.5 * x * x);
  return x - u / (1.0 + 0.5 * x * u);
}

double student_quantile(double p, double dof) {
  require(dof > 0.0, "dof", "degrees of freedom must be positive");
  const double start = normal_quantile(p);
  if (start < 0.0) return -student_quantile(1.0 - p, dof);
  if (p == 0.5) return 0.0;
  // Bracket, then bisect: the distribution function is monotone and 200 halvings exhaust a double.
  double low = 0.0;
  double high = std::max(1.0, 2.0 * start);
  while (student_cdf(high, dof) < p) high *= 2.0;
  for (int i = 0; i < 200 && high - low > 1e-15 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (student_cdf(middle, dof) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double chi_square_tail(double x, double dof) {
  require(dof > 0.0, "dof", "degrees of freedom must be positive");
  if (!(x > 0.0)) return std::isnan(x) ? kNaN : 1.0;
  if (std::isinf(x)) return 0.0;
  const double a = 0.5 * dof;
  const double z = 0.5 * x;
  const double front = std::exp(a * std::log(z) - z - std::lgamma(a));
  if (z < a + 1.0) {  // series of the lower function (DLMF 8.7.1)
    double term = 1.0 / a;
    double sum = term;
    for (double k = a + 1.0; std::abs(term) > 1e-17 * std::abs(sum); k += 1.0) {
      term *= z / k;
      sum += term;
    }
    return std::max(0.0, 1.0 - front * sum);
  }
  // Continued fraction of the upper function (DLMF 8.9.2), Lentz.
  double b = z + 1.0 - a;
  double c = 1.0 / kTiny;
  double d = 1.0 / b;
  double value = d;
  for (int i = 1; i < 1000; ++i) {
    const double an = -i * (i - a);
    b += 2.0;
    d = an * d + b;
    c = b + an / c;
    if (std::abs(d) < kTiny) d = kTiny;
    if (std::abs(c) < kTiny) c = kTiny;
    d = 1.0 / d;
    const double change = d * c;
    value *= change;
    if (std::abs(change - 1.0) < 1e-15) break;
  }
  return front * value;
}

double sample_quantile(std::vector<double> sample, double p) {
  std::erase_if(sample, [](double v) { return std::isnan(v); });
  if (sample.empty()) return kNaN;
  const double position = p * static_cast<double>(sample.size() - 1);
  const auto below = static_cast<std::ptrdiff_t>(std::floor(position));
  std::nth_element(sample.begin(), sample.begin() + below, sample.end());
  const double low = sample[static_cast<std::size_t>(below)];
  const double share = position - static_cast<double>(below);
  if (share == 0.0) return low;
  const double high = *std::min_element(sample.begin() + below + 1, sample.end());
  return low + share * (high - low);
}

}  // namespace ulna
