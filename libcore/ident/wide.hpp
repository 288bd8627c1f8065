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

// Leaves out the rows at either end of every trial where the extension of the low pass shows: it
// starts from one noisy sample, whose second derivative, hardly filtered, may exceed the motion by
// far. Adds them to report.dropped_rows. Throws Error (kData) when nothing of a trial remains.
void drop_transients(Prepared& prepared, const Record& record);

}  // namespace ulna
