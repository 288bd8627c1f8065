#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>

#include "base/error.hpp"
#include "plant/capstan_robot.hpp"
#include "plant/carriage.hpp"
#include "sim/coloured.hpp"
#include "sim/experiment.hpp"
#include "sim/loop.hpp"

namespace ulna::sim {
namespace {

// Participant P1 of Table 3.2 on the capstan robot, in the frame of the robot.
Experiment relaxed(Index rows = 400) {
  Experiment e;
  e.robot = std::make_shared<const CapstanRobot>();
  e.arm.m = Matrix{{1.33, -0.93}, {-0.96, 1.89}};
  e.arm.b = Matrix{{5.75, -3.39}, {-0.94, 10.60}};
  e.arm.k = Matrix{{42.45, -34.38}, {-23.02, 125.43}};
  e.centre = Vector{{0.383, 0.0}};
  e.reference = Matrix::Zero(rows, 2);
  for (Index i = 0; i < rows; ++i) {
    const double t = static_cast<double>(i) / 1000.0;
    e.reference(i, 0) = 0.02 * std::sin(9.0 * t);
    e.reference(i, 1) = 0.02 * std::sin(13.0 * t + 1.0);
  }
  e.settle_s = 0.0;
  e.sensors = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  e.extras.truth = true;
  return e;
}

TEST(ColouredNoise, HasItsVarianceAndItsCorrelation) {
  for (const double damping : {0.1, 0.7, 1.0, 2.0}) {
    const double step = 0.01;
    const double natural = 1.0;
    ColouredNoise noise(0.5, natural, damping, step, Random(3));
    constexpr int kCount = 400000;
    constexpr int kLag = 10;
    Vector values(kCount);
    for (double& v : values) v = noise.next();
    const double variance = values.squaredNorm() / kCount;
    // 4000 s hold several hundred correlation times of the slowest of these filters.
    EXPECT_NEAR(variance, 0.25, 0.04) << damping;
    // R(t) / R(0) solves y'' + 2 z w y' + w^2 y = 0 from rest: Euler steps of 1e-5 s give it.
    const double w = 2.0 * kPi * natural;
    double y = 1.0;
    double rate = 0.0;
    for (int i = 0; i < 10000; ++i) {
      rate -= 1e-5 * (2.0 * damping * w * rate + w * w * y);
      y += 1e-5 * rate;
    }
    const double r =
        values.head(kCount - kLag).dot(values.tail(kCount - kLag)) / (kCount - kLag) / variance;
    EXPECT_NEAR(r, y, 0.03) << damping;
  }
  ColouredNoise none(0.0, 2.0, 0.7, 1e-3, Random(1));
  EXPECT_EQ(none.next(), 0.0);
}

TEST(History, ReadsBackBetweenItsSamples) {
  History history(3.5);
  history.push({1.0, 0.0});
  EXPECT_EQ(history.back(3.0)[0], 1.0);  // before the first value: the first
  for (int i = 2; i <= 10; ++i) history.push({static_cast<double>(i), -2.0 * i});
  EXPECT_EQ(history.back(0.0)[0], 10.0);
  EXPECT_EQ(history.back(3.0)[0], 7.0);
  EXPECT_DOUBLE_EQ(history.back(2.25)[0], 7.75);
  EXPECT_DOUBLE_EQ(history.back(3.5)[1], -13.0);
}

// With torques that are constant over a coarse step the motion between is Runge-Kutta's.
TEST(Loop, ConvergesWithTheFourthOrder) {
  Experiment e = relaxed(40);
  e.rate_hz = 20.0;
  e.controller.rate_hz = 20.0;
  e.controller.mode = ControlMode::kForce;
  for (Index i = 0; i < 40; ++i) {
    e.reference.row(i) << 3.0 * std::sin(0.3 * static_cast<double>(i)),
        2.0 * std::cos(0.2 * static_cast<double>(i));
  }
  const auto run = [&](Index substeps) {
    Loop loop(e, 0, 0, Vector2::Zero(), substeps);
    Vector2 position = Vector2::Zero();
    for (Index i = 0; i < 20; ++i) {
      position = loop.advance(e.reference.row(i).transpose(), Vector2::Zero()).position;
    }
    return position;
  };
  const Vector2 exact = run(256);
  const double coarse = (run(4) - exact).norm();
  const double fine = (run(8) - exact).norm();
  EXPECT_LT(coarse, 1e-4);
  EXPECT_GT(fine, 1e-13);  // above rounding, so that the ratio means something
  EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.35);
}

TEST(Loop, TakesSmallStepsWhereFrictionIsSteep) {
  const Experiment e = relaxed();
  EXPECT_EQ(Loop(e, 0, 0).substeps(), 1);
  CapstanParameters p;
  p.dry[0] = p.dry[1] = {0.05, 0.08, 0.0, 0.005};
  Experiment dry = e;
  dry.robot = std::make_shared<const CapstanRobot>(p);
  EXPECT_GT(Loop(dry, 0, 0).substeps(), 1);
  const Record record = simulate(dry, 0);
  EXPECT_TRUE(record.values().allFinite());
  p.dry[0] = p.dry[1] = {0.05, 0.08, 0.0, 1e-7};
  dry.robot = std::make_shared<const CapstanRobot>(p);
  EXPECT_THROW(simulate(dry, 0), Error);
}

TEST(Loop, RestsAtItsEquilibrium) {
  Experiment e = relaxed();
  e.reference.setZero();
  const Record record = simulate(e, 0);
  EXPECT_LT((record.values().col(0).array() - 0.383).abs().maxCoeff(), 1e-15);
  EXPECT_LT(record.values().middleCols(2, 2).cwiseAbs().maxCoeff(), 1e-12);
}

// The frame only says where things are: a robot and an arm turned together give turned signals.
TEST(Loop, DoesNotDependOnTheFrame) {
  const Experiment e = relaxed();
  const double angle = 0.7;
  const Matrix2 turn = Eigen::Rotation2Dd(angle).toRotationMatrix();
  Experiment turned = e;
  for (Matrix* m : {&turned.arm.m, &turned.arm.b, &turned.arm.k}) {
    *m = (turn * *m * turn.transpose()).eval();
  }
  turned.controller.base_m = {0.3, -0.2};
  turned.controller.base_angle_rad = angle;
  turned.centre = turned.controller.base_m + turn * e.centre;
  turned.reference = e.reference * turn.transpose();
  const Record a = simulate(e, 0);
  const Record b = simulate(turned, 0);
  const Matrix force = a.values().middleCols(2, 2) * turn.transpose();
  EXPECT_LT((b.values().middleCols(2, 2) - force).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Loop, SpringsPullWithTheirExactForce) {
  Experiment e = relaxed();
  const std::vector<double> rates(8, 80.0);
  const std::vector<double> rests(8, 0.09);
  e.arm.m = 0.5 * Matrix::Identity(2, 2);
  e.arm.b.setZero();
  e.arm.k.setZero();
  e.arm.springs =
      std::make_shared<const SpringArray>(SpringArray::on_frame(rates, rests, Vector2(0.383, 0.0)));
  const Record record = simulate(e, 0);
  const Index x = record.find("x_true");
  const Index a = record.find("a_x_true");
  const Index f = record.find("F_x_true");
  for (Index i = 0; i < record.rows(); i += 37) {
    const Vector2 at = record.values().row(i).segment(x, 2).transpose();
    const Vector2 acceleration = record.values().row(i).segment(a, 2).transpose();
    const Vector2 force = record.values().row(i).segment(f, 2).transpose();
    EXPECT_LT((force - e.arm.springs->force(at) + 0.5 * acceleration).norm(), 1e-11);
  }
}

TEST(Simulate, RunsAreTheSameAloneAndInABatch) {
  Experiment e = relaxed(200);
  e.human.tremor.rms_n = 1.0;
  e.sensors = Sensors();
  const std::vector<Record> one = simulate_batch(e, 5, 6, 1);
  const std::vector<Record> three = simulate_batch(e, 5, 6, 3);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].values(), three[i].values());
    EXPECT_EQ(one[i].values(), simulate(e, 5, i).values());
    EXPECT_EQ(one[i].provenance(), three[i].provenance());
  }
  EXPECT_NE(one[0].values(), one[1].values());
}

TEST(Simulate, StopsWhenAsked) {
  Token token;
  token.cancel();
  try {
    simulate(relaxed(), 0, 0, &token);
    FAIL() << "was cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kCancelled);
  }
  EXPECT_THROW(simulate_batch(relaxed(), 0, 4, 2, &token), Error);
}

TEST(Simulate, SaysThatALoopIsUnstable) {
  Experiment e = relaxed();
  e.controller.delay_s = 0.05;
  try {
    simulate(e, 0);
    FAIL() << "120 N s/m through 50 ms is unstable";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kAnalysis);
    EXPECT_NE(std::string(error.what()).find("the loop is unstable"), std::string::npos);
  }
}

TEST(Simulate, RefusesBadDescriptions) {
  const auto refused = [](const std::function<void(Experiment&)>& change, const char* argument) {
    Experiment e = relaxed();
    change(e);
    try {
      simulate(e, 0);
      FAIL() << argument;
    } catch (const Error& error) {
      EXPECT_EQ(error.argument(), argument) << error.what();
    }
  };
  const double nan = std::nan("");
  refused([](auto& e) { e.robot = nullptr; }, "robot");
  refused([](auto& e) { e.arm.m = Matrix::Identity(3, 3); }, "m");
  refused([](auto& e) { e.arm.b = Matrix::Identity(1, 1); }, "b");
  refused([&](auto& e) { e.arm.k(0, 1) = nan; }, "k");
  refused([](auto& e) { e.arm.m = -3.0 * Matrix::Identity(2, 2); }, "m");
  refused([](auto& e) { e.arm.x0 = Vector::Zero(1); }, "x0_m");
  refused([](auto& e) { e.arm.payload_kg = -0.1; }, "payload_kg");
  refused(
      [](auto& e) {
        e.reference.resize(400, 1);
        e.reference.setZero();
      },
      "reference");
  refused([&](auto& e) { e.reference(7, 1) = nan; }, "reference");
  refused([](auto& e) { e.reference = Matrix::Zero(1, 2); }, "reference");
  refused([](auto& e) { e.segments = {{10, 10}}; }, "segments");
  refused([](auto& e) { e.segments = {{10, 401}}; }, "segments");
  refused([](auto& e) { e.centre = Vector{{0.6, 0.0}}; }, "centre_m");
  refused([](auto& e) { e.centre = Vector{{0.5207, 0.0}}; }, "centre_m");  // singular
  refused([](auto& e) { e.rate_hz = 0.0; }, "rate_hz");
  refused([](auto& e) { e.settle_s = -1.0; }, "settle_s");
  refused([&](auto& e) { e.controller.kp_n_m = nan; }, "kp_n_m");
  refused([](auto& e) { e.controller.kd_n_s_m = -1.0; }, "kd_n_s_m");
  refused([](auto& e) { e.controller.hold_axis = 2; }, "hold_axis");
  refused([](auto& e) { e.human.tremor.rms_n = -1.0; }, "tremor_n");
  refused([](auto& e) { e.human.tremor.damping = 0.0; }, "tremor_damping");
  refused([](auto& e) { e.human.cocontraction.level = 1.5; }, "cocontraction");
  refused([](auto& e) { e.human.cns = {true, 1e-6, 0.0, 1.0, 0.0, 0.0, {}}; }, "delay_s");
  refused([](auto& e) { e.human.cns = {true, 0.15, 0.0, -1.0, 0.0, 0.0, {}}; }, "stiffness_n_m");
  refused([](auto& e) { e.sensors.force_noise_n = -1.0; }, "force_noise_n");
}

TEST(Carriage, IsALineOfItsOwn) {
  EXPECT_THROW(Carriage({0.0, 1.0, 0.2}), Error);
  EXPECT_THROW(Carriage({1.0, -1.0, 0.2}), Error);
  EXPECT_THROW(Carriage({1.0, 1.0, 0.0}), Error);
  const Carriage carriage({2.0, 3.0, 0.2});
  EXPECT_EQ(carriage.broken_limit({0.2, -0.2}), "");
  EXPECT_NE(carriage.broken_limit({0.0, 0.21}), "");
  EXPECT_NE(carriage.broken_limit({std::nan(""), 0.0}), "");
  const Vector2 rate(0.3, -0.1);
  const Vector2 acceleration(1.0, 2.0);
  const Vector2 torque =
      inverse_dynamics(carriage, Vector2::Zero(), rate, acceleration, Vector2::Zero());
  EXPECT_LT(
      (carriage.regressor(Vector2::Zero(), rate, acceleration) * carriage.parameters() - torque)
          .norm(),
      1e-15);
}

}  // namespace
}  // namespace ulna::sim
