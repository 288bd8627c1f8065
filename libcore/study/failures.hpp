// Runs that failed: how many, where, and what an analysis does about them.
#pragma once

#include <cstdint>
#include <vector>

#include "base/token.hpp"
#include "study/sampling.hpp"

namespace ulna {

enum class OnFailure {
  kError,      // refuse the analysis
  kDropBlock,  // leave out blocks that hold a failed run
  kNearest,    // take the output of the nearest good run, in quantiles
  kSurface,    // take a polynomial fitted to the good runs
};

struct FailureReport {
  Index rows = 0;                // failed
  Index blocks = 0;              // that hold one
  std::vector<Index> by_status;  // failed rows of status 0, 1, ...; status 0 means not finite
  Index base = 0;                // failed rows at which no group had been moved alone: A, B
  std::vector<Index> by_group;   // failed rows at which a group had just been moved
  Vector flip_share;             // share of a group's steps that turn a run from good to failed or
                                 // back
  double surface_r2 = 0.0;       // of the surface, on the good runs nearest to the failures
  Index surface_terms = 0;
};

struct Outputs {
  Vector y;                  // one a row
  std::vector<bool> failed;  // one a row: a status other than 0, or not finite
  FailureReport report;
};

// status: one a row, 0 for a good run, or empty.
Outputs look_at_outputs(const Sampling& sampling, const VectorRef& y,
                        const std::vector<std::int32_t>& status);

// Replaces failed outputs for kNearest and kSurface; throws for kError. What is left in `failed`
// must be dropped.
void treat_failures(const Sampling& sampling, OnFailure on_failure, std::uint64_t seed,
                    Outputs& outputs, Token* token);

// The group that each row of a block moves alone, -1 for none; for trajectories by looking at
// points.
std::vector<Index> moved_groups(const Sampling& sampling, Index block);

// For each row of a block: the row of the block it differs from by that one move; -1 for none.
std::vector<Index> compared_rows(const Sampling& sampling);

}  // namespace ulna
