// Robot parameters from recordings whose truth is known.
#include "ident/robot_parameters.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "base/error.hpp"
#include "made_robot.hpp"

namespace ulna {
namespace {

MadeRobot free_motion() {
  MadeRobot made;
  made.contact = false;
  made.range_rad = 0.35;  // 40 degrees in all, as the thesis
  return made;
}

Vector truth() { return CapstanRobot().parameters(); }

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

bool has(const std::string& text, const std::string& word) {
  return text.find(word) != std::string::npos;
}

TEST(RobotParameters, AreExactWithoutNoise) {
  const MadeLog log = make_robot_log(free_motion());
  RobotFitOptions options;
  options.reference = "ref";
  const RobotFit fit = identify_robot(*log.record, CapstanRobot(), options);
  EXPECT_EQ(fit.estimator, Estimator::kInstrumental);
  for (Index i = 0; i < 5; ++i) {
    // The wide smoother before the products of signals deviates by 1e-6 within the band.
    EXPECT_NEAR(fit.value[i] / truth()[i], 1.0, 1e-4) << i;
    EXPECT_NEAR(fit.other[i] / truth()[i], 1.0, 1e-4) << i;
  }
  EXPECT_GT(fit.vaf.minCoeff(), 99.999);
  EXPECT_TRUE(fit.feasible);
  EXPECT_TRUE(fit.warnings.empty());
  EXPECT_EQ(fit.names.front(), "alpha_1");
}

TEST(RobotParameters, CoverTheTruthWithNoiseAndATremblingMotion) {
  MadeRobot made = free_motion();
  made.wobble_rad = 0.05;
  made.angle_noise = 5e-4;
  made.torque_noise = 0.05;
  double squares = 0.0;
  int count = 0;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    made.seed = seed;
    RobotFitOptions options;
    options.reference = "ref";
    const RobotFit fit = identify_robot(*make_robot_log(made).record, CapstanRobot(), options);
    for (Index i = 0; i < 5; ++i) {
      const double z = (fit.value[i] - truth()[i]) / std::sqrt(fit.covariance(i, i));
      EXPECT_LT(std::abs(z), 4.5) << "seed " << seed << ", alpha_" << i + 1;
      squares += z * z;
      ++count;
    }
  }
  // Mean square of 30 standard normal values: 0.5 to 1.7 at 99 %; a little room for Newey-West.
  EXPECT_GT(squares / count, 0.3);
  EXPECT_LT(squares / count, 2.2);
}

TEST(RobotParameters, InstrumentsWithstandNoiseThatBiasesLeastSquares) {
  MadeRobot made = free_motion();
  made.angle_noise = 0.004;  // a quarter of a degree: far too much, to see the bias
  made.torque_noise = 0.02;
  made.duration_s = 50.0;
  RobotFitOptions options;
  options.reference = "ref";
  options.prepare.lowpass_hz = 15.0;  // lets the noise of accelerations in
  const RobotFit fit = identify_robot(*make_robot_log(made).record, CapstanRobot(), options);
  double worst_iv = 0.0;
  double worst_ls = 0.0;
  for (Index i = 0; i < 3; ++i) {
    worst_iv = std::max(worst_iv, std::abs(fit.value[i] / truth()[i] - 1.0));
    worst_ls = std::max(worst_ls, std::abs(fit.other[i] / truth()[i] - 1.0));
  }
  EXPECT_LT(worst_iv, 0.5 * worst_ls);
  EXPECT_GT(worst_ls, 0.02);
  EXPECT_LT(fit.difference_p, 0.01);
  options.least_squares = true;
  const RobotFit plain = identify_robot(*make_robot_log(made).record, CapstanRobot(), options);
  bool told = false;
  for (const std::string& words : plain.warnings) {
    told = told || has(words, "differs from instrumental variables");
  }
  EXPECT_TRUE(told);
}

TEST(RobotParameters, DryFrictionIsAColumnMore) {
  MadeRobot made = free_motion();
  made.robot.dry = {Friction{0.08, 0.08, 0.0, 0.02}, Friction{0.05, 0.05, 0.0, 0.02}};
  const MadeLog log = make_robot_log(made);
  RobotFitOptions options;
  options.dry_friction = true;
  const RobotFit fit = identify_robot(*log.record, CapstanRobot(), options);
  ASSERT_EQ(fit.value.size(), 7);
  EXPECT_EQ(fit.names.back(), "dry_2");
  // The jump of the friction at a turn of the motion is wider than any smoother's band.
  EXPECT_NEAR(fit.value[5], 0.08, 0.004);
  EXPECT_NEAR(fit.value[6], 0.05, 0.004);
  // Without the column the fit is worse and says nothing wrong about its own numbers.
  options.dry_friction = false;
  const RobotFit without = identify_robot(*log.record, CapstanRobot(), options);
  EXPECT_LT(without.vaf.minCoeff(), fit.vaf.minCoeff());
}

TEST(RobotParameters, AKnownForceIsTakenIntoAccount) {
  MadeRobot made;
  made.range_rad = 0.3;
  const MadeLog log = make_robot_log(made);
  Record::Parts parts = log.record->parts();
  const Index columns = parts.values.cols();
  parts.values.conservativeResize(Eigen::NoChange, columns + 2);
  parts.values.rightCols(2) = log.force;
  parts.channels.push_back(made_channel("F_x", "N", Role::kForce, 0));
  parts.channels.push_back(made_channel("F_y", "N", Role::kForce, 1));
  RobotFitOptions options;
  options.force = "F";
  const RobotFit fit = identify_robot(Record::make(std::move(parts)), CapstanRobot(), options);
  for (Index i = 0; i < 5; ++i) EXPECT_NEAR(fit.value[i] / truth()[i], 1.0, 2e-3) << i;
}

TEST(RobotParameters, MotionThatTellsTooLittleIsAnErrorThatNamesIt) {
  const MadeLog log = make_robot_log(free_motion());
  Record::Parts parts = log.record->parts();
  parts.values.col(1).setConstant(0.9);
  EXPECT_TRUE(
      has(message_of([&] { identify_robot(Record::make(std::move(parts)), CapstanRobot(), {}); }),
          "theta_2 is constant"));
  // Joint 2 still but for noise: its own parameters come with errors that say so.
  parts = log.record->parts();
  Random random(1);
  for (Index row = 0; row < parts.values.rows(); ++row) {
    parts.values(row, 1) = 0.9 + 1e-6 * random.normal();
    parts.values(row, 3) = 0.01 * random.normal();
  }
  const RobotFit still = identify_robot(Record::make(std::move(parts)), CapstanRobot(), {});
  bool told = false;
  for (const std::string& words : still.warnings) told = told || has(words, "alpha_3");
  EXPECT_TRUE(told);

  parts = log.record->parts();
  // Both joints alike, at a right angle: alpha_2 acts as alpha_1 and alpha_3 do together.
  parts.values.col(1) = parts.values.col(0).array() + 0.5 * kPi;
  const std::string message =
      message_of([&] { identify_robot(Record::make(std::move(parts)), CapstanRobot(), {}); });
  EXPECT_TRUE(has(message, "does not tell"));
  EXPECT_TRUE(has(message, "alpha_2"));
}

TEST(RobotParameters, ParametersThatNoBodyHasAreCalledSo) {
  EXPECT_TRUE(feasibility(CapstanRobot(), truth()).feasible());
  // Smallest eigenvalue in closed form, at sin(theta_1 - theta_2) = 1.
  const double a = truth()[0];
  const double c = truth()[2];
  const double b = 0.5 * truth()[1];
  const double least = 0.5 * (a + c) - std::hypot(0.5 * (a - c), b);
  EXPECT_NEAR(feasibility(CapstanRobot(), truth()).least_inertia, least, 1e-12);
  EXPECT_NEAR(feasibility(CapstanRobot(), truth()).least_friction, 0.0651, 1e-9);
  Vector wrong = truth();
  wrong[1] = 0.2;  // alpha_2^2 / 4 > alpha_1 alpha_3
  EXPECT_FALSE(feasibility(CapstanRobot(), wrong).feasible());
  wrong = truth();
  wrong[4] = -0.01;
  EXPECT_FALSE(feasibility(CapstanRobot(), wrong).feasible());
  // Torques of the wrong sign make such parameters.
  const MadeLog log = make_robot_log(free_motion());
  Record::Parts parts = log.record->parts();
  parts.values.middleCols(2, 2) *= -1.0;
  const RobotFit fit = identify_robot(Record::make(std::move(parts)), CapstanRobot(), {});
  EXPECT_FALSE(fit.feasible);
  EXPECT_TRUE(has(fit.warnings.front(), "No body has these parameters"));
}

TEST(RobotParameters, RefusesWhatItCannotUse) {
  MadeRobot made = free_motion();
  made.duration_s = 6.0;
  const MadeLog log = make_robot_log(made);
  const auto with = [&](const std::function<void(RobotFitOptions&)>& change) {
    RobotFitOptions options;
    change(options);
    return message_of([&] { identify_robot(*log.record, CapstanRobot(), options); });
  };
  EXPECT_TRUE(has(with([](auto& o) { o.angle = "a"; }), "not in rad"));
  EXPECT_TRUE(has(with([](auto& o) { o.reference = "x"; }), "not in rad"));
  EXPECT_TRUE(has(with([](auto& o) { o.force = "tau"; }), "not in N"));
  EXPECT_TRUE(has(with([](auto& o) { o.lag_s = -1.0; }), "positive number"));
  EXPECT_TRUE(has(with([](auto& o) { o.dry_threshold = 0.0; }), "above zero"));
}

}  // namespace
}  // namespace ulna
