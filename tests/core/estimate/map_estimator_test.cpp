// The block factorisation along the tree against the sparse system written out, and against the
// closed form where the dynamics are exact.
#include "estimate/map_estimator.hpp"

#include <gtest/gtest.h>

#include "allocations.hpp"
#include "base/error.hpp"
#include "estimate/torque_estimator.hpp"
#include "literal_map.hpp"
#include "made_body.hpp"

namespace ulna {
namespace {

using Kind = BodySensorKind;

double largest(const Matrix& m) { return m.cwiseAbs().maxCoeff(); }

std::vector<BodySensor> with_joint_sensors(const BodyTree& body) {
  std::vector<BodySensor> sensors = made::suit(body);
  sensors.push_back({.name = "elbow",
                     .kind = Kind::kJointTorque,
                     .link = body.at_joint("jRightElbow_rotz"),
                     .deviation = Vector::Constant(1, 0.3)});
  sensors.push_back({.name = "neck",
                     .kind = Kind::kJointWrench,
                     .link = body.at_joint("jT1C7_rotz"),
                     .deviation = Eigen::Vector2d(2.0, 0.4)});
  sensors.push_back({.name = "spine",
                     .kind = Kind::kJointTorque,
                     .link = body.at_joint("jL4L3_roty"),
                     .deviation = Vector::Constant(1, 1.0)});
  sensors.push_back({.name = "turn",
                     .kind = Kind::kAngularAcceleration,
                     .link = 0,
                     .deviation = Vector::Constant(1, 0.5)});
  return sensors;
}

TEST(MapEstimator, SolvesTheSystemThatIsWrittenOut) {
  const auto body = made::human();
  // Weights over few decades, so that the normal equations keep enough digits.
  const BodyPrior prior{.base_acceleration = 20.0,
                        .base_angular_acceleration = 30.0,
                        .joint_acceleration = 30.0,
                        .force = 100.0,
                        .moment = 50.0,
                        .untouched_force = 0.1,
                        .untouched_moment = 0.05};
  const ModelDeviation model{0.5, 0.1, 0.05, 0.2};
  for (const bool joints : {false, true}) {
    const auto suite = std::make_shared<const SensorSuite>(
        body, joints ? with_joint_sensors(*body) : made::suit(*body), prior);
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
      const made::Truth t =
          made::make_truth(body, seed, {body->at_link("RightFoot"), body->at_link("LeftFoot")});
      Vector y = made::noisy(*suite, made::readings(*suite, t), seed, 3);
      if (seed == 2) y.segment<8>(suite->rows() - 8).setConstant(kNaN);
      MapEstimator estimator(suite, model);
      const MapFrame& f = estimator.update(t.state, y);
      const made::Normal normal =
          made::normal_equations(map_system(*suite, t.state, y), *body, model);
      const Eigen::SimplicialLDLT<SparseMatrix> solver(normal.information);
      ASSERT_EQ(solver.info(), Eigen::Success);
      const Vector d = solver.solve(normal.rhs);
      const MapLayout at(*body);
      const double size = largest(d);
      for (Index i = 0; i < body->size(); ++i) {
        EXPECT_LT(largest(f.acceleration.col(i) - d.segment<6>(at.acceleration(i))), 1e-6 * size);
        EXPECT_LT(largest(f.external.col(i) - d.segment<6>(at.external(i))), 1e-6 * size);
        if (i == 0) continue;
        EXPECT_LT(largest(f.joint_wrench.col(i) - d.segment<6>(at.joint_wrench(i))), 1e-6 * size);
      }
      EXPECT_LT(largest(f.joint_acceleration - d.tail(48)), 1e-6 * size);
    }
  }
}

TEST(MapEstimator, IsTheClosedFormWhereDynamicsAreExact) {
  for (const HumanJoints joints : {HumanJoints::k48, HumanJoints::k66}) {
    const auto body = made::human(joints);
    for (const bool extra : {false, true}) {
      if (extra && joints == HumanJoints::k66) continue;
      const auto suite = std::make_shared<const SensorSuite>(
          body, extra ? with_joint_sensors(*body) : made::suit(*body));
      const made::Truth t =
          made::make_truth(body, 7, {body->at_link("RightFoot"), body->at_link("LeftFoot")});
      Vector y = made::noisy(*suite, made::readings(*suite, t), 7, 3);
      y[5] = kNaN;
      TorqueEstimator closed(suite);
      const TorqueFrame& c = closed.update(t.state, y, false);
      for (const double deviation : {0.0, 1e-6}) {
        MapEstimator sparse(suite, {deviation, deviation, deviation, deviation});
        const MapFrame& s = sparse.update(t.state, y);
        // Equal to 1e-6 of the largest.
        EXPECT_LT(largest(s.torque - c.torque), 1e-6 * largest(c.torque));
        EXPECT_LT(largest(s.external - c.external), 1e-6 * largest(c.external));
        EXPECT_LT(largest(s.joint_acceleration - c.joint_acceleration),
                  1e-6 * largest(c.joint_acceleration));
        EXPECT_LT(largest(s.base_acceleration - c.base_acceleration),
                  1e-6 * largest(c.base_acceleration));
        EXPECT_LT(largest(s.joint_wrench.rightCols(body->size() - 1) -
                          c.joint_wrench.rightCols(body->size() - 1)),
                  1e-6 * largest(c.joint_wrench));
      }
    }
  }
}

TEST(MapEstimator, IsForRealTimeAndChecked) {
  const auto body = made::human();
  const auto suite = std::make_shared<const SensorSuite>(body, with_joint_sensors(*body));
  const made::Truth t =
      made::make_truth(body, 7, {body->at_link("RightFoot"), body->at_link("LeftFoot")});
  const Vector y = made::readings(*suite, t);
  MapEstimator estimator(suite);
  const long count = made::allocations_of([&] { estimator.update(t.state, y); });
  if (count >= 0) {
    EXPECT_EQ(count, 0);
  }
  BodyState lost = t.state;
  lost.rate[0] = kNaN;
  EXPECT_FALSE(estimator.update(lost, y).usable);
  EXPECT_TRUE(estimator.frame().torque.array().isNaN().all());
  EXPECT_TRUE(estimator.update(t.state, y).usable);
  EXPECT_THROW(MapEstimator(suite, {.force = -1.0}), Error);
  EXPECT_THROW(MapEstimator(suite, {.moment = kNaN}), Error);
}

}  // namespace
}  // namespace ulna
