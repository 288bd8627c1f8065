// A smoother that is wide open over the band of an analysis, for signals that go through a relation
// that is not linear before the analysis filters them for good.
#pragma once

#include "ident/prepare.hpp"

namespace ulna {

// Low pass that prepare would choose for these channels, Hz.
double chosen_lowpass(const Record& record, const std::vector<Index>& channels,
                      const PrepareOptions& options);

// The options with `times` that low pass, unless the caller set one; at 4, the gain at the edge of
// the narrow band deviates from one by 1e-6.
PrepareOptions wide_options(const Record& record, const std::vector<Index>& channels,
                            const PrepareOptions& options, double times = 4.0);

}  // namespace ulna
