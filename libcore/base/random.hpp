// Counter-based random numbers: Philox4x32-10 (Salmon et al. 2011, "Parallel random numbers: as
// easy as 1, 2, 3"). A number is a pure function of (seed, stream, counter): no state is shared,
// and a result is the same whatever the number of threads.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "base/types.hpp"

namespace ulna {

class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0) noexcept
      : key_{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)},
        stream_(stream) {}

  std::uint32_t bits() noexcept {
    if (used_ == 4) {
      block_ = philox(counter_++);
      used_ = 0;
    }
    return block_[used_++];
  }

  // Uniform on the open interval (0, 1), 53 bits.
  double uniform() noexcept {
    const std::uint64_t high = bits();
    const std::uint64_t low = bits();
    return (static_cast<double>(((high << 32) | low) >> 11) + 0.5) * 0x1.0p-53;
  }

  // Standard normal by Box-Muller; every call uses one pair, so the counter tells the position.
  double normal() noexcept {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    return radius * std::cos(2.0 * kPi * uniform());
  }

  // Uniform on {0, ..., n - 1}; the bias is below n / 2^53.
  std::int64_t below(std::int64_t n) noexcept {
    return static_cast<std::int64_t>(uniform() * static_cast<double>(n));
  }

 private:
  std::array<std::uint32_t, 4> philox(std::uint64_t counter) const noexcept {
    std::array<std::uint32_t, 4> c = {
        static_cast<std::uint32_t>(counter), static_cast<std::uint32_t>(counter >> 32),
        static_cast<std::uint32_t>(stream_), static_cast<std::uint32_t>(stream_ >> 32)};
    std::uint32_t k0 = key_[0];
    std::uint32_t k1 = key_[1];
    for (int round = 0; round < 10; ++round) {
      const std::uint64_t p0 = std::uint64_t{0xD2511F53u} * c[0];
      const std::uint64_t p1 = std::uint64_t{0xCD9E8D57u} * c[2];
      c = {static_cast<std::uint32_t>(p1 >> 32) ^ c[1] ^ k0, static_cast<std::uint32_t>(p1),
           static_cast<std::uint32_t>(p0 >> 32) ^ c[3] ^ k1, static_cast<std::uint32_t>(p0)};
      k0 += 0x9E3779B9u;
      k1 += 0xBB67AE85u;
    }
    return c;
  }

  std::array<std::uint32_t, 2> key_;
  std::uint64_t stream_;
  std::uint64_t counter_ = 0;
  std::array<std::uint32_t, 4> block_{};
  int used_ = 4;
};

}  // namespace ulna
