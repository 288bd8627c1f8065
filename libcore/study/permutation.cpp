#include "study/permutation.hpp"

#include <bit>
#include <numeric>
#include <utility>

#include "base/error.hpp"

namespace ulna {
namespace {

// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): a bijection that spreads every bit.
std::uint64_t spread_bits(std::uint64_t x) noexcept {
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

}  // namespace

Permutation::Permutation(Index n, Random random) : n_(n) {
  require(n >= 1, "n", "an order needs at least one place");
  if (n <= kTable) {
    table_.resize(static_cast<std::size_t>(n));
    std::iota(table_.begin(), table_.end(), 0U);
    for (Index i = n - 1; i > 0; --i) {
      std::swap(table_[static_cast<std::size_t>(i)],
                table_[static_cast<std::size_t>(random.below(i + 1))]);
    }
    return;
  }
  const auto bits = static_cast<int>(std::bit_width(static_cast<std::uint64_t>(n - 1)));
  low_bits_ = bits / 2;
  high_bits_ = bits - low_bits_;
  for (std::uint64_t& key : keys_) {
    const std::uint64_t high = random.bits();
    key = (high << 32) | random.bits();
  }
}

Index Permutation::operator()(Index place) const noexcept {
  if (!table_.empty()) return table_[static_cast<std::size_t>(place)];
  const std::uint64_t low_mask = (1ULL << low_bits_) - 1;
  const std::uint64_t high_mask = (1ULL << high_bits_) - 1;
  auto x = static_cast<std::uint64_t>(place);
  do {
    std::uint64_t low = x & low_mask;
    std::uint64_t high = x >> low_bits_;
    for (std::size_t round = 0; round < kRounds; round += 2) {
      low ^= spread_bits(high ^ keys_[round]) & low_mask;
      high ^= spread_bits(low ^ keys_[round + 1]) & high_mask;
    }
    x = high << low_bits_ | low;
  } while (x >= static_cast<std::uint64_t>(n_));
  return static_cast<Index>(x);
}

}  // namespace ulna
