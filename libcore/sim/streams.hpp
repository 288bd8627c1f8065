// Which random numbers are whose: every source of a run has its own stream, so that adding one
// changes no other.
#pragma once

#include "base/random.hpp"

namespace ulna::sim {

enum class Stream : std::uint64_t {
  kTremorX = 0,
  kTremorY = 1,
  kPosition = 2,
  kForce = 3,
  kAccelerometer = 4,
};
inline constexpr std::uint64_t kStreams = 16;  // from one run to the next

inline Random random_of(std::uint64_t seed, std::uint64_t run, Stream stream) noexcept {
  return Random(seed, run * kStreams + static_cast<std::uint64_t>(stream));
}

}  // namespace ulna::sim
