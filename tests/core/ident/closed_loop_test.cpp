// Whose motion is it, do two estimates differ, does the force lag: each with a known answer.
#include "ident/closed_loop.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "base/random.hpp"
#include "made.hpp"

namespace ulna {
namespace {

constexpr double kRate = 100.0;

// One axis: the motion is the reference plus `human` times an independent motion of equal power.
// The force is that of m, b, k = 2, 5, 40, `lag_rows` late; everything exact, from sines.
Prepared moved(double human, double lag_s, Index rows = 6000) {
  Random random(3);
  Matrix table = Matrix::Zero(rows, 7);
  for (int source = 0; source < 2; ++source) {
    const double size = source == 0 ? 1.0 : human;
    for (int line = 1; line <= 60; ++line) {
      const double omega = 2.0 * kPi * 0.05 * (line + 0.5 * source);
      const double phase = 2.0 * kPi * random.uniform();
      for (Index i = 0; i < rows; ++i) {
        const double now = omega * static_cast<double>(i) / kRate + phase;
        const double then = now - omega * lag_s;
        table(i, 0) += size * std::sin(now);
        table(i, 1) += size * omega * std::cos(now);
        table(i, 2) -= size * omega * omega * std::sin(now);
        table(i, 3) -=
            size * ((40.0 - 2.0 * omega * omega) * std::sin(then) + 5.0 * omega * std::cos(then));
        if (source == 0) {
          table(i, 4) += std::sin(now);
          table(i, 5) += omega * std::cos(now);
          table(i, 6) -= omega * omega * std::sin(now);
        }
      }
    }
  }
  Prepared out;
  out.roles.position = {0};
  out.roles.force = {1};
  out.roles.reference = {2};
  out.report.rate_hz = kRate;
  out.report.lowpass_hz = 5.0;
  out.trials.emplace_back(0, 1, 1, std::move(table));
  return out;
}

TEST(MotionShare, IsThePowerThatTheReferenceDoesNotExplain) {
  for (const double human : {0.0, 0.3, 1.0}) {
    const MotionShare share = motion_share(moved(human, 0.0), 3.0);
    ASSERT_EQ(share.total.size(), 1);
    // Neighbouring lines 0.025 Hz apart in segments of 8 s: leakage and a handful of averages leave
    // about 0.1.
    EXPECT_NEAR(share.total[0], human * human / (1.0 + human * human), 0.12) << human;
    EXPECT_GE(share.share.minCoeff(), 0.0);
    EXPECT_LE(share.share.maxCoeff(), 1.0);
  }
}

TEST(MotionShare, IsEmptyWithoutAReferenceOrWithTooLittle) {
  EXPECT_EQ(motion_share(made_prepared({2000}, 1, 0, 1), 3.0).freq_hz.size(), 0);
  EXPECT_EQ(motion_share(moved(0.3, 0.0, 40), 3.0).freq_hz.size(), 0);
}

// The statistic by hand: d' C^-1 d with C the covariance of the difference.
TEST(DifferenceTest, IsAWaldTestWithTheCovarianceOfBoth) {
  Fit iv, ls;
  iv.theta = Matrix{{1.0}, {2.0}};
  ls.theta = Matrix{{1.5}, {1.0}};
  const Matrix joint{{0.10, 0.01, 0.02, 0.00},
                     {0.01, 0.20, 0.00, 0.05},
                     {0.02, 0.00, 0.05, 0.01},
                     {0.00, 0.05, 0.01, 0.10}};
  const DifferenceTest test = difference_test(iv, ls, joint);
  // C = [0.10 + 0.05 - 0.04, 0.02; 0.02, 0.20 + 0.10 - 0.10], d = (0.5, -1).
  const Eigen::Matrix2d c{{0.11, 0.02}, {0.02, 0.20}};
  const Eigen::Vector2d d{0.5, -1.0};
  EXPECT_NEAR(test.statistic, d.dot(c.inverse() * d), 1e-8);  // a floor of 1e-6 of a parameter
  EXPECT_EQ(test.degrees, 2.0);
  EXPECT_NEAR(test.p_value, std::exp(-0.5 * test.statistic), 1e-9);  // chi-square of two degrees
  EXPECT_NEAR(test.standard_error[1], std::sqrt(0.20), 1e-9);
}

TEST(DifferenceTest, EqualEstimatesDoNotDiffer) {
  Fit fit;
  fit.theta = Matrix{{1.0}, {2.0}};
  const DifferenceTest test = difference_test(fit, fit, Matrix::Zero(4, 4));
  EXPECT_EQ(test.statistic, 0.0);
  EXPECT_EQ(test.p_value, 1.0);
}

TEST(CheckLag, FindsALateForceByEitherEstimator) {
  for (const double lag : {-0.01, 0.0, 0.01}) {
    const Prepared prepared = moved(0.0, lag);
    const std::vector<Span> all = {{0, 0, prepared.trials[0].rows()}};
    for (const Estimator estimator : {Estimator::kLeastSquares, Estimator::kInstrumental}) {
      const LagCheck check = check_lag(prepared, all, estimator, 0.4);
      ASSERT_TRUE(check.available);
      // First order in the lag: at 3 Hz and 10 ms the next order is (0.19)^2 / 2 of it.
      EXPECT_NEAR(check.lag_s, lag, 0.05 * std::abs(lag) + 1e-6) << lag;
    }
  }
}

TEST(CheckLag, IsNotAvailableWithTooFewRows) {
  const Prepared prepared = moved(0.0, 0.0, 30);
  EXPECT_FALSE(check_lag(prepared, {{0, 0, 30}}, Estimator::kLeastSquares, 0.4).available);
}

TEST(NeweyWest, ThreadsDoNotChangeABit) {
  const Prepared prepared = made_prepared({700, 500, 900}, 2, 2, 8);
  const std::vector<Span> spans = {{0, 0, 700}, {1, 0, 500}, {2, 0, 900}};
  const Design design(prepared, 0.0, spans);
  const Index size = design.regressors() * design.axes();
  const Fit fit =
      solve(factorise(design, spans), Matrix::Identity(size, size), Estimator::kInstrumental);
  const Matrix one = newey_west(design, spans, {&fit}, 20, 1, nullptr, 1);
  const Matrix four = newey_west(design, spans, {&fit}, 20, 1, nullptr, 4);
  EXPECT_TRUE((one.array() == four.array()).all());
}

}  // namespace
}  // namespace ulna
