#include "study/sobol_sequence.hpp"

#include <bit>
#include <string>

#include "base/error.hpp"
#include "study/sobol_directions.hpp"
#include "study/streams.hpp"

namespace ulna {

SobolSequence::SobolSequence(Index dimensions, std::uint64_t seed, std::uint64_t replicate,
                             bool scrambled) {
  require(dimensions >= 1 && dimensions <= kSobolDimensions, "sampler",
          "the Sobol' sequence has " + std::to_string(kSobolDimensions) + " dimensions, and " +
              std::to_string(dimensions) +
              " are needed (two for each factor): use the latin or monte-carlo sampler");
  directions_.resize(static_cast<std::size_t>(dimensions));
  shift_.assign(static_cast<std::size_t>(dimensions), 0);
  const std::uint16_t* initial = kSobolInitial;
  for (Index d = 0; d < dimensions; ++d) {
    Directions& v = directions_[static_cast<std::size_t>(d)];
    if (d == 0) {
      for (int j = 0; j < kIndexBits; ++j) v[static_cast<std::size_t>(j)] = 1ULL << (51 - j);
    } else {
      const std::uint64_t polynomial = kSobolPolynomials[d - 1];
      const int degree = static_cast<int>(std::bit_width(polynomial)) - 1;
      for (int j = 0; j < kIndexBits; ++j) {
        const auto at = static_cast<std::size_t>(j);
        if (j < degree) {
          v[at] = std::uint64_t{initial[j]} << (51 - j);
          continue;
        }
        // Recurrence (2) of Joe and Kuo, written for directions instead of the integers m.
        v[at] = v[at - static_cast<std::size_t>(degree)] ^
                (v[at - static_cast<std::size_t>(degree)] >> degree);
        for (int k = 1; k < degree; ++k) {
          if ((polynomial >> (degree - k)) & 1U) v[at] ^= v[at - static_cast<std::size_t>(k)];
        }
      }
      initial += degree;
    }
    if (!scrambled) continue;
    Random random = random_of(seed, Use::kScramble, replicate, static_cast<std::uint64_t>(d));
    const auto word = [&random] {
      const std::uint64_t high = random.bits();
      return (high << 32) | random.bits();
    };
    // Lower triangular with a unit diagonal: a digit is mixed with more significant ones only.
    std::array<std::uint64_t, kDigits> mixing;
    for (int i = 0; i < kDigits; ++i) {
      const std::uint64_t own = 1ULL << (51 - i);
      const std::uint64_t above = ((1ULL << kDigits) - 1) & ~(2 * own - 1);
      mixing[static_cast<std::size_t>(i)] = own | (word() & above);
    }
    for (std::uint64_t& direction : v) {
      std::uint64_t mixed = 0;
      for (int i = 0; i < kDigits; ++i) {
        const auto parity = static_cast<std::uint64_t>(
            std::popcount(direction & mixing[static_cast<std::size_t>(i)]) & 1);
        mixed |= parity << (51 - i);
      }
      direction = mixed;
    }
    shift_[static_cast<std::size_t>(d)] = word() >> (64 - kDigits);
  }
}

void SobolSequence::fill(Index first, Eigen::Ref<PointRows> out) const {
  const Index dimensions = static_cast<Index>(directions_.size());
  require(first >= 0 && first + out.rows() <= (Index{1} << kIndexBits), "rows",
          "a Sobol' sequence is used up to 2^40 points");
  // From one row to the next the trailing bits of the row change, all at once: one exclusive or of
  // what they sum up to.
  std::vector<Directions> steps(directions_);
  std::vector<std::uint64_t> x(shift_);
  for (Index d = 0; d < dimensions; ++d) {
    const auto at = static_cast<std::size_t>(d);
    for (int j = 0; j < kIndexBits; ++j) {
      const auto bit = static_cast<std::size_t>(j);
      if ((first >> j) & 1) x[at] ^= directions_[at][bit];
      if (j > 0) steps[at][bit] ^= steps[at][bit - 1];
    }
  }
  for (Index r = 0; r < out.rows(); ++r) {
    double* row = out.data() + r * out.outerStride();
    for (Index d = 0; d < dimensions; ++d) {
      row[d] = (static_cast<double>(x[static_cast<std::size_t>(d)]) + 0.5) * 0x1.0p-52;
    }
    const auto next = static_cast<std::uint64_t>(first + r + 1);
    const auto bit = static_cast<std::size_t>(std::countr_zero(next));
    if (bit >= kIndexBits) break;
    for (Index d = 0; d < dimensions; ++d) {
      x[static_cast<std::size_t>(d)] ^= steps[static_cast<std::size_t>(d)][bit];
    }
  }
}

}  // namespace ulna
