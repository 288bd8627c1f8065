#include "signal/second_order.hpp"

#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/types.hpp"

namespace ulna {
namespace {

// exp(-sigma t) times cos(w_d t) and sin(w_d t) / w_d, or their hyperbolic forms: one expression on
// either side of critical damping, without cancellation near it and without overflow beyond it.
struct Modes {
  double cosine = 0.0;
  double sine = 0.0;
};

Modes modes_of(const SecondOrder& filter, double t) {
  const double zeta = filter.damping_ratio;
  const double w = filter.natural_rad_s;
  const double sigma = zeta * w;
  const double square = (1.0 - zeta) * (1.0 + zeta) * w * w;  // of w_d; negative when overdamped
  const double x2 = square * t * t;
  const double decay = std::exp(-sigma * t);
  if (std::abs(x2) < 1e-4) {
    // Series in (w_d t)^2, exact to rounding.
    return {decay * (1.0 - x2 / 2.0 + x2 * x2 / 24.0),
            decay * t * (1.0 - x2 / 6.0 + x2 * x2 / 120.0)};
  }
  if (square > 0.0) {
    const double wd = std::sqrt(square);
    return {decay * std::cos(wd * t), decay * std::sin(wd * t) / wd};
  }
  const double a = std::sqrt(-square);
  // -sigma + a cancels when zeta is large; the product of the poles is w^2.
  const double slow = std::exp(-w * w / (sigma + a) * t);
  const double fast = std::exp(-(sigma + a) * t);
  return {0.5 * (slow + fast), 0.5 * (slow - fast) / a};
}

}  // namespace

void check_second_order(const SecondOrder& filter) {
  require(filter.damping_ratio > 0.0 && filter.damping_ratio <= 100.0, "damping_ratio",
          "the damping ratio of the filter must be above 0 and at most 100");
  require(std::isfinite(filter.natural_rad_s) && filter.natural_rad_s > 0.0, "natural_rad_s",
          "the natural frequency of the filter must be a positive number of rad/s");
}

SignalPoint free_response(const SecondOrder& filter, double value, double rate, double t_s) {
  const double w2 = filter.natural_rad_s * filter.natural_rad_s;
  const double sigma = filter.damping_ratio * filter.natural_rad_s;
  const Modes m = modes_of(filter, t_s);
  SignalPoint out;
  out.value = value * (m.cosine + sigma * m.sine) + rate * m.sine;
  out.rate = rate * (m.cosine - sigma * m.sine) - value * w2 * m.sine;
  out.acceleration = -2.0 * sigma * out.rate - w2 * out.value;
  return out;
}

SignalPoint step_response(const SecondOrder& filter, double t_s) {
  if (t_s < 0.0) return {};
  const SignalPoint left = free_response(filter, 1.0, 0.0, t_s);
  return {1.0 - left.value, -left.rate, -left.acceleration};
}

StepFacts step_facts(const SecondOrder& filter) {
  check_second_order(filter);
  const double zeta = filter.damping_ratio;
  const double w = filter.natural_rad_s;
  if (zeta < 1.0) {
    const double root = std::sqrt((1.0 - zeta) * (1.0 + zeta));
    return {std::exp(-kPi * zeta / root), kPi / (w * root), 4.0 / (zeta * w)};
  }
  const double slowest = w / (zeta + std::sqrt((zeta - 1.0) * (zeta + 1.0)));
  return {0.0, std::numeric_limits<double>::infinity(), 4.0 / slowest};
}

}  // namespace ulna
