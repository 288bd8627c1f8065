// Paired comparisons: values by hand, coverage of the intervals, and what is refused.
#include "study/paired.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

IntervalSpec paired_spec(Index resamples) {
  IntervalSpec spec;
  spec.kind = IntervalKind::kBca;
  spec.level = 0.95;
  spec.resamples = resamples;
  spec.threads = 1;
  return spec;
}

TEST(PairedEstimates, EqualTheirFormulas) {
  Matrix first(4, 2);
  first << 10, 1, 12, 2, 8, 3, 10, 2;
  Matrix second(4, 2);
  second << 8, 2, 9, 2, 7, 4, 6, 4;  // differences -2 -3 -1 -4 and 1 0 1 2
  const PairedEstimates out = paired_estimates(first, second, paired_spec(200));
  EXPECT_DOUBLE_EQ(out.difference.value[0], -2.5);
  EXPECT_DOUBLE_EQ(out.difference.value[1], 1.0);
  EXPECT_DOUBLE_EQ(out.relative.value[0], -0.25);
  EXPECT_DOUBLE_EQ(out.relative.value[1], 0.5);
  EXPECT_NEAR(out.standardised.value[0], -2.5 / std::sqrt(5.0 / 3.0), 1e-14);
  EXPECT_NEAR(out.standardised.value[1], 1.0 / std::sqrt(2.0 / 3.0), 1e-14);
  EXPECT_LT(out.difference.low[0], -2.5);
  EXPECT_GT(out.difference.high[0], -2.5);
}

// A small spread about a large change, both far from zero: the squares must not cancel.
TEST(PairedEstimates, KeepTheirDigitsFarFromZero) {
  Matrix first(4, 1);
  Matrix second(4, 1);
  first << 1e6, 1e6, 1e6, 1e6;
  second << 2e6 + 1, 2e6 - 1, 2e6 + 1, 2e6 - 1;
  const PairedEstimates out = paired_estimates(first, second, paired_spec(100));
  EXPECT_NEAR(out.standardised.value[0] / (1e6 / std::sqrt(4.0 / 3.0)), 1.0, 1e-12);
}

// 12 subjects: a bootstrap is known to be somewhat narrow there. 95 % intervals of 400 experiments
// have a standard error of 1.1 %.
TEST(PairedEstimates, CoverTheTruth) {
  constexpr int kExperiments = 400;
  Random random(7);
  int covered = 0;
  Matrix first(12, 1);
  Matrix second(12, 1);
  for (int e = 0; e < kExperiments; ++e) {
    for (Index s = 0; s < 12; ++s) {
      first(s, 0) = 20.0 + 4.0 * random.normal();
      second(s, 0) = first(s, 0) - 5.0 + 2.0 * random.normal();
    }
    IntervalSpec spec = paired_spec(500);
    spec.seed = static_cast<std::uint64_t>(e);
    const PairedEstimates out = paired_estimates(first, second, spec);
    covered += out.difference.low[0] <= -5.0 && -5.0 <= out.difference.high[0];
  }
  EXPECT_GT(covered, 0.88 * kExperiments);
  EXPECT_LT(covered, 0.98 * kExperiments);
}

TEST(PairedEstimates, AreTheSameWhateverTheThreads) {
  Random random(3);
  Matrix first(9, 3);
  Matrix second(9, 3);
  for (Index i = 0; i < first.size(); ++i) first(i) = 5.0 + random.normal();
  for (Index i = 0; i < second.size(); ++i) second(i) = 5.0 + random.normal();
  IntervalSpec spec = paired_spec(300);
  const PairedEstimates one = paired_estimates(first, second, spec);
  spec.threads = 2;
  const PairedEstimates two = paired_estimates(first, second, spec);
  EXPECT_EQ(one.relative.low, two.relative.low);
  EXPECT_EQ(one.standardised.high, two.standardised.high);
}

TEST(PairedEstimates, SubjectsThatAllChangeAlikeHaveNoStandardisedEffect) {
  const Matrix first = Matrix::Constant(5, 1, 3.0);
  const Matrix second = Matrix::Constant(5, 1, 2.0);
  const PairedEstimates out = paired_estimates(first, second, paired_spec(100));
  EXPECT_EQ(out.difference.value[0], -1.0);
  EXPECT_TRUE(std::isnan(out.standardised.value[0]));
  EXPECT_EQ(out.difference.low[0], -1.0);
}

TEST(PairedEstimates, RefuseWhatIsNotPaired) {
  const Matrix y = Matrix::Ones(5, 2);
  EXPECT_THROW(paired_estimates(y, Matrix::Ones(4, 2), paired_spec(100)), Error);
  EXPECT_THROW(paired_estimates(y, Matrix::Ones(5, 1), paired_spec(100)), Error);
  EXPECT_THROW(paired_estimates(y.topRows(2), y.topRows(2), paired_spec(100)), Error);
  EXPECT_THROW(paired_estimates(y, y, paired_spec(10)), Error);
  IntervalSpec replicates = paired_spec(100);
  replicates.kind = IntervalKind::kReplicates;
  EXPECT_THROW(paired_estimates(y, y, replicates), Error);
  Matrix hole = y;
  hole(3, 1) = kNaN;
  try {
    paired_estimates(y, hole, paired_spec(100));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.argument(), "second");
    EXPECT_EQ(error.detail(), "subject 3, measure 1");
  }
}

}  // namespace
}  // namespace ulna
