// Transfer functions from sampled signals: exact recovery, invariants, safeguards, refused input.
#include "ident/srivc.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "base/error.hpp"
#include "base/random.hpp"
#include "ident/order_search.hpp"
#include "ident/rational_simulate.hpp"
#include "refusal.hpp"

namespace ulna {
namespace {

using made::refusal_of;

// Held random levels, as a computer commands them.
Matrix levels(Index rows, Index hold, std::uint64_t seed, Index columns = 1) {
  Matrix u(rows, columns);
  for (Index c = 0; c < columns; ++c) {
    Random random(seed, static_cast<std::uint64_t>(c));
    double value = 0.0;
    for (Index k = 0; k < rows; ++k) {
      if (k % hold == 0) value = random.normal();
      u(k, c) = value;
    }
  }
  return u;
}

Rational mass_spring() {  // 1 / (s^2 + 2 s + 25), lightly damped
  return {Eigen::Vector2d(25.0, 2.0), {Vector::Constant(1, 25.0)}};
}

RationalOptions options_for(const Rational& model, double delay_s = 0.0) {
  RationalOptions o;
  o.setup.orders.poles = model.a.size();
  for (const Vector& b : model.b) {
    o.setup.orders.zeros.push_back(b.size() - 1);
    o.setup.orders.delay_s.push_back(delay_s);
  }
  return o;
}

Vector noisy(const Vector& y, double sd, std::uint64_t seed) {
  Random random(seed, 77);
  Vector out = y;
  for (double& v : out) v += sd * random.normal();
  return out;
}

TEST(Rational, RootsAndPolynomialsAreInverse) {
  Eigen::VectorXcd roots(4);
  roots << std::complex<double>(-0.25, -1.98), std::complex<double>(-0.25, 1.98),
      std::complex<double>(-2.25, -19.9), std::complex<double>(-2.25, 19.9);
  Vector c(5);
  c << monic_polynomial(roots), 1.0;
  const Eigen::VectorXcd found = polynomial_roots(c);
  EXPECT_LT((found - roots).norm(), 1e-12 * roots.norm());
}

TEST(Rational, OnlyRootsOfTheRightHalfPlaneAreMirrored) {
  Vector a(3);
  a << 0.0, -2.0, 1.0;  // s (s + 2)(s - 1)
  EXPECT_TRUE(reflect_poles(a));
  EXPECT_NEAR(a[0], 0.0, 1e-14);
  EXPECT_NEAR(a[1], 2.0, 1e-12);  // s (s + 2)(s + 1)
  EXPECT_NEAR(a[2], 3.0, 1e-12);
  EXPECT_FALSE(reflect_poles(a));
  Vector oscillator = Eigen::Vector2d(4.0, 0.0);  // on the axis
  EXPECT_FALSE(reflect_poles(oscillator));
}

TEST(Hold, DelayedStepsAreExact) {
  // x' = -x + u(t - 0.3 s) at 1 Hz: a unit step at t = 0 reaches x = 1 - exp(-(t - 0.3)).
  const Rational lag{Vector::Constant(1, 1.0), {Vector::Constant(1, 1.0)}};
  const Matrix u = Matrix::Ones(6, 1);
  for (const double delay : {0.0, 0.3, 1.0, 2.7}) {
    const Vector y = simulate_rational(lag, {delay}, Hold::kZero, u, 1.0);
    for (Index k = 0; k < y.size(); ++k) {
      const double t = static_cast<double>(k) - delay;
      EXPECT_NEAR(y[k], t > 0.0 ? 1.0 - std::exp(-t) : 0.0, 1e-14) << delay << " " << k;
    }
  }
}

TEST(Hold, DelayedRampsAreExact) {
  // u(t) = t, linear between samples and zero before: x = (t - d) - 1 + exp(-(t - d)).
  const Rational lag{Vector::Constant(1, 1.0), {Vector::Constant(1, 1.0)}};
  const Matrix u = Vector::LinSpaced(8, 0.0, 7.0);
  for (const double delay : {0.0, 0.4, 2.0, 3.1}) {
    const Vector y = simulate_rational(lag, {delay}, Hold::kLinear, u, 1.0);
    for (Index k = 0; k < y.size(); ++k) {
      const double t = std::max(0.0, static_cast<double>(k) - delay);
      EXPECT_NEAR(y[k], t - 1.0 + std::exp(-t), 1e-13) << delay << " " << k;
    }
  }
}

TEST(Srivc, RecoversWithoutNoiseFromAnyStateOverAnyOffset) {
  const Rational truth = mass_spring();
  const Matrix u = levels(3000, 20, 1);
  for (const double delay : {0.0, 0.03, 0.0137}) {
    const Vector y = simulate_rational(truth, {delay}, Hold::kZero, u, 100.0);
    RationalOptions o = options_for(truth, delay);
    // Rows from 500 on: the system is in motion there.
    const RationalFit fit =
        identify_rational(u.bottomRows(2500), y.tail(2500).array() + 7.0, 100.0, {}, o);
    EXPECT_EQ(fit.outcome, FitOutcome::kGood);
    // Rounding of sums over 2500 rows and of the offset.
    EXPECT_LT((fit.theta - Eigen::Vector3d(25.0, 2.0, 25.0)).norm(), 1e-9) << delay;
    EXPECT_NEAR(fit.nuisance(0, 2), 7.0, 1e-10);
    EXPECT_GT(fit.vaf, 99.9999999);
  }
}

TEST(Srivc, StiffAndLargeOrdersKeepTheirDigits) {
  // Poles -1 and -1000 at 10 kHz, and eight poles from 2 to 40 rad/s.
  const Rational stiff{Eigen::Vector2d(1000.0, 1001.0), {Eigen::Vector2d(1000.0, 300.0)}};
  const Matrix u = levels(40000, 100, 2);
  const Vector y = simulate_rational(stiff, {0.0}, Hold::kZero, u, 10000.0);
  const RationalFit fit = identify_rational(u, y, 10000.0, {}, options_for(stiff));
  EXPECT_LT(
      (fit.theta.array() / Eigen::Array4d(1000.0, 1001.0, 1000.0, 300.0) - 1.0).abs().maxCoeff(),
      1e-8);

  Eigen::VectorXcd roots(8);
  for (Index k = 0; k < 4; ++k) {
    const double w = 2.0 * std::pow(2.7, static_cast<double>(k));
    roots[2 * k] = {-0.2 * w, w};
    roots[2 * k + 1] = {-0.2 * w, -w};
  }
  const Rational eight{monic_polynomial(roots), {Vector::Constant(1, 1e9)}};
  const Vector z = simulate_rational(eight, {0.0}, Hold::kZero, u.topRows(8000), 200.0);
  RationalOptions o = options_for(eight);
  const RationalFit found = identify_rational(u.topRows(8000), z, 200.0, {}, o);
  EXPECT_LT((found.theta.head(8).array() / eight.a.array() - 1.0).abs().maxCoeff(), 1e-6);
}

TEST(Srivc, BothMethodsEndAtTheSamePlace) {
  const Rational truth = mass_spring();
  const Matrix u = levels(4000, 20, 3);
  const Vector y = noisy(simulate_rational(truth, {0.0}, Hold::kZero, u, 100.0), 0.3, 4);
  RationalOptions o = options_for(truth);
  o.tolerance = 1e-7;
  const RationalFit refined = identify_rational(u, y, 100.0, {}, o);
  o.method = FitMethod::kOutputError;
  const RationalFit squares = identify_rational(u, y, 100.0, {}, o);
  const Vector error = refined.covariance.diagonal().cwiseSqrt();
  EXPECT_LT(((refined.theta - squares.theta).cwiseQuotient(error)).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_NEAR(refined.sse, squares.sse, 1e-9 * squares.sse);
}

TEST(Srivc, GradientIsThatOfTheOutputError) {
  // Sensitivities against differences of the simulated output, initial states and offset included.
  const Rational truth = mass_spring();
  const Matrix u = levels(400, 20, 5);
  const Vector y =
      noisy(simulate_rational(truth, {0.013}, Hold::kLinear, u, 100.0), 0.5, 6).tail(380);
  RationalSetup setup;
  setup.orders = {2, {1}, {0.013}};
  setup.hold = Hold::kLinear;
  RationalProblem problem(u.bottomRows(380), y, 100.0, {}, setup);
  problem.set_scale(3.0);
  const Vector theta = problem.to_scaled(Eigen::Vector4d(20.0, 3.0, 22.0, 0.4));
  problem.evaluate(theta);
  const Vector slope = problem.normal_equations(theta).g;
  for (Index i = 0; i < theta.size(); ++i) {
    const double h = 1e-5;
    Vector up = theta, down = theta;
    up[i] += h;
    down[i] -= h;
    const double numeric = -0.5 * (problem.evaluate(up) - problem.evaluate(down)) / (2.0 * h);
    EXPECT_NEAR(slope[i], numeric, 1e-6 * slope.norm()) << i;  // h^2 and rounding / h
  }
}

TEST(Srivc, RunsAreNeverJoined) {
  const Rational truth = mass_spring();
  const Matrix u = levels(4000, 20, 7);
  Vector y = simulate_rational(truth, {0.0}, Hold::kZero, u, 100.0);
  y.tail(2000).array() += 50.0;           // another offset
  y.segment(1900, 200).setConstant(NAN);  // a gap that no run covers
  const RationalFit fit =
      identify_rational(u, y, 100.0, {{0, 1900}, {2100, 4000}}, options_for(truth));
  EXPECT_LT((fit.theta - Eigen::Vector3d(25.0, 2.0, 25.0)).norm(), 1e-9);
  EXPECT_EQ(fit.nuisance.rows(), 2);
  EXPECT_NEAR(fit.nuisance(1, 2) - fit.nuisance(0, 2), 50.0, 1e-8);
  EXPECT_TRUE(std::isnan(fit.simulated[2000]));
}

TEST(Srivc, SeveralInputsShareTheirPoles) {
  const Rational truth{Eigen::Vector2d(25.0, 2.0),
                       {Eigen::Vector2d(25.0, 1.0), Vector::Constant(1, -9.0)}};
  const Matrix u = levels(4000, 20, 8, 2);
  const std::vector<double> delays = {0.02, 0.005};
  const Vector y = simulate_rational(truth, delays, Hold::kZero, u, 100.0);
  RationalOptions o = options_for(truth);
  o.setup.orders.delay_s = delays;
  const RationalFit fit = identify_rational(u, y, 100.0, {}, o);
  Vector expected(5);
  expected << 25.0, 2.0, 25.0, 1.0, -9.0;
  EXPECT_LT((fit.theta - expected).norm(), 1e-9);
  EXPECT_EQ(coefficient_name(fit.setup.orders, 4), "b0[1]");
}

TEST(Srivc, FixedAndBoundedCoefficientsAreKept) {
  const Rational truth = mass_spring();
  const Matrix u = levels(4000, 20, 9);
  const Vector y = noisy(simulate_rational(truth, {0.0}, Hold::kZero, u, 100.0), 0.1, 10);
  for (const FitMethod method : {FitMethod::kInstrumental, FitMethod::kOutputError}) {
    RationalOptions o = options_for(truth);
    o.method = method;
    o.lower = Eigen::Vector3d(25.0, 3.0, -INFINITY);  // a0 fixed, a1 above its true value
    o.upper = Eigen::Vector3d(25.0, 9.0, INFINITY);
    const RationalFit fit = identify_rational(u, y, 100.0, {}, o);
    EXPECT_EQ(fit.theta[0], 25.0);
    EXPECT_EQ(fit.theta[1], 3.0);
    EXPECT_EQ(fit.state, (std::vector<int>{1, 2, 0}));
    EXPECT_EQ(fit.covariance(0, 0), 0.0);
    EXPECT_EQ(fit.covariance(1, 1), 0.0);
    EXPECT_GT(fit.covariance(2, 2), 0.0);
    EXPECT_EQ(fit.outcome, FitOutcome::kGood);
    // The best of the rest: nothing within the bounds has a smaller sum.
    o.upper[1] = 3.0;
    EXPECT_NEAR(identify_rational(u, y, 100.0, {}, o).theta[2], fit.theta[2], 1e-3);
  }
}

TEST(Srivc, CorrelatedErrorsWidenTheInterval) {
  const Rational truth = mass_spring();
  const Matrix u = levels(8000, 20, 11);
  Vector y = simulate_rational(truth, {0.0}, Hold::kZero, u, 100.0);
  Random random(12);
  double v = 0.0;
  for (double& value : y) {
    v = 0.97 * v + 0.1 * random.normal();
    value += v;
  }
  RationalOptions o = options_for(truth);
  const RationalFit coloured = identify_rational(u, y, 100.0, {}, o);
  EXPECT_GT(coloured.noise.ar.size(), 0);
  EXPECT_NEAR(coloured.noise.ar[0], 0.97, 0.03);
  o.white = true;
  const RationalFit white = identify_rational(u, y, 100.0, {}, o);
  EXPECT_EQ(white.noise.ar.size(), 0);
  EXPECT_GT(coloured.covariance(0, 0), 4.0 * white.covariance(0, 0));
}

TEST(Srivc, HonestWhenItFails) {
  const Matrix u = levels(3000, 20, 13);
  Random random(14);
  // Noise that has nothing to do with the input.
  Vector noise(3000);
  for (double& v : noise) v = random.normal();
  EXPECT_NE(identify_rational(u, noise, 100.0, {}, options_for(mass_spring())).outcome,
            FitOutcome::kGood);
  // An unstable system: y' = 0.5 y + u.
  Vector y(3000);
  double x = 0.0;
  for (Index k = 0; k < 3000; ++k) {
    y[k] = x;
    x = x * std::exp(0.005) + u(k, 0) * (std::exp(0.005) - 1.0) / 0.5;
  }
  const Rational lag{Vector::Constant(1, 1.0), {Vector::Constant(1, 1.0)}};
  const RationalFit fit = identify_rational(u, y, 100.0, {}, options_for(lag));
  EXPECT_NE(fit.outcome, FitOutcome::kGood);
  EXPECT_LE(model_poles(fit.model)[0].real(), 0.0);
  EXPECT_FALSE(fit.notes.empty());
  // One step of the iterations is not enough.
  RationalOptions o = options_for(mass_spring());
  o.max_iterations = 1;
  const Vector clean = simulate_rational(mass_spring(), {0.0}, Hold::kZero, u, 100.0);
  EXPECT_EQ(identify_rational(u, noisy(clean, 0.1, 1), 100.0, {}, o).outcome,
            FitOutcome::kNotConverged);
  // A sine determines two numbers, not six.
  Matrix sine(3000, 1);
  for (Index k = 0; k < 3000; ++k) sine(k, 0) = std::sin(0.03 * static_cast<double>(k));
  const Rational six{monic_polynomial(Eigen::VectorXcd::Constant(3, -5.0)), {Vector::Ones(3)}};
  const Vector poor = noisy(simulate_rational(six, {0.0}, Hold::kZero, sine, 100.0), 1e-4, 2);
  RationalOptions rest = options_for(six);
  rest.setup.offset = false;
  const RationalFit undetermined =
      identify_rational(sine.bottomRows(2000), poor.tail(2000), 100.0, {}, rest);
  EXPECT_TRUE(undetermined.outcome != FitOutcome::kGood ||
              undetermined.covariance(0, 0) > undetermined.theta[0] * undetermined.theta[0]);
}

TEST(Srivc, SameBitsAgainAndCancels) {
  const Matrix u = levels(3000, 20, 15);
  const Vector y = noisy(simulate_rational(mass_spring(), {0.0}, Hold::kZero, u, 100.0), 0.1, 16);
  const RationalFit one = identify_rational(u, y, 100.0, {}, options_for(mass_spring()));
  const RationalFit two = identify_rational(u, y, 100.0, {}, options_for(mass_spring()));
  EXPECT_EQ(one.theta, two.theta);
  EXPECT_EQ(one.covariance, two.covariance);
  Token token;
  token.cancel();
  EXPECT_EQ(refusal_of([&] {
              identify_rational(u, y, 100.0, {}, options_for(mass_spring()), &token);
            }).fault(),
            Fault::kCancelled);
}

TEST(Srivc, RefusesWhatCannotBeUsed) {
  const Matrix u = levels(500, 10, 17);
  const Vector y = simulate_rational(mass_spring(), {0.0}, Hold::kZero, u, 100.0);
  const RationalOptions good = options_for(mass_spring());
  const auto refused = [&](const std::function<void(RationalOptions&)>& change) {
    RationalOptions o = good;
    change(o);
    return refusal_of([&] { identify_rational(u, y, 100.0, {}, o); }).fault();
  };
  EXPECT_EQ(refused([](auto& o) { o.setup.orders.poles = 0; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.orders.poles = 11; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.orders.zeros = {3}; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.orders.zeros = {1, 1}; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.orders.delay_s = {-1.0}; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.orders.delay_s = {1e9}; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.orders.delay_s = {NAN}; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.held_out = 0.95; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.least_skip_s = NAN; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.tolerance = 0.0; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.max_iterations = 0; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.cutoffs_hz = {-1.0}; }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.lower = Eigen::Vector2d(0.0, 0.0); }), Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) {
              o.lower = Eigen::Vector3d(1.0, 2.0, 3.0);
              o.upper = Eigen::Vector3d(1.0, 1.0, 3.0);
            }),
            Fault::kArgument);
  EXPECT_EQ(refused([](auto& o) { o.setup.least_skip_s = 4.95; }), Fault::kData);
  const auto with = [&](const Matrix& inputs, const Vector& output, double rate,
                        const std::vector<RowRange>& ranges = {}) {
    return refusal_of([&] { identify_rational(inputs, output, rate, ranges, good); }).fault();
  };
  EXPECT_EQ(with(u, y.head(400), 100.0), Fault::kArgument);
  EXPECT_EQ(with(u, y, 0.0), Fault::kArgument);
  EXPECT_EQ(with(u, y, NAN), Fault::kArgument);
  EXPECT_EQ(with(u, y, 100.0, {{0, 501}}), Fault::kArgument);
  EXPECT_EQ(with(u, y, 100.0, {{0, 300}, {200, 500}}), Fault::kArgument);
  EXPECT_EQ(with(u, y, 100.0, {{0, 5}}), Fault::kData);
  Vector gap = y;
  gap[123] = NAN;
  EXPECT_EQ(with(u, gap, 100.0), Fault::kData);
  EXPECT_EQ(with(Matrix::Constant(500, 1, 3.0), y, 100.0), Fault::kAnalysis);
  EXPECT_EQ(with(u, Vector::Constant(500, 3.0), 100.0), Fault::kAnalysis);
}

TEST(Orders, TheTruthIsRecommendedByEveryCriterion) {
  const Rational truth{Eigen::Vector3d(250.0, 45.0, 12.0), {Eigen::Vector2d(250.0, 30.0)}};
  const Matrix u = levels(6000, 10, 18);
  const Vector y = noisy(simulate_rational(truth, {0.05}, Hold::kZero, u, 100.0), 0.05, 19);
  const OrderGrid grid{{1, 2, 3, 4}, {}, {0.0, 0.05}};
  for (const OrderCriterion criterion :
       {OrderCriterion::kHeldOut, OrderCriterion::kBic, OrderCriterion::kYic}) {
    const OrderSearch search = search_orders(u, y, 100.0, {}, grid, criterion, {}, 2);
    ASSERT_EQ(search.candidates.size(), 20u);
    ASSERT_GE(search.recommended, 0);
    const OrderCandidate& best = search.candidates[static_cast<std::size_t>(search.recommended)];
    EXPECT_EQ(best.poles, 3) << search.reason;
    EXPECT_EQ(best.zeros, 1) << search.reason;
    EXPECT_EQ(best.delay_s, 0.05) << search.reason;
    // The same whatever the number of threads.
    const OrderSearch again = search_orders(u, y, 100.0, {}, grid, criterion, {}, 1);
    EXPECT_EQ(again.recommended, search.recommended);
    EXPECT_EQ(again.candidates.front().fit.theta, search.candidates.front().fit.theta);
  }
}

TEST(Orders, RefusesAnEmptyGridAndPassesOnBadData) {
  const Matrix u = levels(500, 10, 20);
  const Vector y = simulate_rational(mass_spring(), {0.0}, Hold::kZero, u, 100.0);
  const auto search = [&](const OrderGrid& grid, const Matrix& inputs) {
    return refusal_of(
               [&] { search_orders(inputs, y, 100.0, {}, grid, OrderCriterion::kBic, {}, 1); })
        .fault();
  };
  EXPECT_EQ(search({{}, {}, {0.0}}, u), Fault::kArgument);
  EXPECT_EQ(search({{2}, {}, {}}, u), Fault::kArgument);
  EXPECT_EQ(search({{1}, {2, 3}, {0.0}}, u), Fault::kArgument);
  EXPECT_EQ(search({{2}, {}, {0.0}}, Matrix::Ones(500, 1)), Fault::kAnalysis);
}

}  // namespace
}  // namespace ulna
