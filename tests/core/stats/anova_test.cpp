// Against a table worked by hand in fractions, closed forms of the F distribution, and the rate of
// false alarms where there is nothing to find.
#include "stats/anova.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "base/random.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr auto kA = AnovaEffectKind::kFirst;
constexpr auto kB = AnovaEffectKind::kSecond;
constexpr auto kAB = AnovaEffectKind::kInteraction;

// 4 subjects, two sessions (A) of three blocks (B).
Matrix table_by_hand() {
  Matrix y(4, 6);
  y << 3, 5, 7, 2, 3, 4,  //
      4, 4, 9, 3, 5, 6,   //
      2, 6, 5, 1, 2, 4,   //
      5, 7, 8, 4, 3, 7;
  return y;
}

// Grand mean 109/24; means of A 65/12, 11/3; of B 3, 35/8, 25/4; of subjects 4, 31/6, 10/3, 17/3.
// From these, by sums of squared deviations of the margins:
// SS A 147/8 with error 9/8, SS B 511/12 with error 53/12, SS AB 7/4 with error 37/4.
// Epsilon by Box's formula on the covariances of the blocks' means (B) and differences (AB).
TEST(RepeatedAnova, EqualsATableWorkedByHand) {
  const Matrix y = table_by_hand();
  struct Case {
    AnovaEffectKind kind;
    double ss, error, dof, f, epsilon, p_corrected;
  };
  const Case cases[] = {
      {kA, 147.0 / 8, 9.0 / 8, 1, 49.0, 1.0, 0.005986},
      {kB, 511.0 / 12, 53.0 / 12, 2, 1533.0 / 53, 2809.0 / 4466, 0.006164},
      {kAB, 7.0 / 4, 37.0 / 4, 2, 21.0 / 37, 1369.0 / 2642, 0.510327},
  };
  for (const Case& expected : cases) {
    const AnovaEffect effect = repeated_anova(y, 2, 3, expected.kind);
    EXPECT_NEAR(effect.sum_of_squares, expected.ss, 1e-12);
    EXPECT_NEAR(effect.error_sum_of_squares, expected.error, 1e-12);
    EXPECT_EQ(effect.dof, expected.dof);
    EXPECT_EQ(effect.error_dof, 3 * expected.dof);
    EXPECT_NEAR(effect.f, expected.f, 1e-11);
    EXPECT_NEAR(effect.epsilon, expected.epsilon, 1e-13);
    EXPECT_NEAR(effect.p_corrected, expected.p_corrected, 5e-7);  // printed with six digits
    EXPECT_NEAR(effect.partial_eta_squared, expected.ss / (expected.ss + expected.error), 1e-13);
    EXPECT_LE(effect.p, effect.p_corrected + (expected.f < 1.0 ? 1.0 : 0.0));
  }
}

// One factor of two levels is the paired t test: F = t^2.
TEST(RepeatedAnova, OfOneFactorWithTwoLevelsIsThePairedT) {
  const Matrix y = table_by_hand().leftCols(2);
  const Vector d = y.col(1) - y.col(0);
  const double mean = d.mean();
  const double t = mean / std::sqrt((d.array() - mean).square().sum() / 3.0 / 4.0);
  const AnovaEffect effect = repeated_anova(y, 2, 1, kA);
  EXPECT_NEAR(effect.f, t * t, 1e-12);
  EXPECT_EQ(effect.epsilon, 1.0);
  EXPECT_NEAR(student_quantile(1.0 - 0.5 * effect.p, 3.0), std::abs(t), 1e-9);
}

TEST(RepeatedAnova, DoesNotDependOnOriginUnitOrOrder) {
  const Matrix y = table_by_hand();
  Matrix other = (y.array() * 1e3 + 7e4).matrix();
  other.row(0).swap(other.row(2));
  for (const Index shift : {0, 3}) other.col(shift).swap(other.col(shift + 2));  // order of blocks
  for (const auto kind : {kA, kB, kAB}) {
    const AnovaEffect first = repeated_anova(y, 2, 3, kind);
    const AnovaEffect second = repeated_anova(other, 2, 3, kind);
    EXPECT_NEAR(first.f / second.f, 1.0, 1e-9);
    EXPECT_NEAR(first.epsilon, second.epsilon, 1e-9);
    EXPECT_NEAR(first.p_corrected, second.p_corrected, 1e-9);
  }
}

// 12 subjects, 2 x 5 cells, nothing to find. Independent noise keeps 5 % without a correction;
// blocks that drift (a random walk) break sphericity: uncorrected F then alarms too often and the
// corrected one does not. 10000 experiments: a standard error of 0.22 %.
TEST(RepeatedAnova, AlarmsFalselyInFivePercent) {
  constexpr int kExperiments = 10000;
  int independent[3] = {};
  int walk[3] = {};
  int walk_corrected[3] = {};
  Random random(20211115);
  Matrix y(12, 10);
  for (int e = 0; e < kExperiments; ++e) {
    for (Index s = 0; s < 12; ++s) {
      const double subject = 3.0 * random.normal();
      for (Index c = 0; c < 10; ++c) y(s, c) = subject + random.normal();
    }
    int at = 0;
    for (const auto kind : {kA, kB, kAB}) {
      independent[at++] += repeated_anova(y, 2, 5, kind).p < 0.05;
    }
    for (Index c = 1; c < 10; ++c) {
      if (c != 5) y.col(c) = y.col(c - 1).eval() + y.col(c) - y.col(0).mean() * Vector::Ones(12);
    }
    at = 0;
    for (const auto kind : {kA, kB, kAB}) {
      const AnovaEffect effect = repeated_anova(y, 2, 5, kind);
      walk[at] += effect.p < 0.05;
      walk_corrected[at++] += effect.p_corrected < 0.05;
    }
  }
  for (const int count : independent) EXPECT_NEAR(count / double{kExperiments}, 0.05, 0.01);
  EXPECT_GT(walk[2] / double{kExperiments}, 0.07);
  // Greenhouse and Geisser err on the safe side at 12 subjects.
  EXPECT_NEAR(walk_corrected[2] / double{kExperiments}, 0.05, 0.01);
}

TEST(RepeatedAnova, RefusesWhatCannotBeTested) {
  Matrix y = table_by_hand();
  EXPECT_THROW(repeated_anova(y, 3, 3, kA), Error);
  EXPECT_THROW(repeated_anova(y, 1, 6, kA), Error);
  EXPECT_THROW(repeated_anova(y, 6, 0, kA), Error);
  EXPECT_THROW(repeated_anova(y, 6, 1, kB), Error);
  EXPECT_THROW(repeated_anova(y, Index{1} << 62, 4, kA), Error);
  EXPECT_THROW(repeated_anova(y.topRows(1), 2, 3, kA), Error);
  y(2, 4) = kNaN;
  try {
    repeated_anova(y, 2, 3, kB);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kData);
    EXPECT_EQ(error.detail(), "subject 2, column 4");
  }
  // Every subject loses exactly 2: no error variance.
  Matrix same = table_by_hand();
  same.rightCols(3) = same.leftCols(3).array() - 2.0;
  try {
    repeated_anova(same, 2, 3, kA);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kAnalysis);
  }
}

// Two degrees of freedom above: P = (1 + 2 f / m)^(-m/2); one above: Student's t on both sides.
TEST(FTail, EqualsItsClosedForms) {
  for (const double m : {0.5, 3.0, 11.0, 44.0, 24.2}) {
    for (const double f : {1e-6, 0.3, 1.0, 4.84, 30.0}) {
      const double exact = std::pow(1.0 + 2.0 * f / m, -0.5 * m);
      EXPECT_NEAR(f_tail(f, 2.0, m) / exact, 1.0, 1e-12);
    }
    const double t = student_quantile(0.975, m);
    EXPECT_NEAR(f_tail(t * t, 1.0, m), 0.05, 1e-11);
  }
}

TEST(FTail, RefusesWhatIsNoDegreeOfFreedomAndHoldsItsEnds) {
  EXPECT_THROW(f_tail(1.0, 0.0, 3.0), Error);
  EXPECT_THROW(f_tail(1.0, 3.0, -1.0), Error);
  EXPECT_THROW(f_tail(1.0, kNaN, 3.0), Error);
  EXPECT_THROW(f_tail(1.0, 3.0, kInfinity), Error);
  EXPECT_EQ(f_tail(0.0, 2.0, 3.0), 1.0);
  EXPECT_EQ(f_tail(-1.0, 2.0, 3.0), 1.0);
  EXPECT_EQ(f_tail(kInfinity, 2.0, 3.0), 0.0);
  EXPECT_TRUE(std::isnan(f_tail(kNaN, 2.0, 3.0)));
}

}  // namespace
}  // namespace ulna
