// A random order of 0 ... n - 1 that is looked up by place: of a Latin hypercube's strata, or of
// the blocks that a subset holds.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/random.hpp"
#include "base/types.hpp"

namespace ulna {

class Permutation {
 public:
  // Up to kTable places every order is equally likely (Fisher-Yates, in memory). Beyond, the order
  // is that of a keyed Feistel network walked until it falls inside: no memory, whatever n.
  Permutation(Index n, Random random);

  Index operator()(Index place) const noexcept;

  static constexpr Index kTable = 1 << 16;

 private:
  static constexpr int kRounds = 10;
  Index n_;
  std::vector<std::uint32_t> table_;
  std::array<std::uint64_t, kRounds> keys_{};
  int low_bits_ = 0;
  int high_bits_ = 0;
};

}  // namespace ulna
