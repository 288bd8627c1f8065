// Both paths of the parallel cascade as impulse responses: no orders, no delay.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "impedance/reflex.hpp"
#include "impedance/reflex_cascade.hpp"
#include "impedance/split.hpp"

namespace ulna {

// Two-sided of the position, with a ridge, and one-sided of the rectified velocity, with a penalty
// on its roughness; either penalty is chosen by cross-validation. Not available when options ask
// for none or the trials are too short.
ReflexImpulse impulse_responses(const std::vector<CascadeTrial>& trials, const Split& split,
                                const ReflexOptions& options, const CascadeGrid& plain,
                                Token* token);

}  // namespace ulna
