// What changes between two conditions that the same subjects went through, with intervals from a
// bootstrap of whole subjects: pairs stay together, and so do the measures of one subject.
#pragma once

#include "study/block_estimate.hpp"

namespace ulna {

// One value a measure each.
struct PairedEstimates {
  Estimates difference;    // mean of second - first, in the measure's unit
  Estimates relative;      // mean of second / mean of first - 1
  Estimates standardised;  // mean difference / standard deviation of the differences (Cohen's d_z)
};

// first, second: subjects x measures, finite. spec.kind is kBca or kPercentile (few subjects make
// both somewhat narrow). Throws Error kArgument for shapes that differ or fewer than 3 subjects,
// kData for a value that is no number, with subject and measure.
PairedEstimates paired_estimates(MatrixRef first, MatrixRef second, const IntervalSpec& spec,
                                 Token* token = nullptr);

}  // namespace ulna
