#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/error.hpp"
#include "base/random.hpp"
#include "plant/capstan_robot.hpp"

namespace ulna {
namespace {

// A pose within the limits of (A.2), drawn at random.
Vector2 some_pose(const CapstanRobot& robot, Random& random) {
  for (;;) {
    const Vector2 q((-55.0 + 145.0 * random.uniform()) * kPi / 180.0,
                    145.0 * random.uniform() * kPi / 180.0);
    if (robot.broken_limit(q).empty()) return q;
  }
}

Vector2 some(Random& random, double scale) {
  return {scale * random.normal(), scale * random.normal()};
}

CapstanRobot with_dry_friction() {
  CapstanParameters p;
  p.dry[0] = {0.02, 0.03, 0.0, 0.05};
  p.dry[1] = {0.01, 0.015, 0.0, 0.05};
  return CapstanRobot(p);
}

TEST(Friction, ReferenceValues) {
  const Friction f{0.3, 0.5, 0.1, 0.02};
  const double speeds[] = {0.005, 0.01, 0.02, 0.04, 0.1, 0.5};
  const double forces[] = {0.314276039, 0.441687564, 0.501798790,
                           0.434612177, 0.330408163, 0.350202848};
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(friction_force(f, speeds[i]), forces[i], 5e-10);  // nine printed digits
    EXPECT_NEAR(friction_force(f, -speeds[i]), -forces[i], 5e-10);
  }
  EXPECT_EQ(friction_force(f, 0.0), 0.0);
  EXPECT_NEAR(friction_force(f, 1e-8) / 1e-8, friction_slope(f), 1e-6 * friction_slope(f));
  EXPECT_DOUBLE_EQ(friction_force({0.0, 0.0, 2.0, 0.0}, 3.0), 6.0);
}

TEST(Friction, RefusesWhatIsNone) {
  const auto check = [](const Friction& f) { check_friction(f, "friction", 2); };
  EXPECT_NO_THROW(check({0.3, 0.5, 0.1, 0.02}));
  EXPECT_THROW(check({0.3, 0.2, 0.1, 0.02}), Error);
  EXPECT_THROW(check({-0.3, 0.2, 0.1, 0.02}), Error);
  EXPECT_THROW(check({0.3, 0.5, 0.1, 0.0}), Error);
  EXPECT_THROW(check({0.0, 0.0, -0.1, 0.0}), Error);
  EXPECT_THROW(check({0.0, std::nan(""), 0.1, 0.1}), Error);
}

TEST(Capstan, ForwardKinematicsOfKnownPoses) {
  const CapstanRobot robot;
  // (A.1) by hand: at zero angles the links are along x and -y; at (0, 90 deg) both along x.
  const RobotState zero = robot.at(Vector2::Zero(), Vector2::Zero());
  EXPECT_NEAR(zero.position.x(), 0.254, 1e-15);
  EXPECT_NEAR(zero.position.y(), -0.2667, 1e-15);
  const RobotState straight = robot.at({0.0, kPi / 2.0}, Vector2::Zero());
  EXPECT_NEAR(straight.position.x(), 0.5207, 1e-15);
  EXPECT_NEAR(straight.position.y(), 0.0, 1e-15);
  EXPECT_LT(jacobian_quality(straight.jacobian), 1e-12);  // stretched out: singular
}

TEST(Capstan, InverseUndoesForward) {
  const CapstanRobot robot;
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Vector2 q = some_pose(robot, random);
    const Vector2 back = robot.angles(robot.at(q, Vector2::Zero()).position);
    // (A.2) keeps 35 deg from the folded pose, but allows the stretched one where acos is steep.
    EXPECT_LT((back - q).norm(), 1e-7) << q.transpose();
  }
}

TEST(Capstan, JacobianAndItsRateAreDerivatives) {
  const CapstanRobot robot;
  Random random(2);
  const double h = 1e-6;  // central differences err by h^2 and by 1e-16 / h
  for (int i = 0; i < 100; ++i) {
    const Vector2 q = some_pose(robot, random);
    const Vector2 rate = some(random, 2.0);
    const RobotState s = robot.at(q, rate);
    for (int j = 0; j < 2; ++j) {
      const Vector2 step = h * Vector2::Unit(j);
      const Vector2 slope =
          (robot.at(q + step, rate).position - robot.at(q - step, rate).position) / (2.0 * h);
      EXPECT_LT((slope - s.jacobian.col(j)).norm(), 1e-9);
    }
    const Matrix2 change =
        (robot.at(q + h * rate, rate).jacobian - robot.at(q - h * rate, rate).jacobian) / (2.0 * h);
    EXPECT_LT((change - s.jacobian_rate).norm(), 1e-8);
  }
}

// The Coriolis terms follow from the kinetic energy T = q'^T I q' / 2 alone:
// d/dt (dT/dq') - dT/dq = I q'' + I' q' - dT/dq, so C q' = I' q' - dT/dq.
TEST(Capstan, CoriolisFollowsFromTheLagrangian) {
  const CapstanRobot robot;
  Random random(3);
  const double h = 1e-6;
  for (int i = 0; i < 100; ++i) {
    const Vector2 q = some_pose(robot, random);
    const Vector2 rate = some(random, 3.0);
    const auto inertia = [&](const Vector2& at) { return robot.at(at, rate).inertia; };
    const auto energy = [&](const Vector2& at) { return 0.5 * rate.dot(inertia(at) * rate); };
    const Matrix2 inertia_rate = (inertia(q + h * rate) - inertia(q - h * rate)) / (2.0 * h);
    Vector2 slope;
    for (int j = 0; j < 2; ++j) {
      const Vector2 step = h * Vector2::Unit(j);
      slope[j] = (energy(q + step) - energy(q - step)) / (2.0 * h);
    }
    const RobotState s = robot.at(q, rate);
    EXPECT_LT((s.coriolis * rate - (inertia_rate * rate - slope)).norm(), 1e-8);
    // With the sign printed in (A.6) this is not skew-symmetric.
    const Matrix2 n = inertia_rate - 2.0 * s.coriolis;
    EXPECT_LT((n + n.transpose()).norm(), 1e-8);
  }
}

TEST(Capstan, RegressorTimesParametersIsInverseDynamics) {
  const CapstanRobot robot;
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    const Vector2 q = some_pose(robot, random);
    const Vector2 rate = some(random, 2.0);
    const Vector2 acceleration = some(random, 20.0);
    const Vector2 torque = inverse_dynamics(robot, q, rate, acceleration, Vector2::Zero());
    EXPECT_LT((robot.regressor(q, rate, acceleration) * robot.parameters() - torque).norm(), 1e-14);
  }
}

TEST(Capstan, ForwardUndoesInverseDynamics) {
  const CapstanRobot robot = with_dry_friction();
  Random random(5);
  for (int i = 0; i < 100; ++i) {
    const Vector2 q = some_pose(robot, random);
    const Vector2 rate = some(random, 2.0);
    const Vector2 acceleration = some(random, 20.0);
    const Vector2 force = some(random, 10.0);
    const Vector2 torque = inverse_dynamics(robot, q, rate, acceleration, force);
    const Vector2 back = forward_dynamics(robot, q, rate, torque, force);
    EXPECT_LT((back - acceleration).norm(), 1e-12);
  }
}

// d/dt T = tau . q' + F . x' - F_r . q': what goes in is stored or lost to friction.
TEST(Capstan, PowerBalances) {
  const CapstanRobot robot = with_dry_friction();
  Random random(6);
  const double h = 1e-5;
  for (int i = 0; i < 100; ++i) {
    const Vector2 q = some_pose(robot, random);
    const Vector2 rate = some(random, 2.0);
    const Vector2 torque = some(random, 1.0);
    const Vector2 force = some(random, 5.0);
    const Vector2 acceleration = forward_dynamics(robot, q, rate, torque, force);
    const auto energy = [&](double t) {
      const Vector2 later = q + t * rate + 0.5 * t * t * acceleration;
      const Vector2 rate_later = rate + t * acceleration;
      return 0.5 * rate_later.dot(robot.at(later, rate_later).inertia * rate_later);
    };
    const RobotState s = robot.at(q, rate);
    const double power = torque.dot(rate) + force.dot(s.jacobian * rate) - s.friction.dot(rate);
    EXPECT_NEAR((energy(h) - energy(-h)) / (2.0 * h), power, 1e-6 * (1.0 + std::abs(power)));
  }
}

TEST(Capstan, QualityIsTheRatioOfSingularValues) {
  Random random(7);
  for (int i = 0; i < 100; ++i) {
    Matrix2 j;
    j << random.normal(), random.normal(), random.normal(), random.normal();
    const Eigen::JacobiSVD<Matrix2> svd(j);
    EXPECT_NEAR(jacobian_quality(j), svd.singularValues()[1] / svd.singularValues()[0], 1e-12);
  }
  EXPECT_EQ(jacobian_quality(Matrix2::Zero()), 0.0);
}

TEST(Capstan, SaysWhatIsOutOfReach) {
  const CapstanRobot robot;
  EXPECT_THROW(robot.angles({0.53, 0.0}), Error);
  EXPECT_THROW(robot.angles({0.005, 0.0}), Error);
  EXPECT_THROW(robot.angles({0.0, 0.0}), Error);
  EXPECT_THROW(robot.angles({std::nan(""), 0.3}), Error);
  EXPECT_NO_THROW(robot.angles({0.5207, 0.0}));
  Matrix positions(3, 2);
  positions << 0.38, 0.0, 0.4, 0.05, 0.9, 0.0;
  try {
    inverse_kinematics(robot, positions, false);
    FAIL() << "0.9 m is out of reach";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kData);
    EXPECT_EQ(error.detail(), "row 2");
    EXPECT_NE(std::string(error.what()).find("0.5207"), std::string::npos) << error.what();
  }
  positions.row(2) << 0.0, -0.45;  // within reach, but joint 1 would be below -55 deg
  EXPECT_THROW(inverse_kinematics(robot, positions, false), Error);
  EXPECT_NO_THROW(inverse_kinematics(robot, positions, true));
  EXPECT_THROW(usable_angles(robot, {0.5207, 0.0}, "centre_m", "the centre"), Error);  // singular
}

TEST(Capstan, LimitsOfTheMechanism) {
  const CapstanRobot robot;
  const auto broken = [&](double first, double second) {
    return robot.broken_limit(Vector2(first, second) * kPi / 180.0);
  };
  EXPECT_EQ(broken(43.9, 48.6), "");
  EXPECT_EQ(broken(90.0, 145.0), "");
  EXPECT_EQ(broken(-55.0, 0.0), "");
  EXPECT_NE(broken(-56.0, 0.0).find("joint 1"), std::string::npos);
  EXPECT_NE(broken(91.0, 90.0).find("joint 1"), std::string::npos);
  EXPECT_NE(broken(45.0, 146.0).find("joint 2"), std::string::npos);
  EXPECT_NE(broken(0.0, -1.0).find("joint 2"), std::string::npos);
  EXPECT_NE(broken(0.0, 56.0).find("collide"), std::string::npos);
  EXPECT_NE(broken(std::nan(""), 0.0), "");
}

TEST(Capstan, RefusesImpossibleParameters) {
  const auto refused = [](const std::function<void(CapstanParameters&)>& change) {
    CapstanParameters p;
    change(p);
    EXPECT_THROW(CapstanRobot{p}, Error);
  };
  refused([](auto& p) { p.link_m[0] = 0.0; });
  refused([](auto& p) { p.link_m[1] = std::nan(""); });
  refused([](auto& p) { p.alpha[0] = -0.07; });
  refused([](auto& p) { p.alpha[1] = 0.2; });  // not positive definite
  refused([](auto& p) { p.alpha[4] = -0.01; });
  refused([](auto& p) { p.alpha[2] = std::numeric_limits<double>::infinity(); });
  refused([](auto& p) { p.dry[0] = {0.1, 0.1, 0.0, 0.0}; });
  refused([](auto& p) { p.dry[1] = {0.1, 0.1, 0.3, 0.1}; });
}

}  // namespace
}  // namespace ulna
