// Which random numbers a study uses for what. Every draw is a pure function of (seed, use,
// replicate, row), so a row is the same in whatever order, chunk or thread it is made.
#pragma once

#include <cstdint>

#include "base/random.hpp"

namespace ulna {

// Values are part of the numbers that a seed gives: add, never change.
enum class Use : std::uint64_t {
  kPoint = 1,        // coordinates of a row, jitter within the strata of a Latin hypercube
  kOrder = 2,        // the order of a Latin hypercube's strata
  kScramble = 3,     // of a Sobol' sequence
  kTrajectory = 4,   // start, order and signs of a trajectory
  kBootstrap = 5,    // which blocks a resample holds
  kSubset = 6,       // which blocks a subset holds
  kSurfaceRows = 7,  // which rows a response surface is fitted to
};

// row < 2^42, replicate < 2^16.
inline Random random_of(std::uint64_t seed, Use use, std::uint64_t replicate,
                        std::uint64_t row) noexcept {
  return Random(seed, static_cast<std::uint64_t>(use) << 58 | replicate << 42 | row);
}

}  // namespace ulna
