// Stationary coloured noise: white noise through w^2 / (s^2 + 2 z w s + w^2), sampled exactly.
#pragma once

#include "base/random.hpp"
#include "plant/planar_robot.hpp"

namespace ulna::sim {

class ColouredNoise {
 public:
  // rms of the output; natural frequency in Hz, damping ratio above 0; samples step_s apart. The
  // first value is drawn from the stationary distribution. rms 0 draws nothing.
  ColouredNoise(double rms, double natural_hz, double damping, double step_s, Random random);

  double next() noexcept;

 private:
  double rms_;
  Random random_;
  Matrix2 transition_ = Matrix2::Zero();
  Matrix2 spread_ = Matrix2::Zero();  // Cholesky factor of the covariance of one step
  Vector2 state_ = Vector2::Zero();   // value and derivative over w, unit variances
};

}  // namespace ulna::sim
