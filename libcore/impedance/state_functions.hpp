// Functions of angle and rate: what a muscle, a passive tissue or a spring can add to a straight
// line through a torque.
#pragma once

#include "base/types.hpp"

namespace ulna {

// How rich a set of them is: degree in the angle, degree in the rate of either sign.
struct StateDegrees {
  int angle = 0, rate = 0;
};

// How many columns state_functions() has at most.
Index state_function_count(StateDegrees degrees);

// Chebyshev polynomials of the angle, the rate, and powers of the rate times such polynomials, of
// total degree degrees.angle, the rate's two signs apart: a muscle that is stretched follows
// another curve than one that shortens. Columns may depend on each other. A sign that the rate
// hardly has gets none of its own.
Matrix state_functions(const VectorRef& angle, const VectorRef& rate, StateDegrees degrees);

}  // namespace ulna
