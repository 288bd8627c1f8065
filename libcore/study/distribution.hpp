// Distributions of factors, by quantile: a design lives in the unit cube, a factor's value is the
// quantile of its coordinate.
#pragma once

#include <vector>

#include "base/types.hpp"

namespace ulna {

enum class Family { kUniform, kNormal, kTruncatedNormal, kTriangular, kLogUniform, kDiscrete };

// Inverse of the standard normal distribution, 0 < p < 1, to 1e-15 (Wichura 1988, AS 241).
double standard_normal_quantile(double p);

class Distribution {
 public:
  static Distribution uniform(double low, double high);
  static Distribution normal(double mean, double deviation);
  // The normal distribution (mean, deviation) given that it falls between low and high.
  static Distribution truncated_normal(double mean, double deviation, double low, double high);
  static Distribution triangular(double low, double mode, double high);
  static Distribution log_uniform(double low, double high);
  // Values in the order given, each with a weight at least 0; no weights: equally likely.
  static Distribution discrete(std::vector<double> values, std::vector<double> weights);

  // p from 0 to 1; the ends only where they are finite.
  double quantile(double p) const;
  // P(X <= x). At a value of a discrete distribution: the middle of its step, so that
  // quantile(probability(v)) is v.
  double probability(double x) const;

  Family family() const noexcept { return family_; }

 private:
  Distribution(Family family, double a, double b, double c, double d)
      : family_(family), a_(a), b_(b), c_(c), d_(d) {}

  Family family_;
  double a_, b_, c_, d_;
  double tail_low_ = 0.0;  // truncated normal: probability at the ends, on the side of the tail
  double tail_high_ = 0.0;
  bool mirrored_ = false;
  std::vector<double> values_;
  std::vector<double> cumulative_;
};

}  // namespace ulna
