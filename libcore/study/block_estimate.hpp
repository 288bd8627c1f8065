// Estimates that are functions of means over blocks, with their intervals.
//
// All sensitivity indices here are: each block gives a few numbers (its features), and an index is
// a function of the features' means. A resample of blocks is then a weighting of rows of one
// matrix, so thousands of resamples cost one matrix product, and leaving a block out costs a
// subtraction.
#pragma once

#include <cstdint>
#include <functional>

#include "base/token.hpp"
#include "base/types.hpp"
#include "study/sobol_sequence.hpp"

namespace ulna {

struct BlockFeatures {
  Index blocks = 0;
  Index features = 0;
  Index statistics = 0;
  // Features of blocks first, first + 1, ...; out is blocks x features. Called by several threads.
  std::function<void(Index first, Eigen::Ref<Matrix> out)> fill;
  // Coordinates of blocks in the cube whose strata a Latin hypercube hits once each, blocks x
  // coordinates; 0 for blocks that are independent. What features owe to single coordinates does
  // not vary from one hypercube to the next (Stein 1987), so a bootstrap leaves it out.
  Index coordinates = 0;
  std::function<void(Index first, Eigen::Ref<PointRows> out)> fill_coordinates;
  // Statistics of the features' means over n blocks.
  std::function<void(const double* means, Index n, double* out)> evaluate;
};

enum class IntervalKind {
  kPercentile,  // bootstrap of whole blocks, quantiles of the resamples (Efron 1979)
  kBca,         // bias-corrected and accelerated (Efron 1987)
  kReplicates,  // spread of independent replicates, Student's t
  kNone,
};

struct IntervalSpec {
  IntervalKind kind = IntervalKind::kPercentile;
  double level = 0.9;
  Index resamples = 1000;
  Index replicates = 1;  // equal shares of the blocks in a row
  std::uint64_t seed = 0;
  int threads = 0;
};

struct Estimates {
  Vector value;
  Vector error;  // standard error: of the resamples, or of the mean of the replicates
  Vector low;    // NaN without an interval
  Vector high;
};

Estimates estimate_of_blocks(const BlockFeatures& blocks, const IntervalSpec& spec,
                             Token* token = nullptr);

}  // namespace ulna
