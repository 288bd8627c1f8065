#include "sim/coloured.hpp"

#include <algorithm>
#include <cmath>

namespace ulna::sim {
namespace {

// exp(A h) for A = w [0 1; -1 -2 z], the state being (value, derivative / w).
Matrix2 exponential(double w, double z, double h) {
  const double decay = std::exp(-z * w * h);
  const double square = z * z - 1.0;
  const double x = w * h * std::sqrt(std::abs(square));
  // cosine-like and sine-like parts of either regime; x -> 0 is the aperiodic limit.
  const double c = square < 0.0 ? std::cos(x) : std::cosh(x);
  const double s = x < 1e-9 ? w * h : (square < 0.0 ? std::sin(x) : std::sinh(x)) / x * w * h;
  Matrix2 e;
  e << c + z * s, s, -s, c - z * s;
  return decay * e;
}

}  // namespace

ColouredNoise::ColouredNoise(double rms, double natural_hz, double damping, double step_s,
                             Random random)
    : rms_(rms), random_(random) {
  if (rms_ == 0.0) return;
  transition_ = exponential(2.0 * kPi * natural_hz, damping, step_s);
  // The stationary covariance of (value, derivative / w) is the identity, so that of one step is
  // I - Phi Phi^T.
  const Matrix2 q = Matrix2::Identity() - transition_ * transition_.transpose();
  spread_(0, 0) = std::sqrt(std::max(q(0, 0), 0.0));
  spread_(1, 0) = spread_(0, 0) > 0.0 ? q(1, 0) / spread_(0, 0) : 0.0;
  spread_(1, 1) = std::sqrt(std::max(q(1, 1) - spread_(1, 0) * spread_(1, 0), 0.0));
  state_ << random_.normal(), random_.normal();
}

double ColouredNoise::next() noexcept {
  if (rms_ == 0.0) return 0.0;
  const double value = rms_ * state_[0];
  const double first = random_.normal();
  const double second = random_.normal();
  state_ = transition_ * state_ + spread_ * Vector2(first, second);
  return value;
}

}  // namespace ulna::sim
