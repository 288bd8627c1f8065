// What speaks for a reflex path: a test on the rows of the fit, and the variance that the paths
// account for on rows that it has not seen.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "impedance/reflex.hpp"
#include "impedance/reflex_cascade.hpp"
#include "impedance/reflex_fit.hpp"
#include "impedance/scores.hpp"
#include "impedance/split.hpp"

namespace ulna {

// Paths of one trial at every prepared row, in the sign of -F.
struct CascadePaths {
  Vector intrinsic, without, reflex;
  Index first = 0, last = 0;  // rows where all are known
};
CascadePaths paths_of(const CascadeTrial& trial, const CascadeGrid& grid,
                      const ReflexOptions& options, const CascadeFit& fitted);

// Fills in every VAF of the estimate but that of the other side, and their intervals: blocks of
// block_rows are drawn with replacement.
void validate_paths(ReflexEstimate& out, const std::vector<CascadeTrial>& trials,
                    const std::vector<CascadePaths>& paths, const Split& split, double block_rows,
                    std::uint64_t seed);

// Is there a rectified path at all? Scores of many elements over the range, of every side allowed.
ScoreTest test_reflex(const Prepared& prepared, const std::vector<Span>& spans,
                      const ReflexOptions& options, const CascadeGrid& grid, const Cascade& cascade,
                      const CascadeFit& fitted, const std::vector<int>& sides, double position_mean,
                      Token* token);

}  // namespace ulna
