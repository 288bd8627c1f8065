// The parts that reflex estimates are made of: causal elements, search in a box, score tests.
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"
#include "impedance/causal_element.hpp"
#include "impedance/profile.hpp"
#include "impedance/ridge.hpp"
#include "impedance/scores.hpp"
#include "impedance/separable.hpp"

namespace ulna {
namespace {

TEST(CausalElement, StepResponsesAreTheClosedForms) {
  const double h = 1e-3;
  const Vector ones = Vector::Ones(600);
  const double w = 25.0;
  const Matrix first = element_response({1, w, 1.0}, ones, h);
  for (const double z : {0.4, 1.0, 2.5}) {
    const Matrix second = element_response({2, w, z}, ones, h);
    for (Index i = 0; i < 600; i += 37) {
      const double t = static_cast<double>(i) * h;
      double expected = 0.0;
      if (z < 1.0) {
        const double d = w * std::sqrt(1.0 - z * z);
        expected = 1.0 - std::exp(-z * w * t) * (std::cos(d * t) + z * w / d * std::sin(d * t));
      } else if (z > 1.0) {
        const double a = w * (z - std::sqrt(z * z - 1.0));
        const double b = w * (z + std::sqrt(z * z - 1.0));
        expected = 1.0 - (b * std::exp(-a * t) - a * std::exp(-b * t)) / (b - a);
      } else {
        expected = 1.0 - std::exp(-w * t) * (1.0 + w * t);
      }
      // A constant is a cubic: exact but for the exponential's series.
      EXPECT_NEAR(second(i, 0), expected, 1e-12) << z << " " << t;
      EXPECT_NEAR(first(i, 0), 1.0 - std::exp(-w * t), 1e-12);
      EXPECT_NEAR(first(i, 1), w * std::exp(-w * t), 1e-10);
    }
  }
}

TEST(CausalElement, AToneIsScaledAndTurned) {
  const double h = 1e-3;
  const double f = 2.0 * kPi * 40.0;
  Vector u(4000);
  for (Index i = 0; i < u.size(); ++i) u[i] = std::sin(f * static_cast<double>(i) * h);
  const double w = 60.0;
  const double z = 0.7;
  const Matrix out = element_response({2, w, z}, u, h);
  const double re = w * w - f * f;
  const double im = 2.0 * z * w * f;
  const double gain = w * w / std::hypot(re, im);
  const double phase = -std::atan2(im, re);
  for (Index i = 2000; i < 3990; i += 101) {
    const double angle = f * static_cast<double>(i) * h + phase;
    // (2 pi f h)^4 is 4e-3 at 40 Hz; the cubic's own constant is below a fiftieth of it.
    EXPECT_NEAR(out(i, 0), gain * std::sin(angle), 1e-4 * gain);
    EXPECT_NEAR(out(i, 1), gain * f * std::cos(angle), 1e-4 * gain * f);
  }
}

TEST(CausalElement, FreeMotionIsWhatTheStepLeavesBehind) {
  const double h = 1e-3;
  const CausalElement e{2, 30.0, 0.6};
  Vector u = Vector::Zero(500);
  u.head(200).setOnes();
  const Matrix whole = element_response(e, u, h);
  const Matrix from_value = element_free(e, 280, h, 0);
  const Matrix from_rate = element_free(e, 280, h, 1);
  // After the input's last cubic (two rows) only the state counts: (w, w' / omega).
  for (Index i = 0; i < 280; i += 31) {
    const double expected =
        whole(210, 0) * from_value(i, 0) + whole(210, 1) / 30.0 * from_rate(i, 0);
    EXPECT_NEAR(whole(210 + i, 0), expected, 1e-12);
  }
}

TEST(CausalElement, ADelayBetweenSamplesIsRead) {
  const double h = 1e-3;
  Matrix table(200, 2);
  const double f = 2.0 * kPi * 20.0;
  for (Index i = 0; i < 200; ++i) {
    table(i, 0) = std::sin(f * static_cast<double>(i) * h);
    table(i, 1) = f * std::cos(f * static_cast<double>(i) * h);
  }
  for (const double place : {3.0, 17.25, 99.9}) {
    EXPECT_NEAR(delayed_value(table, h, place), std::sin(f * place * h), 1e-6);
  }
  EXPECT_EQ(delayed_value(table, h, -0.5), 0.0);
}

TEST(CausalElement, RefusesWhatIsNone) {
  const Vector u = Vector::Ones(10);
  EXPECT_THROW(element_response({3, 1.0, 1.0}, u, 0.1), Error);
  EXPECT_THROW(element_response({2, -1.0, 1.0}, u, 0.1), Error);
  EXPECT_THROW(element_response({2, 1.0, 0.0}, u, 0.1), Error);
}

TEST(Separable, FindsTheMinimumInsideAndAtTheBorder) {
  BoxProblem problem;
  problem.low = Vector::Constant(2, -2.0);
  problem.high = Vector::Constant(2, 2.0);
  problem.scale = Vector::Constant(2, 0.1);
  problem.residual = [](const Vector& x) {  // Rosenbrock's valley
    return Vector((Vector(2) << 10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]).finished());
  };
  const Vector start = (Vector(2) << -1.2, 1.0).finished();
  const BoxSolution inside = minimise_in_box(problem, start, Effort::kFine, 200);
  EXPECT_TRUE(inside.converged);
  EXPECT_NEAR(inside.parameters[0], 1.0, 1e-6);
  EXPECT_NEAR(inside.parameters[1], 1.0, 1e-6);
  problem.high[0] = 0.5;
  const BoxSolution border = minimise_in_box(problem, start, Effort::kFine, 200);
  EXPECT_DOUBLE_EQ(border.parameters[0], 0.5);
  EXPECT_NEAR(border.parameters[1], 0.25, 1e-6);
  problem.low[1] = problem.high[1] = 0.3;  // held
  const BoxSolution held = minimise_in_box(problem, start, Effort::kCoarse, 200);
  EXPECT_DOUBLE_EQ(held.parameters[1], 0.3);
}

TEST(Scores, BartlettSumIsTheWeightedSumOverLags) {
  Random random(5);
  Matrix scores(60, 2);
  for (Index i = 0; i < scores.size(); ++i) scores.data()[i] = random.normal();
  Runs runs;
  runs.add(25);
  runs.add(35);
  const Index lag = 6;
  Matrix expected = Matrix::Zero(2, 2);
  for (Index i = 0; i < 60; ++i) {
    for (Index j = 0; j < 60; ++j) {
      const bool same = (i < 25) == (j < 25);
      const double weight =
          1.0 - static_cast<double>(std::abs(i - j)) / static_cast<double>(lag + 1);
      if (same && weight > 0.0) {
        expected += weight * scores.row(i).transpose() * scores.row(j);
      }
    }
  }
  EXPECT_LT((bartlett_sum(scores, runs, lag) - expected).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Scores, PValuesAreUniformWithoutAnEffectAndSmallWithOne) {
  Index low = 0;
  constexpr Index kRuns = 200;
  for (Index run = 0; run < kRuns; ++run) {
    Random random(11, static_cast<std::uint64_t>(run));
    std::vector<Matrix> sets;
    for (int set = 0; set < 3; ++set) {
      Matrix sums(20, 2);
      for (Index i = 0; i < sums.size(); ++i) sums.data()[i] = random.normal();
      sets.push_back(sums);
    }
    if (score_test(sets, 199, 1).p_value <= 0.1) ++low;
    if (run == 0) {
      sets[2].col(0).array() += 3.0;
      const ScoreTest strong = score_test(sets, 999, 1);
      EXPECT_EQ(strong.best, 2);
      EXPECT_DOUBLE_EQ(strong.p_value, 1e-3);
    }
  }
  // Binomial(200, 0.1): 20 with a deviation of 4.2.
  EXPECT_GT(low, 7);
  EXPECT_LT(low, 34);
  EXPECT_TRUE(std::isnan(score_test({Matrix::Ones(5, 1)}, 199, 1).p_value));
}

TEST(Profile, TheRangeHoldsEveryMinimumThatIsNotWorse) {
  const Vector at = Vector::LinSpaced(9, 0.0, 8.0);
  Vector distance(9);
  distance << 6, 4, 2, 0, 2, 4, 3, 1, 5;  // a second minimum at 7
  const Eigen::Vector2d one = likely_range(at, distance, 0.5);
  EXPECT_DOUBLE_EQ(one[0], 2.75);
  EXPECT_DOUBLE_EQ(one[1], 3.25);
  const Eigen::Vector2d both = likely_range(at, distance, 3.0);
  EXPECT_DOUBLE_EQ(both[0], 1.5);
  EXPECT_DOUBLE_EQ(both[1], 7.5);
  const Eigen::Vector2d open = likely_range(at, distance, 10.0);
  EXPECT_DOUBLE_EQ(open[0], 0.0);
  EXPECT_DOUBLE_EQ(open[1], 8.0);
}

TEST(Ridge, PenaltyGrowsWithNoiseAndKeepsWhatIsExact) {
  Random random(3);
  constexpr Index kRows = 400;
  constexpr Index kLags = 30;
  // A slow input: neighbouring lags are nearly copies.
  Vector u(kRows + kLags);
  double state = 0.0;
  for (Index i = 0; i < u.size(); ++i) u[i] = state = 0.9 * state + random.normal();
  Matrix columns(kRows, kLags);
  for (Index k = 0; k < kLags; ++k) columns.col(k) = u.segment(kLags - k, kRows);
  Vector h(kLags);
  for (Index k = 0; k < kLags; ++k) {
    const double t = static_cast<double>(k) / 6.0;
    h[k] = t * std::exp(-t);
  }
  const Vector clean = columns * h;
  Vector noisy = clean;
  for (Index i = 0; i < kRows; ++i) noisy[i] += 3.0 * random.normal();
  const Ridge exact = ridge_fit(columns, clean, roughness(kLags), nullptr);
  const Ridge smooth = ridge_fit(columns, noisy, roughness(kLags), nullptr);
  const Vector free = columns.householderQr().solve(noisy);
  EXPECT_LT((exact.theta - h).norm(), 1e-3 * h.norm());
  EXPECT_GT(smooth.penalty, exact.penalty);
  EXPECT_LT(smooth.rank, 0.5 * kLags);
  EXPECT_NEAR(exact.rank, kLags, 1.0);
  // A base that is large holds the response down, whatever the penalty.
  const Ridge held =
      ridge_fit(columns, clean, roughness(kLags), nullptr, 1e9 * ridge_shape(columns));
  EXPECT_LT(held.theta.norm(), 1e-6 * h.norm());
  EXPECT_LT((smooth.theta - h).norm(), 0.5 * (free - h).norm());
}

}  // namespace
}  // namespace ulna
