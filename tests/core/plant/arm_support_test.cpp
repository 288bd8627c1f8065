// Balance, direction and size of the wrenches of an arm support; the elevation of the arm both
// ways.
#include "plant/arm_support.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

SupportCurve bump(double peak) {
  SupportCurve curve;
  curve.angle = Vector::LinSpaced(30, 0.2, 2.4);
  curve.support = peak * (curve.angle.array() * 1.2).sin();
  curve.shear = 0.4 * peak * (curve.angle.array() - 1.0);
  return curve;
}

Point3 random_point(Random& random) { return {random.normal(), random.normal(), random.normal()}; }

TEST(SupportCurve, IsExactAtItsEntriesAndStraightBetween) {
  SupportCurve curve;
  curve.angle.resize(3);
  curve.angle << 0.5, 1.0, 2.0;
  curve.support.resize(3);
  curve.support << 10, 30, 20;
  curve.shear.resize(3);
  curve.shear << 1, -1, 3;
  EXPECT_EQ(curve.at(0.5)[0], 10);
  EXPECT_EQ(curve.at(1.0)[0], 30);
  EXPECT_EQ(curve.at(2.0)[0], 20);
  EXPECT_EQ(curve.at(3.0)[1], 3);
  EXPECT_DOUBLE_EQ(curve.at(0.75)[0], 20);
  EXPECT_DOUBLE_EQ(curve.at(1.5)[1], 1);
  EXPECT_DOUBLE_EQ(curve.at(0.25)[0], 5);
  EXPECT_EQ(curve.at(0.0)[0], 0);
  EXPECT_EQ(curve.at(-0.1)[0], 0);
  EXPECT_TRUE(std::isnan(curve.at(kNaN)[0]));
}

TEST(ArmSupport, IsInBalanceAboutEveryPoint) {
  Random random(1);
  ArmSupport support;
  support.left = bump(30);
  support.right = bump(45);
  for (int i = 0; i < 200; ++i) {
    support.along_arm = i % 2 == 0;
    support.up = random_point(random).normalized();
    SupportPose pose;
    for (std::size_t side = 0; side < 2; ++side) {
      pose.shoulder[side] = random_point(random);
      pose.elbow[side] = random_point(random);
    }
    pose.hip = random_point(random);
    const SupportWrenches w = support_wrenches(support, pose);
    const Point3 weight = -1.8 * 9.81 * support.up;
    EXPECT_LT((w.force[0] + w.force[1] + w.hip_force - weight).norm(), 1e-9);
    const Point3 origin = 3.0 * random_point(random);
    Point3 moment = w.hip_moment + (pose.hip - origin).cross(w.hip_force);
    for (std::size_t side = 0; side < 2; ++side) {
      moment += (w.point[side] - origin).cross(w.force[side]);
    }
    EXPECT_LT((moment - (pose.hip - origin).cross(weight)).norm(), 1e-9);
  }
}

TEST(ArmSupport, PushesAcrossTheArmUpwardAndNotSideways) {
  Random random(2);
  ArmSupport support;
  support.left = support.right = bump(30);
  for (int i = 0; i < 100; ++i) {
    SupportPose pose;
    pose.hip = Point3::Zero();
    for (std::size_t side = 0; side < 2; ++side) {
      pose.shoulder[side] = Point3::Zero();
      pose.elbow[side] = 0.3 * random_point(random).normalized();
    }
    const SupportWrenches w = support_wrenches(support, pose);
    for (std::size_t side = 0; side < 2; ++side) {
      const Point3& arm = pose.elbow[side];
      EXPECT_LT(std::abs(w.force[side].dot(arm)), 1e-12);
      EXPECT_LT(std::abs(w.force[side].dot(arm.cross(Point3::UnitZ()))), 1e-12);
      const double size = support.left.at(w.elevation[side])[0];
      // The support of this curve is positive wherever the arm is within it.
      EXPECT_NEAR(w.force[side].norm(), std::abs(size), 1e-12);
      EXPECT_LT((w.point[side] - 0.6895 * arm).norm(), 1e-15);
      EXPECT_EQ(w.outside[side], w.elevation[side] > 2.4);
    }
  }
}

TEST(ArmSupport, KnowsAnUprightArmAndAMissingOne) {
  ArmSupport support;
  support.left = support.right = bump(30);
  SupportPose pose;
  pose.hip = Point3::Zero();
  pose.shoulder = {Point3::Zero(), Point3::Zero()};
  pose.elbow = {Point3(0, 0, -0.3), Point3(0, 0, 0.3)};
  SupportWrenches w = support_wrenches(support, pose);
  EXPECT_EQ(w.force[0].norm() + w.force[1].norm(), 0.0);
  EXPECT_FALSE(w.outside[0]);
  EXPECT_TRUE(w.outside[1]);
  pose.elbow[1].x() = kNaN;
  w = support_wrenches(support, pose);
  EXPECT_TRUE(w.force[1].array().isNaN().all());
  EXPECT_TRUE(w.hip_force.array().isNaN().all());
  EXPECT_FALSE(w.force[0].array().isNaN().any());
}

TEST(ArmElevation, AgreesBothWays) {
  Random random(3);
  for (int i = 0; i < 500; ++i) {
    const Point3 u = 1.5 * random_point(random);
    const Eigen::Matrix3d turn =
        (Eigen::AngleAxisd(u[0], Point3::UnitX()) * Eigen::AngleAxisd(u[1], Point3::UnitY()) *
         Eigen::AngleAxisd(u[2], Point3::UnitZ()))
            .toRotationMatrix();
    const Point3 v = zxy_of_xyz(u);
    const Eigen::Matrix3d other =
        (Eigen::AngleAxisd(v[2], Point3::UnitZ()) * Eigen::AngleAxisd(v[0], Point3::UnitX()) *
         Eigen::AngleAxisd(v[1], Point3::UnitY()))
            .toRotationMatrix();
    EXPECT_LT((turn - other).norm(), 1e-12);
    // The left arm points along y in the neutral pose, the right one against it.
    EXPECT_NEAR(arm_elevation(turn * Point3::UnitY(), Point3::UnitZ()), 0.5 * kPi + v[0], 1e-7);
    EXPECT_NEAR(arm_elevation(-turn * Point3::UnitY(), Point3::UnitZ()), 0.5 * kPi - v[0], 1e-7);
  }
  const Point3 hanging = zxy_of_xyz({-0.5 * kPi, 0.3, 0.0});
  EXPECT_NEAR(hanging[0], -0.5 * kPi, 1e-12);
  EXPECT_TRUE(std::isnan(hanging[1]) && std::isnan(hanging[2]));
}

TEST(ArmSupport, RefusesWhatCannotBe) {
  const auto refused = [](auto change) {
    ArmSupport support;
    support.left = support.right = bump(30);
    EXPECT_NO_THROW(check_support(support));
    change(support);
    EXPECT_THROW(check_support(support), Error);
  };
  refused([](ArmSupport& s) { s.left.angle[3] = s.left.angle[2]; });
  refused([](ArmSupport& s) { s.right.angle[29] = 3.2; });
  refused([](ArmSupport& s) { s.left.angle[0] = -0.1; });
  refused([](ArmSupport& s) { s.left.support[5] = kNaN; });
  refused([](ArmSupport& s) { s.left.shear.resize(3); });
  refused([](ArmSupport& s) { s.left = {Vector::Ones(1), Vector::Ones(1), Vector::Ones(1)}; });
  refused([](ArmSupport& s) { s.attachment = 0.0; });
  refused([](ArmSupport& s) { s.attachment = kNaN; });
  refused([](ArmSupport& s) { s.mass = -1.0; });
  refused([](ArmSupport& s) { s.up = {0, 0, 2}; });
}

}  // namespace
}  // namespace ulna
