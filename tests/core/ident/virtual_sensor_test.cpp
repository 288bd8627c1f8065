// The virtual force sensor on recordings whose force is known exactly.
#include "ident/virtual_sensor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "base/error.hpp"
#include "made_robot.hpp"
#include "refusal.hpp"

namespace ulna {
namespace {

using made::refusal_of;
using made::says;

// Away from the ends, where the filters' transient shows.
double worst(const Matrix& a, const Matrix& b) {
  const Index cut = a.rows() / 8;
  return (a - b).middleRows(cut, a.rows() - 2 * cut).cwiseAbs().maxCoeff();
}

TEST(VirtualSensor, GivesTheForceBackWithoutNoise) {
  const MadeLog log = make_robot_log({});
  const CapstanRobot robot;
  for (const char* acceleration : {"a", ""}) {
    VirtualSensorOptions options;
    options.acceleration = acceleration;
    options.reference = "ref";
    const VirtualForce force = sense_force(*log.record, robot, options);
    const Matrix sensed = force.record.values().middleCols(2, 2);
    // A force of several newtons; the smoother deviates from one by 1e-6 within the band.
    EXPECT_LT(worst(sensed, truth_at(log, force.record)), 2e-4) << acceleration;
    EXPECT_EQ(force.accelerometer, *acceleration != '\0');
    // Forward kinematics of the angles is the position that the log holds.
    const Index dropped = (log.record->rows() - force.record.rows()) / 2;
    const Matrix position =
        log.record->values().middleRows(dropped, force.record.rows()).rightCols(2);
    EXPECT_LT(worst(force.record.values().leftCols(2), position), 1e-7);
  }
}

TEST(VirtualSensor, TheResultIsReadyForAnIdentification) {
  const MadeLog log = make_robot_log({});
  VirtualSensorOptions options;
  options.reference = "ref";
  const VirtualForce force = sense_force(*log.record, CapstanRobot(), options);
  const auto names = [&](Role role) {
    std::string all;
    for (const Index c : force.record.with_role(role)) {
      all += force.record.channels()[static_cast<std::size_t>(c)].name + " ";
    }
    return all;
  };
  EXPECT_EQ(names(Role::kPosition), "x y ");
  EXPECT_EQ(names(Role::kForce), "F_x F_y ");
  EXPECT_EQ(names(Role::kReference), "x_ref y_ref ");
  EXPECT_NE(force.record.provenance().back().find("virtual force sensor"), std::string::npos);
}

TEST(VirtualSensor, MeasuredForcesStayBesideSmoothedAlike) {
  const MadeLog log = make_robot_log({});
  Record::Parts parts = log.record->parts();
  const Index columns = parts.values.cols();
  parts.values.conservativeResize(Eigen::NoChange, columns + 2);
  parts.values.rightCols(2) = log.force;
  parts.channels.push_back(made_channel("F_x", "N", Role::kForce, 0));
  parts.channels.push_back(made_channel("F_y", "N", Role::kForce, 1));
  const VirtualForce force = sense_force(Record::make(std::move(parts)), CapstanRobot(), {});
  const Index first = force.record.find("F_x_measured");
  EXPECT_LT(
      worst(force.record.values().middleCols(first, 2), force.record.values().middleCols(2, 2)),
      2e-4);
}

TEST(VirtualSensor, ANoiseBudgetIsTheScatterOfForces) {
  // Every source on its own, over runs with other noise: budget and scatter agree.
  struct Case {
    const char* name;
    double angle, torque, acceleration;
    bool accelerometer;
    Index column;
  };
  const Case cases[] = {{"torque", 0.0, 0.02, 0.0, true, 0},
                        {"angle, differentiated", 2e-5, 0.0, 0.0, false, 2},
                        {"angle, accelerometer", 2e-5, 0.0, 0.0, true, 2},
                        {"accelerometer", 0.0, 0.0, 0.05, true, 4}};
  for (const Case& c : cases) {
    MadeRobot made;
    made.duration_s = 20.0;
    const Matrix truth = make_robot_log(made).force;
    made.angle_noise = c.angle;
    made.torque_noise = c.torque;
    made.acceleration_noise = c.acceleration;
    VirtualSensorOptions options;
    options.acceleration = c.accelerometer ? "a" : "";
    options.angle_noise = c.angle;
    options.torque_noise = c.torque;
    options.acceleration_noise = c.acceleration;
    options.prepare.lowpass_hz = 15.0;
    const VirtualForce force = sense_force(*make_robot_log(made).record, CapstanRobot(), options);
    const Index dropped = (truth.rows() - force.record.rows()) / 2;
    const Matrix miss =
        force.record.values().middleCols(2, 2) - truth.middleRows(dropped, force.record.rows());
    const Index cut = miss.rows() / 8;
    const Matrix inner = miss.middleRows(cut, miss.rows() - 2 * cut);
    const Matrix budget = force.random.middleCols(c.column, 2).middleRows(cut, inner.rows());
    for (Index axis = 0; axis < 2; ++axis) {
      const double scatter = std::sqrt(inner.col(axis).squaredNorm());
      const double expected = std::sqrt(budget.col(axis).squaredNorm());
      // 20 s below 15 Hz hold some 400 independent values: 4 standard errors are 14 %.
      EXPECT_NEAR(scatter / expected, 1.0, 0.15) << c.name << ", axis " << axis;
    }
  }
}

TEST(VirtualSensor, SystematicSensitivitiesAreDifferences) {
  // The force of a robot whose parameter is off by a little, against the linear propagation.
  const MadeLog log = make_robot_log({});
  VirtualSensorOptions options;
  options.acceleration = "a";
  options.parameter_covariance = Matrix::Identity(5, 5);
  options.torque_scale_error = 0.01;
  options.acceleration_scale_error = 0.01;
  const VirtualForce force = sense_force(*log.record, CapstanRobot(), options);
  ASSERT_EQ(force.errors.names.size(), 9u);
  VirtualSensorOptions plain;
  plain.acceleration = "a";
  const Matrix before = force.record.values().middleCols(2, 2);
  for (std::size_t k = 0; k < 5; ++k) {
    CapstanParameters changed;
    changed.alpha[k] += 1e-3;
    const VirtualForce other = sense_force(*log.record, CapstanRobot(changed), plain);
    const Matrix slope = (other.record.values().middleCols(2, 2) - before) / 1e-3;
    // Linear in the parameters: rounding alone.
    EXPECT_LT((slope - force.errors.sensitivity[k]).cwiseAbs().maxCoeff(), 1e-8) << k;
  }
  const auto scaled = [&](Index column, double factor) {
    Record::Parts parts = log.record->parts();
    parts.values.col(column) *= factor;
    return sense_force(Record::make(std::move(parts)), CapstanRobot(), plain)
        .record.values()
        .middleCols(2, 2)
        .eval();
  };
  const Index columns[] = {2, 3, 4, 5};
  for (std::size_t k = 0; k < 4; ++k) {
    const Matrix slope = (scaled(columns[k], 1.001) - before) / 1e-3;
    EXPECT_LT((slope - force.errors.sensitivity[5 + k]).cwiseAbs().maxCoeff(), 1e-8) << k;
  }
}

TEST(VirtualSensor, ASingularPoseIsRefusedWithItsPlace) {
  MadeRobot made;
  made.contact = false;
  made.duration_s = 10.0;
  made.centre = {1.5, 0.1};  // nearly stretched: theta_1 - theta_2 comes near 90 degrees
  const MadeLog log = make_robot_log(made);
  const Error error = refusal_of([&] { sense_force(*log.record, CapstanRobot(), {}); });
  EXPECT_EQ(error.fault(), Fault::kData);
  EXPECT_TRUE(says(error, "near a singular one"));
  EXPECT_TRUE(says(error, "condition of the Jacobian"));
  EXPECT_TRUE(says(error, "deg"));
  ASSERT_EQ(error.detail().substr(0, 4), "row ");
  // It is the first such row: the pose there is as the message says.
  const Index row = std::stol(error.detail().substr(4));
  const Vector2 q = log.record->values().row(row).head<2>().transpose();
  EXPECT_LT(jacobian_quality(CapstanRobot().at(q, Vector2::Zero()).jacobian), 0.051);
}

TEST(VirtualSensor, NoisyEndsAreLeftOut) {
  // The extension of the low pass starts from one sample: its second derivative, hardly filtered,
  // exceeds the motion by far where the rate is high.
  MadeRobot made;
  made.rate_hz = 1000.0;
  made.duration_s = 10.0;
  made.angle_noise = 1e-5;
  const MadeLog log = make_robot_log(made);
  const VirtualForce force = sense_force(*log.record, CapstanRobot(), {});
  const Matrix miss = force.record.values().middleCols(2, 2) - truth_at(log, force.record);
  // Noise of 20 mN inside; at the ends the same, not newtons.
  EXPECT_LT(miss.cwiseAbs().maxCoeff(), 0.3);
}

TEST(VirtualSensor, RefusesWhatItCannotUse) {
  MadeRobot made;
  made.duration_s = 5.0;
  const MadeLog log = make_robot_log(made);
  const CapstanRobot robot;
  const auto with = [&](const std::function<void(VirtualSensorOptions&)>& change) {
    VirtualSensorOptions options;
    change(options);
    return refusal_of([&] { sense_force(*log.record, robot, options); });
  };
  EXPECT_TRUE(says(with([](auto& o) { o.angle = "x"; }), "in m, not in rad"));
  EXPECT_TRUE(says(with([](auto& o) { o.torque = "a"; }), "not in Nm"));
  EXPECT_TRUE(says(with([](auto& o) { o.acceleration = "tau"; }), "not in m/s^2"));
  EXPECT_TRUE(says(with([](auto& o) { o.angle = "nothing"; }), "nothing"));
  EXPECT_TRUE(says(with([](auto& o) { o.angle = "theta_1"; }), "stands for 1 channels"));
  EXPECT_TRUE(says(with([](auto& o) { o.torque_noise = -1.0; }), "at least 0"));
  EXPECT_TRUE(says(with([](auto& o) { o.least_quality = 1.5; }), "between 0 and 1"));
  EXPECT_TRUE(says(with([](auto& o) { o.parameter_covariance = Matrix::Identity(3, 3); }),
                   "must be 5 x 5"));
  Record::Parts parts = log.record->parts();
  parts.values(700, 2) = NAN;
  const Error error = refusal_of([&] { sense_force(Record::make(std::move(parts)), robot, {}); });
  EXPECT_EQ(error.detail(), "row 700");
  // Missing channels.
  Record::Parts few = log.record->parts();
  few.values.conservativeResize(Eigen::NoChange, 2);
  few.channels.resize(2);
  EXPECT_TRUE(
      says(refusal_of([&] { sense_force(Record::make(std::move(few)), robot, {}); }), "tau"));
  // A trial that the smoother starts and stops in.
  MadeRobot brief;
  brief.duration_s = 1.0;
  const MadeLog second = make_robot_log(brief);
  VirtualSensorOptions slow;
  slow.prepare.lowpass_hz = 5.0;
  EXPECT_TRUE(says(refusal_of([&] { sense_force(*second.record, robot, slow); }), "record longer"));
}

}  // namespace
}  // namespace ulna
