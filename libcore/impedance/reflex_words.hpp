// What a reflex estimate says of itself.
#pragma once

#include "impedance/reflex.hpp"

namespace ulna {

// Adds the outcomes, warnings, notes and provenance that follow from the numbers.
void explain_reflex(ReflexEstimate& estimate);

}  // namespace ulna
