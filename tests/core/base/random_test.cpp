// Philox4x32-10 against the vectors published with Random123 (file kat_vectors), and the
// distributions built on it.
#include "base/random.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <vector>

namespace ulna {
namespace {

using Block = std::array<std::uint32_t, 4>;

// Written from the paper (Salmon et al. 2011, section 3.3), with the bumped key kept per round: the
// reference for counters and keys that the published vectors do not reach through `Random`.
Block reference_philox(Block c, std::array<std::uint32_t, 2> key) {
  for (std::uint32_t round = 0; round < 10; ++round) {
    const std::uint32_t k0 = key[0] + round * 0x9E3779B9u;
    const std::uint32_t k1 = key[1] + round * 0xBB67AE85u;
    const auto high = [](std::uint32_t a, std::uint32_t b) {
      return static_cast<std::uint32_t>((static_cast<std::uint64_t>(a) * b) >> 32);
    };
    c = {high(0xCD9E8D57u, c[2]) ^ c[1] ^ k0, 0xCD9E8D57u * c[2],
         high(0xD2511F53u, c[0]) ^ c[3] ^ k1, 0xD2511F53u * c[0]};
  }
  return c;
}

TEST(Random, TheReferenceGivesThePublishedVectors) {
  EXPECT_EQ(reference_philox({0, 0, 0, 0}, {0, 0}),
            (Block{0x6627e8d5u, 0xe169c58du, 0xbc57ac4cu, 0x9b00dbd8u}));
  const std::uint32_t ones = 0xffffffffu;
  EXPECT_EQ(reference_philox({ones, ones, ones, ones}, {ones, ones}),
            (Block{0x408f276du, 0x41c83b0eu, 0xa20bc7c6u, 0x6d5451fdu}));
  EXPECT_EQ(reference_philox({0x243f6a88u, 0x85a308d3u, 0x13198a2eu, 0x03707344u},
                             {0xa4093822u, 0x299f31d0u}),
            (Block{0xd16cfe09u, 0x94fdccebu, 0x5001e420u, 0x24126ea1u}));
}

TEST(Random, TheZeroVectorIsTheFirstBlockOfSeedZero) {
  Random random(0, 0);
  for (const std::uint32_t word : {0x6627e8d5u, 0xe169c58du, 0xbc57ac4cu, 0x9b00dbd8u}) {
    EXPECT_EQ(random.bits(), word);
  }
}

TEST(Random, SeedIsTheKeyAndStreamTheUpperCounter) {
  for (const std::uint64_t seed : {0ull, 1ull, 0x299f31d0a4093822ull, ~0ull}) {
    for (const std::uint64_t stream : {0ull, 7ull, 0x0370734413198a2eull, ~0ull}) {
      Random random(seed, stream);
      for (std::uint32_t counter = 0; counter < 5; ++counter) {
        const Block expected = reference_philox(
            {counter, 0, static_cast<std::uint32_t>(stream),
             static_cast<std::uint32_t>(stream >> 32)},
            {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)});
        for (const std::uint32_t word : expected) EXPECT_EQ(random.bits(), word);
      }
    }
  }
}

TEST(Random, UniformIsUniform) {
  Random random(11);
  constexpr int kCells = 64;
  constexpr int kDraws = 640000;
  std::array<int, kCells> cells{};
  double sum = 0.0;
  double lagged = 0.0;
  double previous = 0.5;
  for (int i = 0; i < kDraws; ++i) {
    const double u = random.uniform();
    ASSERT_GT(u, 0.0);
    ASSERT_LT(u, 1.0);
    ++cells[static_cast<std::size_t>(u * kCells)];
    sum += u;
    lagged += (u - 0.5) * (previous - 0.5);
    previous = u;
  }
  double chi_square = 0.0;
  for (const int count : cells) {
    chi_square += std::pow(count - kDraws / kCells, 2) / (kDraws / kCells);
  }
  // 63 degrees of freedom: 5 standard deviations of 11.2 about 63. The seed is fixed.
  EXPECT_GT(chi_square, 20.0);
  EXPECT_LT(chi_square, 119.0);
  // Five standard errors: sqrt(1/12 / N), and 1/12 / sqrt(N) for neighbours.
  EXPECT_NEAR(sum / kDraws, 0.5, 5.0 * std::sqrt(1.0 / 12.0 / kDraws));
  EXPECT_NEAR(lagged / kDraws, 0.0, 5.0 / 12.0 / std::sqrt(kDraws));
}

TEST(Random, NormalHasItsMomentsAndTails) {
  Random random(12);
  constexpr int kDraws = 400000;
  double m1 = 0.0, m2 = 0.0, m3 = 0.0, m4 = 0.0;
  int beyond = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double z = random.normal();
    ASSERT_TRUE(std::isfinite(z));
    m1 += z;
    m2 += z * z;
    m3 += z * z * z;
    m4 += z * z * z * z;
    if (std::abs(z) > 1.959963984540054) ++beyond;
  }
  // Five standard errors: the variances of z, z^2, z^3, z^4 are 1, 2, 15, 96.
  const double root = std::sqrt(static_cast<double>(kDraws));
  EXPECT_NEAR(m1 / kDraws, 0.0, 5.0 / root);
  EXPECT_NEAR(m2 / kDraws, 1.0, 5.0 * std::sqrt(2.0) / root);
  EXPECT_NEAR(m3 / kDraws, 0.0, 5.0 * std::sqrt(15.0) / root);
  EXPECT_NEAR(m4 / kDraws, 3.0, 5.0 * std::sqrt(96.0) / root);
  EXPECT_NEAR(beyond / static_cast<double>(kDraws), 0.05, 5.0 * std::sqrt(0.05 * 0.95) / root);
}

TEST(Random, BelowReachesEveryValueAndNoMore) {
  Random random(13);
  std::set<std::int64_t> seen;
  for (int i = 0; i < 2000; ++i) {
    const std::int64_t value = random.below(17);
    ASSERT_GE(value, 0);
    ASSERT_LT(value, 17);
    seen.insert(value);
  }
  EXPECT_EQ(seen.size(), 17u);
  EXPECT_EQ(random.below(1), 0);
}

TEST(Random, StreamsAndSeedsDiffer) {
  std::set<std::uint32_t> first;
  for (std::uint64_t k = 0; k < 100; ++k) {
    first.insert(Random(0, k).bits());
    first.insert(Random(k + 1, 0).bits());
  }
  EXPECT_EQ(first.size(), 200u);  // 200 of 2^32: a collision has a chance of 5e-6
}

}  // namespace
}  // namespace ulna
