// Spectra of signals whose power and relations are known.
#include "signal/spectrum.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

Matrix noise(Index rows, Index columns, std::uint64_t seed) {
  Random random(seed);
  Matrix y(rows, columns);
  for (double& x : y.reshaped()) x = random.normal();
  return y;
}

TEST(Welch, ParsevalForASine) {
  // A sine on a bin: its power A^2/2 is what the density sums to, in three bins of the Hann window.
  Matrix x(4096, 1);
  for (Index i = 0; i < x.rows(); ++i)
    x(i, 0) = 3.0 * std::sin(2 * kPi * 16.0 * static_cast<double>(i) / 256.0);
  const Spectra s = welch(x, 1000.0, 256);
  double power = 0.0;
  for (const auto& m : s.s) power += m(0, 0).real() * 1000.0 / 256.0;
  EXPECT_NEAR(power, 4.5, 1e-12);
  EXPECT_EQ(s.averages, 31);
}

TEST(Welch, NyquistAndOddLengths) {
  const Matrix x = noise(900, 2, 1);
  EXPECT_EQ(welch(x, 100.0, 90).freq_hz.size(), 46);
  EXPECT_EQ(welch(x, 100.0, 91).freq_hz.size(), 46);
  EXPECT_NEAR(welch(x, 100.0, 90).freq_hz(45), 50.0, 1e-12);
  EXPECT_LT(welch(x, 100.0, 91).freq_hz(45), 50.0);
}

TEST(Welch, OverlapCostsAFewAverages) {
  const Spectra s = welch(noise(10000, 1, 2), 1.0, 100);
  // Hann windows half a segment apart correlate by 1/6: n / (1 + 2/36).
  EXPECT_NEAR(s.effective_averages / static_cast<double>(s.averages), 1.0 / (1.0 + 2.0 / 36.0),
              1e-3);
}

TEST(Welch, RangesAreNotBridged) {
  const Matrix x = noise(500, 1, 3);
  EXPECT_EQ(welch(x, 1.0, 100, {{0, 199}, {250, 350}}).averages, 3);
  EXPECT_THROW(welch(x, 1.0, 100, {{0, 99}, {100, 199}}), Error);
  EXPECT_THROW(welch(x, 1.0, 100, {{0, 501}}), Error);
  EXPECT_THROW(welch(x, 1.0, 100, {{-1, 200}}), Error);
}

TEST(Welch, Cancels) {
  Token token;
  token.cancel();
  EXPECT_THROW(welch(noise(500, 1, 4), 1.0, 100, {}, &token), Error);
}

TEST(Coherence, SumOfInputsIsFullyCoherent) {
  Matrix x(5000, 3);
  x.leftCols(2) = noise(5000, 2, 5);
  x.col(2) = 2.0 * x.col(0) - 3.0 * x.col(1);
  const Spectra s = welch(x, 1000.0, 200);
  const Coherence c = multiple_coherence(s, {0, 1}, {2});
  EXPECT_LT((c.raw.array() - 1.0).abs().maxCoeff(), 1e-12);
  const FrequencyResponse h = frequency_response(s, {0, 1}, {2});
  for (std::size_t f = 0; f < h.h.size(); ++f) {
    EXPECT_LT(std::abs(h.h[f](0, 0) - 2.0) + std::abs(h.h[f](0, 1) + 3.0), 1e-12);
    EXPECT_LT(h.radius[f].maxCoeff(), 1e-5);  // square root of a residual of rounding size
  }
  // Each input alone explains its share of 4 : 9.
  EXPECT_NEAR(multiple_coherence(s, {0}, {2}).corrected.mean(), 4.0 / 13.0, 0.05);
}

TEST(Coherence, DependentInputsAreRefused) {
  Matrix x(3000, 3);
  x.leftCols(2) = noise(3000, 2, 6);
  x.col(1) = 2.0 * x.col(0);
  x.col(2) = noise(3000, 1, 7);
  const Spectra s = welch(x, 1000.0, 200);
  EXPECT_THROW(multiple_coherence(s, {0, 1}, {2}), Error);
  EXPECT_THROW(multiple_coherence(s, {}, {2}), Error);
  EXPECT_THROW(multiple_coherence(s, {0, 3}, {2}), Error);
}

// The circle holds the truth as often as it says: 300 records, one frequency each, 95 +- 1.3 %.
TEST(FrequencyResponse, ConfidenceRegionCovers) {
  int inside = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    Matrix x = noise(1000, 2, 100 + seed);
    x.col(1) = 0.7 * x.col(0) + 0.5 * x.col(1);
    const FrequencyResponse h = frequency_response(welch(x, 1000.0, 100), {0}, {1});
    inside += std::abs(h.h[20](0, 0) - 0.7) < h.radius[20](0, 0) ? 1 : 0;
  }
  EXPECT_GE(inside, 270);  // 90 %: four standard errors
  EXPECT_LE(inside, 299);
}

}  // namespace
}  // namespace ulna
