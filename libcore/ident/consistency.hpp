// Do the derivatives belong to the position they came from? The check of Fig. 3.6 of Dyck 2013.
#pragma once

#include "ident/prepare.hpp"

namespace ulna {

// Acceleration integrated once against velocity, and twice against position, over ten seconds from
// the middle of the longest trial: rms of the difference over rms of the motion, integration
// constants fitted; the largest over the axes. Correct filters leave 1e-3 and less; NaN for a trial
// too short.
struct DerivativeConsistency {
  double velocity = 0.0;
  double position = 0.0;
};

DerivativeConsistency derivative_consistency(const Prepared& prepared);

}  // namespace ulna
