// Arm and robot together, limits, and foreseen errors, against closed forms and direct sums.
#include "impedance/plan.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <cmath>

#include "base/error.hpp"
#include "ident/linear.hpp"
#include "impedance/safety.hpp"
#include "made_record.hpp"
#include "signal/multisine.hpp"
#include "signal/steps.hpp"

namespace ulna {
namespace {

Matrix scalar(double value) { return Matrix::Constant(1, 1, value); }

ArmModel one_axis(double m, double b, double k, double x0 = 0.0) {
  return {scalar(m), scalar(b), scalar(k), Vector::Constant(1, x0)};
}

ArmModel relaxed_arm() {
  const Truth p1 = participant(1);
  return {p1.m, p1.b, p1.k, Vector::Zero(2)};
}

RobotModel robot(Index n, double stiffness, double damping, double mass) {
  const Matrix one = Matrix::Identity(n, n);
  return {stiffness * one, damping * one, mass * one};
}

Excitation small_multisine(Index axes, Drive drive = Drive::kPosition, double size = 0.01) {
  MultisineSpec spec;
  spec.drive = drive;
  spec.amplitude = Vector::Constant(axes, size);
  spec.rate_hz = 100.0;
  spec.phases = Phases::kSchroeder;
  return multisine(spec);
}

template <class Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.argument();
  }
  return "nothing was refused";
}

// The loop
// -----------------------------------------------------------------------------------------

TEST(ArmLoop, AConstantForceGivesTheClosedForm) {
  // m x'' + b x' + k x = 1 from rest: the second-order step over k.
  const SecondOrder same{3.0 / (2.0 * std::sqrt(1.5 * 200.0)), std::sqrt(200.0 / 1.5)};
  const ArmLoop loop(one_axis(1.0, 2.0, 150.0), robot(1, 50.0, 1.0, 0.5), Drive::kForce);
  const Excitation push = excitation_of(Drive::kForce, 500.0, Matrix::Ones(2000, 1), {});
  const ArmLoop::Response r = loop.respond(push);
  for (Index i = 0; i < 2000; ++i) {
    const SignalPoint p = step_response(same, static_cast<double>(i) / 500.0);
    EXPECT_NEAR(r.position(i, 0), p.value / 200.0, 1e-15);
    EXPECT_NEAR(r.velocity(i, 0), p.rate / 200.0, 1e-14);
    EXPECT_NEAR(r.acceleration(i, 0), p.acceleration / 200.0, 1e-12);
    // The force on the robot is what moves the arm, turned round.
    EXPECT_NEAR(r.force(i, 0), -(p.acceleration + 2.0 * p.rate + 150.0 * p.value) / 200.0, 1e-12);
  }
}

TEST(ArmLoop, SpreadOfWhiteForceInClosedForm) {
  // Two-sided density S: var x = S / (2 b k), var x' = S / (2 b m); up to 400 Hz that is all of
  // them to 1e-3 (the tail of the velocity falls as 1 / f).
  const Tremor tremor{2.0, 0.0, 400.0};
  const double density = 4.0 / 800.0;
  const ArmLoop loop(one_axis(1.0, 2.0, 150.0), robot(1, 50.0, 1.0, 0.5), Drive::kForce);
  const ArmLoop::Spread spread = loop.spread(tremor);
  EXPECT_NEAR(spread.position(0, 0), density / (2.0 * 3.0 * 200.0), 1e-3 * spread.position(0, 0));
  EXPECT_NEAR(spread.velocity(0, 0), density / (2.0 * 3.0 * 1.5), 1e-3 * spread.velocity(0, 0));
  EXPECT_EQ(loop.spread({0.0, 0.0, 5.0}).force(0, 0), 0.0);
  EXPECT_NEAR(tremor.density(-3.0), density, 1e-18);
  EXPECT_EQ(tremor.density(401.0), 0.0);
}

TEST(ArmLoop, RestsWhereTheSpringsBalance) {
  const ArmLoop stiff(one_axis(1.0, 2.0, 100.0, 0.02), robot(1, 300.0, 30.0, 1.0),
                      Drive::kPosition);
  EXPECT_NEAR(stiff.rest_position()[0], 0.005, 1e-17);
  EXPECT_NEAR(stiff.rest_force()[0], 100.0 * 0.015, 1e-14);
  // Without any stiffness every place is one of rest.
  const ArmLoop loose(one_axis(1.0, 2.0, 0.0), robot(1, 0.0, 0.0, 1.0), Drive::kForce);
  EXPECT_EQ(loose.rest_position()[0], 0.0);
  EXPECT_EQ(loose.rest_force()[0], 0.0);
}

TEST(ArmLoop, BadInput) {
  const RobotModel any = robot(1, 300.0, 30.0, 1.0);
  EXPECT_EQ(refusal([&] { ArmLoop(one_axis(-2.0, 1.0, 1.0), any, Drive::kPosition); }), "M");
  EXPECT_EQ(refusal([&] { ArmLoop(one_axis(1.0, std::nan(""), 1.0), any, Drive::kPosition); }),
            "B");
  EXPECT_EQ(refusal([&] { ArmLoop(one_axis(1.0, -40.0, 1.0), any, Drive::kPosition); }), "robot");
  EXPECT_EQ(refusal([&] { ArmLoop(one_axis(1.0, 1.0, -400.0), any, Drive::kPosition); }), "robot");
  EXPECT_EQ(refusal([&] { ArmLoop(relaxed_arm(), any, Drive::kPosition); }), "stiffness");
  EXPECT_EQ(refusal([&] { ArmLoop(one_axis(1.0, 1.0, 1.0, kInfinity), any, Drive::kPosition); }),
            "x0");
  const ArmLoop loop(one_axis(1.0, 1.0, 1.0), any, Drive::kPosition);
  EXPECT_EQ(refusal([&] { loop.respond(small_multisine(2)); }), "design");
  EXPECT_EQ(refusal([&] { loop.respond(small_multisine(1, Drive::kForce)); }), "robot");
  EXPECT_EQ(refusal([&] { loop.spread({-1.0, 0.0, 5.0}); }), "tremor");
  EXPECT_EQ(refusal([&] { loop.spread({1.0, 5.0, 5.0}); }), "tremor_band_hz");
}

// Limits
// -------------------------------------------------------------------------------------------

TEST(Safety, TheScaleIsWhereTheLimitIsMet) {
  ArmModel arm = relaxed_arm();
  arm.x0 << 0.01, -0.02;  // the arm pulls at rest
  const ArmLoop loop(arm, robot(2, 500.0, 40.0, 1.1), Drive::kPosition);
  const Excitation e = small_multisine(2);
  for (const bool per_axis : {false, true}) {
    for (int q = 0; q < 3; ++q) {
      SafetyOptions options;
      options.tremor = {0.3, 0.0, 5.0};
      options.limits.per_axis = per_axis;
      double* const limits[] = {&options.limits.force, &options.limits.displacement,
                                &options.limits.velocity};
      const double given[] = {12.0, 0.02, 0.1};
      *limits[q] = given[q];
      const Safety found = check_safety(e, loop, options);
      EXPECT_EQ(static_cast<int>(found.tightest), q);
      ASSERT_GT(found.scale, 0.0);
      ASSERT_LT(found.scale, kInfinity);
      const Safety at = check_safety(scaled(e, found.scale), loop, options);
      EXPECT_NEAR(at.scale, 1.0, 1e-9);
      const PeakOf& peak = at.peaks[q];
      EXPECT_NEAR(peak.value[peak.entry], given[q], 1e-9 * given[q]);
      EXPECT_EQ(peak.time_s[peak.entry], peak.scale_time_s);
      EXPECT_EQ(check_safety(scaled(e, 1.001 * found.scale), loop, options).within, false);
      EXPECT_EQ(check_safety(scaled(e, 0.999 * found.scale), loop, options).within, true);
    }
  }
}

TEST(Safety, WordsNameLimitTimeAndAxis) {
  const ArmLoop loop(relaxed_arm(), robot(2, 3000.0, 90.0, 1.1), Drive::kPosition);
  StepsSpec spec;
  spec.rate_hz = 250.0;
  const Excitation e = steps(spec);
  SafetyOptions options;
  const std::vector<std::string> axes{"x", "y"};
  const auto words = [&] { return safety_sentence(check_safety(e, loop, options), axes, false); };
  EXPECT_EQ(words().find("No limit was given: the force reaches"), 0u);
  options.limits.velocity = 0.05;
  options.limits.force = 1000.0;
  const Safety found = check_safety(e, loop, options);
  EXPECT_FALSE(found.within);
  EXPECT_EQ(found.tightest, Quantity::kVelocity);
  EXPECT_EQ(words().find("Out of limits: the velocity reaches"), 0u) << words();
  EXPECT_NE(words().find("mostly along "), std::string::npos);
  EXPECT_NE(words().find("scale the design by at most"), std::string::npos);
  options.limits.velocity = 10.0;
  EXPECT_EQ(words().find("Within limits: closest is the"), 0u) << words();
  // What the tremor does alone is too much.
  options.tremor = {100.0, 0.0, 5.0};
  options.limits.velocity = 0.01;
  const Safety none = check_safety(e, loop, options);
  EXPECT_EQ(none.scale, 0.0);
  EXPECT_FALSE(none.within);
  EXPECT_EQ(words().find("Out of limits even without a perturbation"), 0u) << words();
}

TEST(Safety, BadInput) {
  const ArmLoop loop(relaxed_arm(), robot(2, 3000.0, 90.0, 1.1), Drive::kPosition);
  const Excitation e = small_multisine(2);
  const auto with = [&](auto change) {
    SafetyOptions options;
    change(options);
    return refusal([&] { check_safety(e, loop, options); });
  };
  EXPECT_EQ(with([](auto& o) { o.limits.force = -1.0; }), "force");
  EXPECT_EQ(with([](auto& o) { o.limits.displacement = std::nan(""); }), "displacement");
  EXPECT_EQ(with([](auto& o) { o.limits.velocity = kInfinity; }), "velocity");
  EXPECT_EQ(with([](auto& o) { o.sigmas = -1.0; }), "sigmas");
}

// Plans
// --------------------------------------------------------------------------------------------

Plan plan_of(const Excitation& e, double tremor, SensorNoise noise, PlanOptions options = {},
             double stiffness = 500.0) {
  return plan_experiment(e, relaxed_arm(), robot(2, stiffness, 40.0, 1.1), {tremor, 0.0, 5.0},
                         noise, options);
}

TEST(Plan, ErrorsAddAndScaleAsTheyMust) {
  const Excitation e = small_multisine(2);
  const Vector tremor = plan_of(e, 1.0, {}).covariance.diagonal();
  const Vector force = plan_of(e, 0.0, {0.1, 0.0}).covariance.diagonal();
  const Vector position = plan_of(e, 0.0, {0.0, 1e-5}).covariance.diagonal();
  const Vector all = plan_of(e, 1.0, {0.1, 1e-5}).covariance.diagonal();
  for (Index i = 0; i < all.size(); ++i) {
    EXPECT_GT(std::min({tremor[i], force[i], position[i]}), 0.0);
    EXPECT_NEAR(all[i], tremor[i] + force[i] + position[i], 1e-9 * all[i]);  // independent
  }
  const Vector twice = plan_of(e, 2.0, {}).covariance.diagonal();
  EXPECT_LT((twice - 4.0 * tremor).cwiseAbs().cwiseQuotient(tremor).maxCoeff(), 1e-9);
  // A design twice as large determines M, B and K twice as well; x0 is found from rest as before.
  const Vector large = plan_of(scaled(e, 2.0), 1.0, {}).covariance.diagonal();
  EXPECT_LT((4.0 * large - tremor).head(12).cwiseAbs().cwiseQuotient(tremor.head(12)).maxCoeff(),
            1e-6);
  PlanOptions options;
  options.repetitions = 4.0;
  const Plan four = plan_of(e, 1.0, {}, options);
  EXPECT_LT((4.0 * four.covariance.diagonal() - tremor).cwiseAbs().cwiseQuotient(tremor).maxCoeff(),
            1e-12);
  EXPECT_NEAR(four.seconds, 200.0, 1e-9);
  EXPECT_NEAR(four.used_s, 160.0, 0.1 * 160.0);  // the first 40 s of each
  // And the way back from an error to a time.
  const double error = std::sqrt(four.covariance(8, 8));
  EXPECT_NEAR(seconds_for(four, 8, 0.5 * error), 4.0 * four.seconds, 1e-6);
  EXPECT_EQ(refusal([&] { seconds_for(four, 14, 1.0); }), "parameter");
  EXPECT_EQ(refusal([&] { seconds_for(four, -1, 1.0); }), "parameter");
  EXPECT_EQ(refusal([&] { seconds_for(four, 0, 0.0); }), "error");
}

// White force noise on filtered rows: the covariance once more as a sum over all pairs of rows.
TEST(Plan, EqualsTheSumOverAllPairsOfRows) {
  MultisineSpec spec;
  spec.amplitude = Vector::Constant(1, 0.01);
  spec.rate_hz = 50.0;
  spec.duration_s = 20.0;
  spec.lines = 5;
  const Excitation e = multisine(spec);
  const double noise = 0.2;
  PlanOptions options;
  options.refit = Refit::kYes;
  const ArmModel arm = one_axis(1.5, 8.0, 120.0);
  const RobotModel machine = robot(1, 500.0, 40.0, 1.1);
  const Plan plan = plan_experiment(e, arm, machine, {}, {noise, 0.0}, options);

  // The same recording again, by hand.
  const ArmLoop loop(arm, machine, Drive::kPosition);
  const ArmLoop::Response r = loop.respond(e);
  Record::Parts parts;
  parts.rate_hz = 50.0;
  parts.values.resize(e.rows(), 3);
  parts.values << r.position, r.force, e.value;
  const char* const names[] = {"x", "F_x", "x_ref"};
  const Role roles[] = {Role::kPosition, Role::kForce, Role::kReference};
  for (int c = 0; c < 3; ++c) {
    Channel channel;
    channel.name = names[c];
    channel.unit = c == 1 ? "N" : "m";
    channel.role = roles[c];
    parts.channels.push_back(channel);
  }
  const Record record = Record::make(std::move(parts));
  const Prepared prepared = prepare(record, find_roles(record, "", "", ""), {});
  const std::vector<Span> spans{{0, 0, prepared.trials[0].rows()}};
  const Design design(prepared, 0.0, spans);
  const Index rows = row_count(spans);
  Matrix block(rows, design.columns());
  design.fill(0, 0, rows, block);
  const Matrix z = block.leftCols(4);
  const Matrix phi = block.middleCols(4, 4);
  const Matrix weighted = z * (z.transpose() * z).ldlt().solve(z.transpose() * phi);
  // Autocovariance of the filtered noise, from the filter's answer to a unit sample.
  Record::Parts impulse;
  impulse.rate_hz = 50.0;
  impulse.values = Matrix::Zero(e.rows(), 2);
  impulse.values(500, 1) = 1.0;
  impulse.values.col(0) = e.value;
  for (int c = 0; c < 2; ++c) {
    Channel channel;
    channel.name = names[c];
    channel.unit = c == 1 ? "N" : "m";
    channel.role = roles[c];
    impulse.channels.push_back(channel);
  }
  const Record unit = Record::make(std::move(impulse));
  PrepareOptions filters;  // those of the plan, not chosen anew
  filters.lowpass_hz = plan.report.lowpass_hz;
  filters.window = plan.report.window;
  const Vector answer = prepare(unit, find_roles(unit, "", "", ""), filters).trials[0].force();
  Vector covariance = Vector::Zero(rows);
  for (Index lag = 0; lag < rows; ++lag) {
    covariance[lag] = noise * noise * answer.head(rows - lag).dot(answer.tail(rows - lag));
  }
  Matrix meat = Matrix::Zero(4, 4);
  for (Index t = 0; t < rows; ++t) {
    for (Index s = 0; s < rows; ++s) {
      meat += covariance[std::abs(t - s)] * weighted.row(t).transpose() * weighted.row(s);
    }
  }
  const Matrix bread = (weighted.transpose() * phi).inverse();
  const Matrix direct = bread * meat * bread.transpose();
  for (Index i = 0; i < 3; ++i) {
    // What rounding, sampling of the spectrum and the ends of the record leave.
    EXPECT_NEAR(std::sqrt(plan.covariance(i, i)), std::sqrt(direct(i, i)),
                2e-3 * std::sqrt(direct(i, i)));
  }
}

TEST(Plan, LeastSquaresTendsToMinusTheRobot) {
  // As the tremor moves all of it, least squares finds (1 - rho) Z_h - rho Z_r.
  const Excitation e = small_multisine(2);
  const Plan little = plan_of(e, 0.01, {});
  EXPECT_LT(little.rho.maxCoeff(), 1e-3);
  const double share = std::abs(little.least_squares_bias[8]) / 42.45;
  EXPECT_LT(share, 0.01);
  const Plan much = plan_of(e, 100.0, {});
  EXPECT_GT(much.rho.minCoeff(), 0.99);
  EXPECT_NEAR(much.truth[8] + much.least_squares_bias[8], -500.0, 15.0);
  EXPECT_NEAR(much.truth[4] + much.least_squares_bias[4], -40.0, 2.0);
  EXPECT_FALSE(much.warnings.empty());  // the instruments are weak
  EXPECT_EQ(much.bias.cwiseAbs().maxCoeff(), 0.0);
  PlanOptions options;
  options.estimator = EstimatorChoice::kLeastSquares;
  const Plan ls = plan_of(e, 1.0, {}, options);
  EXPECT_EQ(ls.estimator, Estimator::kLeastSquares);
  EXPECT_EQ(ls.bias, ls.least_squares_bias);
  EXPECT_LT((ls.standard_error() - ls.least_squares_error).cwiseAbs().maxCoeff(), 1e-15);
  ASSERT_EQ(ls.warnings.size(), 1u);
  EXPECT_NE(ls.warnings[0].find("biased"), std::string::npos);
}

TEST(Plan, StructureHelps) {
  const Excitation e = small_multisine(2);
  ArmModel arm = relaxed_arm();
  for (Matrix* m : {&arm.m, &arm.b, &arm.k}) *m = 0.5 * (*m + m->transpose()).eval();
  const auto with = [&](const PlanOptions& options) {
    return plan_experiment(e, arm, robot(2, 500.0, 40.0, 1.1), {1.0, 0.0, 5.0}, {}, options);
  };
  const Plan free = with({});
  PlanOptions options;
  options.structure.model = Model::kSymmetric;
  const Plan symmetric = with(options);
  EXPECT_EQ(symmetric.covariance(9, 9), symmetric.covariance(10, 10));
  EXPECT_LT(symmetric.covariance(9, 9), std::max(free.covariance(9, 9), free.covariance(10, 10)));
}

TEST(Plan, SaysWhenADesignDoesNotDetermine) {
  MultisineSpec spec;
  spec.amplitude = Vector::Constant(1, 0.01);
  spec.rate_hz = 100.0;
  spec.lines_hz = Matrix{{1.0}};
  const Excitation one = multisine(spec);
  // One sinusoid does not tell inertia from stiffness.
  try {
    plan_experiment(one, one_axis(1.5, 8.0, 120.0), robot(1, 500.0, 40.0, 1.1), {}, {}, {});
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kAnalysis);
    EXPECT_EQ(error.argument(), "design");
    EXPECT_NE(std::string(error.what()).find("does not determine"), std::string::npos);
  }
  const auto with = [&](SensorNoise noise, PlanOptions options) {
    return refusal([&] { plan_of(small_multisine(2), 1.0, noise, options); });
  };
  PlanOptions options;
  EXPECT_EQ(with({-1.0, 0.0}, options), "force_noise");
  EXPECT_EQ(with({0.0, kInfinity}, options), "position_noise");
  options.repetitions = 0.0;
  EXPECT_EQ(with({}, options), "repetitions");
  options = {};
  options.train_s = -1.0;
  EXPECT_EQ(with({}, options), "train_s");
  options = {};
  options.train_s = 0.2;
  EXPECT_EQ(with({}, options), "design");
}

}  // namespace
}  // namespace ulna
