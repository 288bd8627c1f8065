// Exact discretisation of x' = F x + g u(t - delay) for an input that is known at samples and held
// (kZero) or interpolated linearly (kLinear) between them, whatever the delay.
#pragma once

#include "base/types.hpp"

namespace ulna {

enum class Hold { kZero, kLinear };

// A delay in whole samples and the fraction that is left, 0 <= fraction < 1.
struct Delay {
  Index samples = 0;
  double fraction = 0.0;
};

// Within 1e-9 of a whole sample there is no fraction.
Delay split_delay(double delay_s, double rate_hz);

// x[k+1] = phi x[k] + gamma (u[k-d-1], u[k-d], u[k-d+1])', d the whole samples of the delay.
struct Step {
  Matrix phi;
  Matrix gamma;  // states x 3
};

// step: of time, in the unit of F.
Step discretise(const Matrix& f, const Vector& g, double step, double fraction, Hold hold);

// Weights of (u[k-d-1], u[k-d]) in u(t[k] - delay). At the jump of a held input the new value
// counts.
Eigen::Vector2d value_weights(double fraction, Hold hold);

}  // namespace ulna
