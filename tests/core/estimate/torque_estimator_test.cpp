// The closed form against the system that it solves, written out and solved with dense matrices;
// then what 60.3 asks of it.
#include "estimate/torque_estimator.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "allocations.hpp"
#include "base/error.hpp"
#include "estimate/map_system.hpp"
#include "made_body.hpp"

namespace ulna {
namespace {

using made::Truth;
using Kind = BodySensorKind;

double largest(const Matrix& m) { return m.cwiseAbs().maxCoeff(); }

// The exact estimate and covariance of d: constrained least squares with multipliers.
struct Dense {
  Vector d;
  Matrix covariance;
};

Dense solve_dense(const MapSystem& s) {
  const Index n = s.unknowns();
  const Index c = s.dynamics.rows();
  const Matrix y(s.sensors);
  const Matrix w(s.sensors_weight);
  Matrix system = Matrix::Zero(n + c, n + c);
  system.topLeftCorner(n, n) = y.transpose() * w * y;
  system.topLeftCorner(n, n).diagonal() += s.prior_weight;
  system.topRightCorner(n, c) = Matrix(s.dynamics).transpose();
  system.bottomLeftCorner(c, n) = Matrix(s.dynamics);
  Vector rhs(n + c);
  rhs << y.transpose() * w * (s.measured - s.sensors_bias) +
             s.prior_weight.cwiseProduct(s.prior_mean),
      -s.dynamics_bias;
  const Matrix inverse = system.fullPivLu().inverse();
  return {(inverse * rhs).head(n), inverse.topLeftCorner(n, n)};
}

// Every kind of sensor, in every frame.
std::vector<BodySensor> every_kind() {
  Random random(77);
  const auto sensor = [&](const char* name, Kind kind, Index link, SensorFrame frame,
                          Vector deviation) {
    return BodySensor{.name = name,
                      .kind = kind,
                      .link = link,
                      .position = made::three(random, 0.1),
                      .orientation = made::rotation(random),
                      .frame = frame,
                      .deviation = std::move(deviation)};
  };
  return {
      sensor("a0", Kind::kAccelerometer, 0, SensorFrame::kLink, Vector3(0.1, 0.2, 0.3)),
      sensor("a5", Kind::kAccelerometer, 5, SensorFrame::kWorldAxes, Vector3(0.3, 0.2, 0.1)),
      sensor("a4", Kind::kAccelerometer, 4, SensorFrame::kLink, Vector::Constant(1, 0.1)),
      sensor("w9", Kind::kAngularAcceleration, 9, SensorFrame::kLink, Vector3(1, 2, 3)),
      sensor("j1", Kind::kJointAcceleration, 1, SensorFrame::kLink, Vector::Constant(1, 0.5)),
      sensor("j8", Kind::kJointAcceleration, 8, SensorFrame::kLink, Vector::Constant(1, 0.7)),
      sensor("shoe", Kind::kExternalWrench, 11, SensorFrame::kLink, Eigen::Vector2d(2.0, 0.5)),
      sensor("plate", Kind::kExternalWrench, 10, SensorFrame::kWorld, Eigen::Vector2d(1.0, 0.3)),
      sensor("device", Kind::kExternalForce, 10, SensorFrame::kWorldAxes, Vector::Constant(1, 3.0)),
      sensor("hand", Kind::kFreeWrench, 6, SensorFrame::kLink, Eigen::Vector2d(100.0, 20.0)),
      sensor("wall", Kind::kFreeForce, 7, SensorFrame::kLink, Vector::Constant(1, 50.0)),
  };
}

// Priors that do not spread the numbers over more decades than the dense solution bears.
BodyPrior gentle() {
  return {.base_acceleration = 20.0,
          .base_angular_acceleration = 30.0,
          .joint_acceleration = 30.0,
          .force = 100.0,
          .moment = 50.0,
          .untouched_force = 0.1,
          .untouched_moment = 0.02};
}

void expect_exact(const TorqueEstimator& estimator, const MapSystem& system, const Truth& t) {
  const BodyTree& body = estimator.suite().body();
  const MapLayout at(body);
  const Dense dense = solve_dense(system);
  const TorqueFrame& f = estimator.frame();
  const Vector deviation = dense.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  // Both solve the same system; the dense one loses digits to 1e4 between its largest and smallest.
  constexpr double kClose = 1e-7;
  const auto expect_close = [&](double value, double expected, const std::string& what) {
    EXPECT_NEAR(value, expected, kClose * std::max(1.0, std::fabs(expected))) << what;
  };
  for (Index i = 0; i < body.size(); ++i) {
    for (Index k = 0; k < 6; ++k) {
      const std::string what = body.link(i).name + " " + std::to_string(k);
      expect_close(f.external(k, i), dense.d[at.external(i) + k], what);
      expect_close(f.external_deviation(k, i), deviation[at.external(i) + k], what);
      if (i == 0) continue;
      expect_close(f.joint_wrench(k, i), dense.d[at.joint_wrench(i) + k], what);
      expect_close(f.joint_wrench_deviation(k, i), deviation[at.joint_wrench(i) + k], what);
    }
  }
  for (Index k = 0; k < body.dofs(); ++k) {
    const Index link = body.link_of_dof(k);
    expect_close(f.joint_acceleration[k], dense.d[at.joint_acceleration(k)], "q''");
    expect_close(f.joint_acceleration_deviation[k], deviation[at.joint_acceleration(k)], "q''");
    const Vector3 axis = body.link(link).axis;
    const Index w = at.joint_wrench(link) + 3;
    expect_close(f.torque[k], axis.dot(dense.d.segment<3>(w)), "torque");
    expect_close(f.torque_deviation[k],
                 std::sqrt(axis.dot(dense.covariance.block<3, 3>(w, w) * axis)), "torque");
  }
  const Matrix3& axes = t.state.orientation;
  EXPECT_LT(largest(axes.transpose() * f.base_acceleration.head<3>() - dense.d.head<3>()), kClose);
  EXPECT_LT(largest(axes.transpose() * f.base_acceleration.tail<3>() - dense.d.segment<3>(3)),
            kClose);
  // Innovations: measured - estimated, and the deviation that is left of the noise.
  const Vector left = system.measured - system.sensors_bias - system.sensors * dense.d;
  const Matrix y(system.sensors);
  const Matrix noise =
      Matrix(system.sensors_weight).inverse() - y * dense.covariance * y.transpose();
  Index row = 0;  // of the system
  for (Index s = 0; s < estimator.suite().size(); ++s) {
    const BodySensor& sensor = estimator.suite().sensor(s);
    if (sensor.kind >= Kind::kExternalWrench && sensor.kind <= Kind::kFreeForce) continue;
    for (Index k = 0; k < sensor_rows(sensor.kind); ++k) {
      const Index own = estimator.suite().row(s) + k;
      if (std::isnan(f.innovation[own])) continue;
      expect_close(f.innovation[own], left[row], sensor.name);
      expect_close(f.innovation_deviation[own], std::sqrt(std::max(0.0, noise(row, row))),
                   sensor.name);
      ++row;
    }
  }
}

TEST(MapSystem, HoldsForTheTruth) {
  for (const auto& body : {made::human(), made::human(HumanJoints::k66), made::small_tree(1)}) {
    const SensorSuite suite(body, body->size() == 12 ? every_kind() : made::suit(*body));
    const Truth t = made::make_truth(body, 5, {body->size() - 1, body->size() / 2});
    const Vector y = made::readings(suite, t);
    const MapSystem system = map_system(suite, t.state, y);
    const MapLayout at(*body);
    if (body->dofs() == 48) {
      EXPECT_EQ(system.unknowns(), 924);
      EXPECT_EQ(system.dynamics.rows(), 582);
    }
    BodyMotion motion(body);
    motion.move(t.state);
    motion.accelerate(t.base, t.joint);
    Vector d(system.unknowns());
    for (Index i = 0; i < body->size(); ++i) {
      const Matrix3 axes = motion.link(i).axes.transpose();
      const Vector6 a = motion.acceleration(i);
      d.segment<3>(at.acceleration(i)) = axes * a.head<3>();
      d.segment<3>(at.acceleration(i) + 3) = axes * a.tail<3>();
      d.segment<6>(at.external(i)) = t.external.col(i);
      if (i > 0) d.segment<6>(at.joint_wrench(i)) = t.joint_wrench.col(i);
    }
    d.tail(body->dofs()) = t.joint;
    // Rounding of wrenches of some hundreds.
    EXPECT_LT(largest(system.dynamics * d + system.dynamics_bias), 1e-10);
    // External wrenches of links with several contacts are not shared out as the sensors read them.
    const Index motion_rows = system.measured.size() - 6 * body->size();
    EXPECT_LT(
        largest((system.sensors * d + system.sensors_bias - system.measured).head(motion_rows)),
        1e-10);
  }
}

TEST(TorqueEstimator, SolvesTheSystemExactly) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto body = made::small_tree(seed);
    const auto suite = std::make_shared<const SensorSuite>(body, every_kind(), gentle());
    const Truth t = made::make_truth(body, seed, {11, 10, 6});
    Vector y = made::noisy(*suite, made::readings(*suite, t), seed, 2);
    if (seed == 3) y[suite->row(0) + 1] = kNaN;  // one axis of an accelerometer
    if (seed == 4) {                             // a whole one, a joint, half a shoe
      y.segment<3>(suite->row(1)).setConstant(kNaN);
      y[suite->row(4)] = kNaN;
      y.segment<3>(suite->row(6)).setConstant(kNaN);
    }
    TorqueEstimator estimator(suite);
    EXPECT_TRUE(estimator.update(t.state, y, true).usable);
    expect_exact(estimator, map_system(*suite, t.state, y), t);
  }
}

TEST(TorqueEstimator, TakesMeasuredTorquesAndWrenchesOfJoints) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto body = made::small_tree(seed);
    std::vector<BodySensor> sensors = every_kind();
    sensors.push_back({.name = "t3",
                       .kind = Kind::kJointTorque,
                       .link = 3,
                       .deviation = Vector::Constant(1, 0.4)});
    sensors.push_back({.name = "t10",
                       .kind = Kind::kJointTorque,
                       .link = 10,
                       .deviation = Vector::Constant(1, 0.6)});
    sensors.push_back({.name = "cell",
                       .kind = Kind::kJointWrench,
                       .link = 4,
                       .deviation = Eigen::Vector2d(1.0, 0.2)});
    const auto suite = std::make_shared<const SensorSuite>(body, sensors, gentle());
    const Truth t = made::make_truth(body, seed, {11, 10, 6});
    Vector y = made::noisy(*suite, made::readings(*suite, t), seed, 2);
    if (seed == 2) y[suite->row(suite->size() - 3)] = kNaN;
    if (seed == 3) y[suite->row(suite->size() - 1) + 4] = kNaN;
    TorqueEstimator estimator(suite);
    estimator.update(t.state, y, true);
    expect_exact(estimator, map_system(*suite, t.state, y), t);
  }
}

std::shared_ptr<const SensorSuite> suit_of(std::shared_ptr<const BodyTree> body,
                                           const BodyPrior& prior = {}) {
  return std::make_shared<const SensorSuite>(body, made::suit(*body), prior);
}

std::vector<Index> feet(const BodyTree& body) {
  return {body.at_link("RightFoot"), body.at_link("LeftFoot")};
}

TEST(TorqueEstimator, GivesInverseDynamicsForExactMeasurements) {
  for (const HumanJoints joints : {HumanJoints::k48, HumanJoints::k66}) {
    const auto body = made::human(joints);
    // A prior that says nothing: it would pull by its share of the information.
    const auto suite = suit_of(
        body,
        {.base_acceleration = 1e6, .base_angular_acceleration = 1e6, .joint_acceleration = 1e6});
    TorqueEstimator estimator(suite);
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      const Truth t = made::make_truth(body, seed, feet(*body));
      const TorqueFrame& f = estimator.update(t.state, made::readings(*suite, t), true);
      EXPECT_LT(largest(f.torque - t.torque), 1e-9);
      EXPECT_LT(largest(f.external - t.external), 1e-9);
      EXPECT_LT(largest(f.joint_wrench.rightCols(body->size() - 1) -
                        t.joint_wrench.rightCols(body->size() - 1)),
                1e-9);
      EXPECT_LT(largest(f.joint_acceleration - t.joint), 1e-9);
      EXPECT_LT(largest(f.residual), 1e-9);
      EXPECT_LT(largest(f.innovation), 1e-9);
    }
  }
}

TEST(TorqueEstimator, DoesNotDependOnBaseFramesAndSigns) {
  const auto body = made::human();
  const auto suite = suit_of(body);
  const Truth t = made::make_truth(body, 3, feet(*body));
  const Vector y = made::noisy(*suite, made::readings(*suite, t), 3, 4);
  TorqueEstimator estimator(suite);
  const TorqueFrame f = estimator.update(t.state, y, true);

  // The world turned: about the vertical and otherwise, for nothing but the prior knows gravity.
  Random random(9);
  const Matrix3 turn = made::rotation(random);
  Truth turned = t;
  turned.state.orientation = turn * t.state.orientation;
  turned.state.angular_velocity = turn * t.state.angular_velocity;
  turned.state.position = Vector3(10.0, -20.0, 3.0);
  const TorqueFrame g = estimator.update(turned.state, y, true);
  // The prior's share: (100 m/s^2 against 0.1 m/s^2 of 17 sensors) times gravity.
  EXPECT_LT(largest(f.torque - g.torque), 1e-4);
  EXPECT_LT(largest(f.torque_deviation - g.torque_deviation), 1e-9);
  EXPECT_LT(largest(turn * f.residual.head<3>() - g.residual.head<3>()), 1e-3);

  // An axis of a joint the other way round: its angle, rate, acceleration and torque change sign.
  std::vector<BodyLink> links = body->links();
  const Index flipped = body->at_joint("jRightShoulder_roty");
  links[static_cast<std::size_t>(flipped)].axis *= -1.0;
  const auto mirrored = std::make_shared<const BodyTree>(BodyTree(links));
  const auto other = suit_of(mirrored);
  const Index k = body->dof(flipped);
  BodyState state = t.state;
  state.angle[k] *= -1.0;
  state.rate[k] *= -1.0;
  Vector z = y;
  z[other->row(other->find("ddq_jRightShoulder_roty"))] *= -1.0;
  TorqueEstimator signs(other);
  const TorqueFrame h = signs.update(state, z, true);
  Vector torque = h.torque;
  torque[k] *= -1.0;
  EXPECT_LT(largest(f.torque - torque), 1e-10);
  EXPECT_LT(largest(f.torque_deviation - h.torque_deviation), 1e-10);

  // Another base. What is measured of the motion must not depend on the prior of the base.
  const BodyPrior open{
      .base_acceleration = 1e5, .base_angular_acceleration = 1e5, .joint_acceleration = 1e5};
  const auto of_pelvis = suit_of(body, open);
  TorqueEstimator pelvis(of_pelvis);
  const TorqueFrame p = pelvis.update(t.state, y, true);
  const auto from_hand = std::make_shared<const BodyTree>(rebased(*body, "RightHand"));
  BodyMotion motion(body);
  motion.move(t.state);
  // The same sensors at the same places: frames of links between the two bases have moved.
  BodyState hand;
  const Index link = body->at_link("RightHand");
  hand.position = motion.position(link);
  hand.orientation = motion.link(link).axes;
  hand.angular_velocity = motion.link(link).turn;
  hand.angle.resize(48);
  hand.rate.resize(48);
  for (Index j = 0; j < 48; ++j) {
    const Index was = body->dof(body->at_joint(from_hand->link(from_hand->link_of_dof(j)).joint));
    hand.angle[j] = t.state.angle[was];
    hand.rate[j] = t.state.rate[was];
  }
  BodyMotion moved(from_hand);
  moved.move(hand);
  std::vector<BodySensor> sensors = of_pelvis->sensors();
  for (BodySensor& sensor : sensors) {
    const LinkMotion& was = motion.link(sensor.link);
    const Vector3 at = motion.position(sensor.link, sensor.position);
    const Matrix3 axes = was.axes * sensor.orientation;
    const std::string joint = body->link(sensor.link).joint;
    sensor.link = sensor.kind == Kind::kJointAcceleration
                      ? from_hand->at_joint(joint)
                      : from_hand->at_link(body->link(sensor.link).name);
    const LinkMotion& now = moved.link(sensor.link);
    sensor.position = now.axes.transpose() * (at - moved.position(sensor.link));
    sensor.orientation = now.axes.transpose() * axes;
  }
  const auto rebased_suite = std::make_shared<const SensorSuite>(from_hand, sensors, open);
  TorqueEstimator rebased_estimator(rebased_suite);
  const TorqueFrame r = rebased_estimator.update(hand, y, true);
  for (Index j = 0; j < 48; ++j) {
    const Index was = body->dof(body->at_joint(from_hand->link(from_hand->link_of_dof(j)).joint));
    // Wrenches of untouched links turn about other origins; priors of 1e5 leave some 1e-6.
    EXPECT_NEAR(r.torque[j], p.torque[was], 1e-5);
    EXPECT_NEAR(r.torque_deviation[j], p.torque_deviation[was], 1e-5);
  }
}

TEST(TorqueEstimator, FreeFallGivesNoTorque) {
  const auto body = made::human();
  const auto suite = suit_of(body);
  TorqueEstimator estimator(suite);
  BodyState state;
  state.angle = Vector::Random(48);
  state.rate = Vector::Zero(48);
  const TorqueFrame& f = estimator.update(state, Vector::Zero(suite->rows()), false);
  // The prior expects gravity and is overruled 1e7 times.
  EXPECT_LT(largest(f.torque), 1e-4);
}

// Normalised squared errors of torques and coverage of their intervals over many noisy frames.
TEST(TorqueEstimator, KnowsItsErrors) {
  const auto body = made::human();
  for (const bool missing : {false, true}) {
    const auto suite = suit_of(body);
    TorqueEstimator estimator(suite);
    double squares = 0.0, inside = 0.0, count = 0.0, balance = 0.0, motion = 0.0, freedom = 0.0;
    double innovations = 0.0, rows = 0.0, likelihood = 0.0;
    constexpr int kFrames = 1500;
    for (std::uint64_t frame = 0; frame < kFrames; ++frame) {
      const Truth t = made::make_truth(body, frame, feet(*body), suite->prior());
      Vector y = made::noisy(*suite, made::readings(*suite, t), 11, frame);
      if (missing) {  // an accelerometer and a few others
        y.segment<3>(suite->row(4)).setConstant(kNaN);
        y[suite->row(30)] = kNaN;
        y[static_cast<Index>(frame) % suite->rows()] = kNaN;
      }
      const TorqueFrame& f = estimator.update(t.state, y, true);
      for (Index k = 0; k < 48; ++k) {
        const double e = (f.torque[k] - t.torque[k]) / f.torque_deviation[k];
        squares += e * e;
        inside += std::fabs(e) < 1.959964 ? 1.0 : 0.0;
        count += 1.0;
      }
      for (Index k = 0; k < suite->rows(); ++k) {
        if (std::isnan(f.innovation[k])) continue;
        const double e = f.innovation[k] / f.innovation_deviation[k];
        innovations += e * e;
        rows += 1.0;
      }
      balance += f.balance_nis;
      motion += f.motion_nis;
      freedom += f.motion_freedom;
      likelihood += f.log_likelihood;
    }
    // 60.3's gates; torques of one frame are correlated, so the spread is about 1 % here.
    EXPECT_GT(squares / count, 0.98);
    EXPECT_LT(squares / count, 1.02);
    EXPECT_GT(inside / count, 0.94);
    EXPECT_LT(inside / count, 0.96);
    // chi^2 with 6: standard error of the mean 3.5/sqrt(1500) = 0.09.
    EXPECT_NEAR(balance / kFrames, 6.0, 0.3);
    // About 51 degrees of freedom: 10/sqrt(1500) = 0.26.
    EXPECT_NEAR(motion / kFrames, freedom / kFrames, 0.9);
    EXPECT_NEAR(innovations / rows, 1.0, 0.02);
  }
}

TEST(TorqueEstimator, WidensWhereSomethingIsMissing) {
  const auto body = made::human();
  const auto suite = suit_of(body);
  const Truth t = made::make_truth(body, 2, feet(*body));
  const Vector y = made::noisy(*suite, made::readings(*suite, t), 5, 6);
  TorqueEstimator estimator(suite);
  const TorqueFrame full = estimator.update(t.state, y, true);
  for (Index s = 0; s < suite->size(); ++s) {
    const Index count = sensor_rows(suite->sensor(s).kind);
    Vector z = y;
    z.segment(suite->row(s), count).setConstant(kNaN);
    const TorqueFrame& f = estimator.update(t.state, z, true);
    SCOPED_TRACE(suite->sensor(s).name);
    EXPECT_TRUE(f.usable);
    EXPECT_TRUE(f.torque.allFinite());
    EXPECT_GE((f.torque_deviation - full.torque_deviation).minCoeff(), -1e-9);
    // Not as if a zero had been read: the truth stays inside.
    EXPECT_LT(((f.torque - t.torque).cwiseQuotient(f.torque_deviation)).cwiseAbs().maxCoeff(), 5.0);
    EXPECT_TRUE(std::isnan(f.innovation[suite->row(s)]));
  }
  // Nothing measured at all: the prior, wide.
  const TorqueFrame& none = estimator.update(t.state, Vector::Constant(suite->rows(), kNaN), true);
  EXPECT_TRUE(none.torque.allFinite());
  EXPECT_GT(none.torque_deviation.minCoeff(), full.torque_deviation.minCoeff());
  // A state that is not there gives a frame that says so.
  BodyState lost = t.state;
  lost.angle[3] = kNaN;
  const TorqueFrame& unusable = estimator.update(lost, y, true);
  EXPECT_FALSE(unusable.usable);
  EXPECT_TRUE(unusable.torque.array().isNaN().all());
  EXPECT_TRUE(estimator.update(t.state, y, true).usable);
  EXPECT_EQ(largest(estimator.frame().torque - full.torque), 0.0);
}

TEST(TorqueEstimator, StackFollowsTheMomentumAsItIsTrusted) {
  const auto body = made::human();
  const auto suite = suit_of(body);
  const Truth t = made::make_truth(body, 2, feet(*body));
  const Vector exact = made::readings(*suite, t);
  // Exact measurements: the same as in one shot.
  TorqueEstimator stack(suite, {.scheme = TorqueScheme::kStack});
  TorqueEstimator shot(suite);
  EXPECT_LT(
      largest(stack.update(t.state, exact, true).torque - shot.update(t.state, exact, true).torque),
      1e-6);
  // Shoes that read 30 N too much: task 1 takes them back to the momentum when it is trusted, and
  // leaves them when not.
  Vector biased = exact;
  biased[suite->row(suite->find("shoe_RightFoot")) + 2] += 30.0;
  const Index foot = body->at_link("RightFoot");
  const auto error = [&](double trusted) {
    TorqueEstimator e(suite, {TorqueScheme::kStack, trusted, trusted});
    return (e.update(t.state, biased, true).external.col(foot) - t.external.col(foot)).norm();
  };
  EXPECT_LT(error(0.1), 0.9 * error(300.0));
  // Free hands are found by the momentum alone.
  std::vector<BodySensor> sensors = suite->sensors();
  const Index hand = body->at_link("RightHand");
  sensors.push_back({.name = "hand", .kind = Kind::kFreeWrench, .link = hand});
  const auto open = std::make_shared<const SensorSuite>(body, sensors);
  const Truth held =
      made::make_truth(body, 4, {body->at_link("RightFoot"), body->at_link("LeftFoot"), hand});
  for (const TorqueScheme scheme : {TorqueScheme::kOneShot, TorqueScheme::kStack}) {
    TorqueEstimator e(open,
                      {.scheme = scheme, .momentum_rate_force = 0.1, .momentum_rate_moment = 0.1});
    const TorqueFrame& f = e.update(held.state, made::readings(*open, held), true);
    // Shrunk by its prior of 1000 N and 300 N m, of which little is left.
    EXPECT_LT(largest(f.external.col(hand) - held.external.col(hand)), 0.05);
    EXPECT_LT(largest(f.torque - held.torque), 0.05);
  }
  EXPECT_THROW(TorqueEstimator(suite, {.momentum_rate_force = 0.0}), Error);
  sensors.push_back({.name = "torque",
                     .kind = Kind::kJointTorque,
                     .link = hand,
                     .deviation = Vector::Constant(1, 1.0)});
  const auto joint = std::make_shared<const SensorSuite>(body, sensors);
  EXPECT_THROW(TorqueEstimator(joint, {.scheme = TorqueScheme::kStack}), Error);
}

TEST(TorqueEstimator, AllocatesNothingOnceMade) {
  const auto body = made::human();
  std::vector<BodySensor> sensors = made::suit(*body);
  for (const bool joint_sensors : {false, true}) {
    if (joint_sensors) {
      sensors.push_back({.name = "torque",
                         .kind = Kind::kJointTorque,
                         .link = body->at_joint("jRightElbow_rotz"),
                         .deviation = Vector::Constant(1, 1.0)});
    }
    const auto suite = std::make_shared<const SensorSuite>(body, sensors);
    const Truth t = made::make_truth(body, 2, feet(*body));
    const Vector y = made::readings(*suite, t);
    TorqueEstimator estimator(suite);
    const long count = made::allocations_of([&] {
      for (int k = 0; k < 10; ++k) estimator.update(t.state, y, true);
    });
    if (count < 0) GTEST_SKIP() << "a sanitizer has taken the allocator over";
    EXPECT_EQ(count, 0);
  }
}

TEST(SensorSuite, RefusesWhatIsNoSensor) {
  const auto body = made::human();
  const auto refused = [&](BodySensor sensor, const char* words) {
    try {
      const SensorSuite suite(body, {std::move(sensor)});
      ADD_FAILURE() << "accepted: " << words;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  const BodySensor good{.name = "imu", .link = 3, .deviation = Vector::Constant(1, 0.1)};
  const auto with = [&](auto change) {
    BodySensor sensor = good;
    change(sensor);
    return sensor;
  };
  EXPECT_EQ(SensorSuite(body, {good}).rows(), 3);
  refused(with([](auto& s) { s.name = ""; }), "no name");
  refused(with([](auto& s) { s.link = 49; }), "links 0 to 48");
  refused(with([](auto& s) { s.link = -1; }), "'imu'");
  refused(with([](auto& s) { s.deviation = Vector(); }), "0 deviations for 3 rows");
  refused(with([](auto& s) { s.deviation = Vector::Constant(1, 0.0); }), "not positive");
  refused(with([](auto& s) { s.deviation = Vector::Constant(1, kNaN); }), "not positive");
  refused(with([](auto& s) { s.position.x() = kNaN; }), "not finite");
  refused(with([](auto& s) { s.orientation *= 2.0; }), "no rotation");
  refused(with([](auto& s) { s.frame = SensorFrame::kWorld; }), "place in the world");
  refused(with([](auto& s) { s.kind = Kind::kJointTorque, s.link = 0; }), "hinge");
  refused(with([](auto& s) { s.kind = Kind::kJointWrench, s.link = 0; }), "base");
  EXPECT_THROW(SensorSuite(body, {good, good}), Error);
  EXPECT_THROW(SensorSuite(body, {good}, {.force = 0.0}), Error);
  EXPECT_THROW(SensorSuite(body, {good}).with_deviations(Vector::Ones(4)), Error);
  EXPECT_EQ(SensorSuite(body, {good}).with_deviations(Vector::Ones(3)).deviations(),
            Vector::Ones(3));
}

}  // namespace
}  // namespace ulna
