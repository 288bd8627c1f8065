// The linear element of a reflex path: a low pass of unit static gain, order 1 or 2, after a pure
// delay. Kearney, Stein and Parameswaran 1997; Mirbagheri, Barbeau and Kearney 2000 give the
// ankle's as second order.
#pragma once

#include "base/types.hpp"

namespace ulna {

struct CausalElement {
  int order = 2;       // 1: w / (s + w); 2: w^2 / (s^2 + 2 zeta w s + w^2)
  double omega = 0.0;  // rad/s, positive
  double zeta = 1.0;   // positive; order 2 only
};

// Output and its time derivative (rows x 2) for an input sampled every step_s, from rest. Between
// samples the input is the cubic through four of them, so that the error for a frequency f is of
// the order (2 pi f step_s)^4.
Matrix element_response(const CausalElement& element, VectorRef input, double step_s);

// Output and rate of an element left to itself from one unit state, 0 <= state < order: what an
// unknown past leaves behind.
Matrix element_free(const CausalElement& element, Index rows, double step_s, int state);

// The cubic between two values with slopes m0 and m1 (per step), at the share f of the step.
inline double hermite(double p0, double m0, double p1, double m1, double f) {
  const double d = p1 - p0;
  return p0 + f * (m0 + f * (3.0 * d - 2.0 * m0 - m1 + f * (m0 + m1 - 2.0 * d)));
}

// Value of a signal `delay` samples before row `row`, from values and derivatives by the cubic that
// matches both; 0 before the first row (rest).
double delayed_value(const Matrix& value_and_rate, double step_s, double row_minus_delay);

}  // namespace ulna
