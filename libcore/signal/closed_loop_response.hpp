// Frequency response inside of a loop, by the joint input-output method: the reference is what the
// noise of the loop cannot know, so H = S_ry / S_ru has no bias where H1 has.
#pragma once

#include "signal/spectrum.hpp"

namespace ulna {

// One reference for each input. H' = S_ru^-1 S_ry (Wellstead 1981). The radius follows from the
// variance of y - H u over that of what the reference causes; it is infinite where the reference's
// effect on an input cannot be told from chance at this confidence (Fieller 1954), and NaN where
// the references are dependent or without power. Throws as frequency_response.
FrequencyResponse closed_loop_response(const Spectra& spectra, const std::vector<Index>& references,
                                       const std::vector<Index>& inputs,
                                       const std::vector<Index>& outputs, double confidence = 0.95);

}  // namespace ulna
