#include "study/distribution.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "base/error.hpp"

namespace ulna {
namespace {

void check_factor_number(double value, const char* name) {
  require(std::isfinite(value), name, std::string(name) + " must be a finite number");
}

void check_factor_order(double low, double high) {
  check_factor_number(low, "low");
  check_factor_number(high, "high");
  require(low < high, "high", "high must be above low");
  require(std::isfinite(high - low), "high", "high - low must be a finite number");
}

double normal_share_below(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }

}  // namespace

double standard_normal_quantile(double p) {
  require(p > 0.0 && p < 1.0, "p", "a probability must lie strictly between 0 and 1");
  static constexpr double a[] = {3.3871328727963666080e0,  1.3314166789178437745e+2,
                                 1.9715909503065514427e+3, 1.3731693765509461125e+4,
                                 4.5921953931549871457e+4, 6.7265770927008700853e+4,
                                 3.3430575583588128105e+4, 2.5090809287301226727e+3};
  static constexpr double b[] = {1.0,
                                 4.2313330701600911252e+1,
                                 6.8718700749205790830e+2,
                                 5.3941960214247511077e+3,
                                 2.1213794301586595867e+4,
                                 3.9307895800092710610e+4,
                                 2.8729085735721942674e+4,
                                 5.2264952788528545610e+3};
  static constexpr double c[] = {1.42343711074968357734e0,  4.63033784615654529590e0,
                                 5.76949722146069140550e0,  3.64784832476320460504e0,
                                 1.27045825245236838258e0,  2.41780725177450611770e-1,
                                 2.27238449892691845833e-2, 7.74545014278341407640e-4};
  static constexpr double d[] = {1.0,
                                 2.05319162663775882187e0,
                                 1.67638483018380384940e0,
                                 6.89767334985100004550e-1,
                                 1.48103976427480074590e-1,
                                 1.51986665636164571966e-2,
                                 5.47593808499534494600e-4,
                                 1.05075007164441684324e-9};
  static constexpr double e[] = {6.65790464350110377720e0,  5.46378491116411436990e0,
                                 1.78482653991729133580e0,  2.96560571828504891230e-1,
                                 2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                 2.71155556874348757815e-5, 2.01033439929228813265e-7};
  static constexpr double f[] = {1.0,
                                 5.99832206555887937690e-1,
                                 1.36929880922735805310e-1,
                                 1.48753612908506148525e-2,
                                 7.86869131145613259100e-4,
                                 1.84631831751005468180e-5,
                                 1.42151175831644588870e-7,
                                 2.04426310338993978564e-15};
  const auto ratio = [](const double(&top)[8], const double(&bottom)[8], double r) {
    double numerator = top[7];
    double denominator = bottom[7];
    for (int k = 6; k >= 0; --k) {
      numerator = numerator * r + top[k];
      denominator = denominator * r + bottom[k];
    }
    return numerator / denominator;
  };
  const double q = p - 0.5;
  if (std::abs(q) <= 0.425) return q * ratio(a, b, 0.180625 - q * q);
  const double r = std::sqrt(-std::log(q < 0.0 ? p : 1.0 - p));
  const double z = r <= 5.0 ? ratio(c, d, r - 1.6) : ratio(e, f, r - 5.0);
  return q < 0.0 ? -z : z;
}

Distribution Distribution::uniform(double low, double high) {
  check_factor_order(low, high);
  return {Family::kUniform, low, high, 0.0, 0.0};
}

Distribution Distribution::normal(double mean, double deviation) {
  check_factor_number(mean, "mean");
  require(deviation > 0.0 && std::isfinite(deviation), "deviation", "deviation must be positive");
  return {Family::kNormal, mean, deviation, 0.0, 0.0};
}

Distribution Distribution::truncated_normal(double mean, double deviation, double low,
                                            double high) {
  check_factor_number(mean, "mean");
  require(deviation > 0.0 && std::isfinite(deviation), "deviation", "deviation must be positive");
  check_factor_order(low, high);
  Distribution out(Family::kTruncatedNormal, mean, deviation, low, high);
  // Probabilities near 1 have lost their digits: above the mean count from the other end.
  out.mirrored_ = low > mean;
  const double from = out.mirrored_ ? (mean - high) / deviation : (low - mean) / deviation;
  const double to = out.mirrored_ ? (mean - low) / deviation : (high - mean) / deviation;
  out.tail_low_ = normal_share_below(from);
  out.tail_high_ = normal_share_below(to);
  require(out.tail_high_ - out.tail_low_ > 0.0, "low",
          "low and high are so far from the mean that nothing of the distribution is left");
  return out;
}

Distribution Distribution::triangular(double low, double mode, double high) {
  check_factor_order(low, high);
  require(mode >= low && mode <= high, "mode", "mode must lie between low and high");
  return {Family::kTriangular, low, mode, high, 0.0};
}

Distribution Distribution::log_uniform(double low, double high) {
  check_factor_order(low, high);
  require(low > 0.0, "low", "low must be positive for a log-uniform distribution");
  return {Family::kLogUniform, low, high, std::log(low), std::log(high)};
}

Distribution Distribution::discrete(std::vector<double> values, std::vector<double> weights) {
  require(!values.empty(), "values", "a discrete distribution needs at least one value");
  if (weights.empty()) weights.assign(values.size(), 1.0);
  require(weights.size() == values.size(), "weights",
          "weights must be as many as values, " + std::to_string(values.size()));
  for (std::size_t i = 0; i < values.size(); ++i) {
    check_factor_number(values[i], "values");
    require(weights[i] >= 0.0 && std::isfinite(weights[i]), "weights",
            "weights must be at least 0; weight " + std::to_string(i) + " is not");
  }
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  require(sum > 0.0 && std::isfinite(sum), "weights", "the weights must have a positive sum");
  Distribution out(Family::kDiscrete, 0.0, 0.0, 0.0, 0.0);
  double so_far = 0.0;
  for (const double weight : weights) {
    so_far += weight;
    out.cumulative_.push_back(so_far / sum);
  }
  // Whatever rounding did, what lies at and beyond the last value that can occur is 1.
  for (std::size_t i = weights.size(); i-- > 0;) {
    out.cumulative_[i] = 1.0;
    if (weights[i] > 0.0) break;
  }
  out.values_ = std::move(values);
  return out;
}

double Distribution::quantile(double p) const {
  require(p >= 0.0 && p <= 1.0, "p", "a probability must lie between 0 and 1");
  switch (family_) {
    case Family::kUniform:
      // Both ends exactly, whatever the rounding between.
      return p == 1.0 ? b_ : std::min(b_, a_ + p * (b_ - a_));
    case Family::kNormal:
      if (p == 0.0 || p == 1.0) {
        throw Error(Fault::kArgument, "p",
                    "the quantiles 0 and 1 of a normal distribution are infinite: trajectories "
                    "need bounded factors, so truncate it or use a radial design");
      }
      return a_ + b_ * standard_normal_quantile(p);
    case Family::kTruncatedNormal: {
      if (p == 0.0) return c_;
      if (p == 1.0) return d_;
      const double share = mirrored_ ? 1.0 - p : p;
      const double at = tail_low_ + share * (tail_high_ - tail_low_);
      if (!(at > 0.0)) return mirrored_ ? d_ : c_;
      if (!(at < 1.0)) return mirrored_ ? c_ : d_;
      const double z = standard_normal_quantile(at);
      return std::clamp(a_ + b_ * (mirrored_ ? -z : z), c_, d_);
    }
    case Family::kTriangular: {
      const double width = c_ - a_;
      const double turn = (b_ - a_) / width;
      if (p <= turn) return a_ + std::sqrt(p * width * (b_ - a_));
      return c_ - std::sqrt((1.0 - p) * width * (c_ - b_));
    }
    case Family::kLogUniform:
      if (p == 0.0) return a_;
      if (p == 1.0) return b_;
      return std::clamp(std::exp(c_ + p * (d_ - c_)), a_, b_);
    case Family::kDiscrete: {
      const auto at = p == 1.0 ? std::find(cumulative_.begin(), cumulative_.end(), 1.0)
                               : std::upper_bound(cumulative_.begin(), cumulative_.end(), p);
      return values_[static_cast<std::size_t>(at - cumulative_.begin())];
    }
  }
  throw Error(Fault::kInternal, "", "a distribution of no known family");
}

double Distribution::probability(double x) const {
  require(!std::isnan(x), "x", "x must be a number");
  switch (family_) {
    case Family::kUniform:
      return std::clamp((x - a_) / (b_ - a_), 0.0, 1.0);
    case Family::kNormal:
      return normal_share_below((x - a_) / b_);
    case Family::kTruncatedNormal: {
      if (x <= c_) return 0.0;
      if (x >= d_) return 1.0;
      const double z = (x - a_) / b_;
      const double share =
          (normal_share_below(mirrored_ ? -z : z) - tail_low_) / (tail_high_ - tail_low_);
      return std::clamp(mirrored_ ? 1.0 - share : share, 0.0, 1.0);
    }
    case Family::kTriangular: {
      if (x <= a_) return 0.0;
      if (x >= c_) return 1.0;
      const double width = c_ - a_;
      if (x <= b_) return (x - a_) * (x - a_) / (width * (b_ - a_));
      return 1.0 - (c_ - x) * (c_ - x) / (width * (c_ - b_));
    }
    case Family::kLogUniform:
      if (x <= a_) return 0.0;
      if (x >= b_) return 1.0;
      return (std::log(x) - c_) / (d_ - c_);
    case Family::kDiscrete: {
      for (std::size_t i = 0; i < values_.size(); ++i) {
        if (values_[i] == x) {
          const double before = i == 0 ? 0.0 : cumulative_[i - 1];
          return 0.5 * (before + cumulative_[i]);
        }
      }
      throw Error(Fault::kData, "x", "a number given is none of the discrete values");
    }
  }
  throw Error(Fault::kInternal, "", "a distribution of no known family");
}

}  // namespace ulna
