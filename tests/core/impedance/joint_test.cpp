#include "impedance/joint.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

const TwoLink kArm{0.31, 0.34, -0.1, -0.2, false};
const Eigen::Vector2d kPosture(0.7, 1.3);

Vector natural() {
  Vector out(12);
  out << 1.3, 0.2, 0.2, 1.8, 8.0, -1.0, -1.0, 12.0, 120.0, -40.0, -40.0, 300.0;
  return out;
}

TEST(Joint, StiffnessIsMinusTheDerivativeOfTheTorque) {
  const Eigen::Vector2d force(6.0, -9.0);
  Eigen::Matrix2d k;
  k << 120.0, -40.0, -40.0, 300.0;
  const Eigen::Vector2d x0 = hand_of(kArm, kPosture);
  const auto torque = [&](const Eigen::Vector2d& q) {
    return Eigen::Vector2d(jacobian_of(kArm, q).transpose() *
                           (force - k * (hand_of(kArm, q) - x0)));
  };
  const JointImpedance z = to_joint(natural(), {}, posture_of(kArm, kPosture), force, {});
  constexpr double kStep = 1e-5;
  for (Index c = 0; c < 2; ++c) {
    const Eigen::Vector2d d = kStep * Eigen::Vector2d::Unit(c);
    const Eigen::Vector2d slope = (torque(kPosture + d) - torque(kPosture - d)) / (2.0 * kStep);
    // Central differences err by 1e-10, rounding by 1e-16 / 1e-5.
    EXPECT_NEAR(z.k(0, c), -slope[0], 1e-7);
    EXPECT_NEAR(z.k(1, c), -slope[1], 1e-7);
  }
  // A force that does not change with the posture is the gradient of F . x(q): no asymmetry.
  EXPECT_NEAR(z.k(0, 1), z.k(1, 0), 1e-12);
}

TEST(Joint, ThereAndBack) {
  const Vector force = (Vector(2) << 6.0, -9.0).finished();
  const Matrix covariance = Matrix::Identity(12, 12) * 0.01;
  const Posture posture = posture_of(kArm, kPosture);
  const JointImpedance z = to_joint(natural(), covariance, posture, force, {});
  Vector at_joints(12);
  Index at = 0;
  for (const Matrix* m : {&z.m, &z.b, &z.k}) {
    for (Index i = 0; i < 2; ++i) {
      for (Index j = 0; j < 2; ++j) at_joints[at++] = (*m)(i, j);
    }
  }
  const JointImpedance back = to_endpoint(at_joints, z.covariance, posture, force, {});
  EXPECT_NEAR(back.k(0, 1), -40.0, 1e-9);
  EXPECT_NEAR(back.m(1, 1), 1.8, 1e-12);
  EXPECT_LT((back.covariance - covariance).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Joint, RefusesASingularPostureByName) {
  const Posture straight = posture_of(kArm, {0.5, 1e-12});
  try {
    to_endpoint(natural(), {}, straight, Vector::Zero(2), {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kAnalysis);
    EXPECT_NE(std::string(error.what()).find("singular"), std::string::npos);
  }
  Posture wide = straight;
  wide.jacobian = Matrix::Ones(2, 3);
  wide.slope.assign(3, Matrix::Zero(2, 3));
  EXPECT_THROW(to_endpoint(natural(), {}, wide, Vector::Zero(2), {}), Error);
  Posture wrong = posture_of(kArm, kPosture);
  wrong.slope[1](0, 0) += 0.1;
  EXPECT_THROW(to_joint(natural(), {}, wrong, Vector::Zero(2), {}), Error);
}

TEST(Joint, PassivityCountsDraws) {
  JointImpedance z = to_joint(natural(), {}, posture_of(kArm, kPosture), Vector::Zero(2), {});
  EXPECT_DOUBLE_EQ(joint_passivity(z, 0.95, 100, 0).probability, 1.0);
  z.covariance = Matrix::Zero(12, 12);
  z.covariance(0, 0) = 1e4;  // an inertia that is hardly known
  const JointPassivity p = joint_passivity(z, 0.95, 2000, 0);
  EXPECT_GT(p.probability, 0.4);
  EXPECT_LT(p.probability, 0.6);
  EXPECT_LT(p.interval[0][0], 0.0);
  EXPECT_THROW(joint_passivity(z, 1.5, 2000, 0), Error);
}

}  // namespace
}  // namespace ulna
