// Recordings: the same bits on any number of threads, gaps bridged, variances found again, and what
// sensors cannot tell.
#include "estimate/body_recording.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "estimate/identifiability.hpp"
#include "estimate/sensor_variances.hpp"
#include "made_body.hpp"

namespace ulna {
namespace {

using Kind = BodySensorKind;

double largest(const Matrix& m) { return m.cwiseAbs().maxCoeff(); }

struct Made {
  std::shared_ptr<const SensorSuite> suite;
  BodyRecording recording;
  Matrix torque;
};

// Frames of one slow motion and its torques, with the suite's noise.
Made made_recording(Index frames, std::shared_ptr<const SensorSuite> suite) {
  const auto body = suite->shared_body();
  Made made{suite, {}, Matrix(frames, body->dofs())};
  BodyRecording& r = made.recording;
  r.angle.resize(frames, body->dofs());
  r.rate.resize(frames, body->dofs());
  r.measured.resize(frames, suite->rows());
  r.orientation.resize(frames, 4);
  r.position.resize(frames, 3);
  r.angular_velocity.resize(frames, 3);
  for (Index i = 0; i < frames; ++i) {
    const made::Truth t =
        made::make_truth(body, static_cast<std::uint64_t>(i),
                         {body->at_link("RightFoot"), body->at_link("LeftFoot")}, suite->prior());
    const Eigen::Quaterniond q(t.state.orientation);
    r.angle.row(i) = t.state.angle.transpose();
    r.rate.row(i) = t.state.rate.transpose();
    r.position.row(i) = t.state.position.transpose();
    r.angular_velocity.row(i) = t.state.angular_velocity.transpose();
    r.orientation.row(i) << q.w(), q.x(), q.y(), q.z();
    r.measured.row(i) =
        made::noisy(*suite, made::readings(*suite, t), 1, static_cast<std::uint64_t>(i))
            .transpose();
    made.torque.row(i) = t.torque.transpose();
  }
  return made;
}

std::shared_ptr<const SensorSuite> suit() {
  const auto body = made::human();
  return std::make_shared<const SensorSuite>(body, made::suit(*body));
}

TEST(BodyRecording, HasTheSameBitsOnAnyNumberOfThreads) {
  const Made made = made_recording(600, suit());
  KeepOptions keep{.deviations = true, .wrenches = true, .threads = 1};
  const BodyTorques one = estimate_recording(made.suite, made.recording, {}, keep);
  keep.threads = 4;
  const BodyTorques four = estimate_recording(made.suite, made.recording, {}, keep);
  EXPECT_EQ(one.torque, four.torque);
  EXPECT_EQ(one.torque_deviation, four.torque_deviation);
  EXPECT_EQ(one.joint_wrench, four.joint_wrench);
  EXPECT_EQ(one.log_likelihood, four.log_likelihood);
  EXPECT_EQ(one.unusable, 0);
  // The same as frame by frame.
  TorqueEstimator estimator(made.suite);
  BodyState state;
  for (const Index i : {0, 255, 256, 599}) {
    state_of(made.recording, i, state);
    const TorqueFrame& f =
        estimator.update(state, made.recording.measured.row(i).transpose(), true);
    EXPECT_EQ(one.torque.row(i), f.torque.transpose());
    EXPECT_EQ(one.external.row(i).segment<6>(60).transpose(), f.external.col(10));
    EXPECT_EQ(one.innovation.row(i), f.innovation.transpose());
  }
  // Dynamics that are exact, by the other solver.
  keep.threads = 2;
  const BodyTorques sparse =
      estimate_uncertain(made.suite, made.recording, {0.0, 0.0, 0.0, 0.0}, keep);
  EXPECT_LT(largest(sparse.torque - one.torque), 1e-6 * largest(one.torque));
  EXPECT_LT(largest(sparse.joint_wrench.rightCols(288) - one.joint_wrench.rightCols(288)),
            1e-6 * largest(one.joint_wrench));
  EXPECT_THROW(estimate_uncertain(made.suite, made.recording, {.force = -1.0}), Error);
  const Matrix error = (one.torque - made.torque).cwiseQuotient(one.torque_deviation);
  const double inside = static_cast<double>((error.array().abs() < 1.959964).count()) /
                        static_cast<double>(error.size());
  EXPECT_NEAR(inside, 0.95, 0.01);
}

TEST(BodyRecording, BridgesGapsAndSaysSo) {
  Made made = made_recording(60, suit());
  // A still body, so that the bridge can be right.
  for (Index i = 1; i < 60; ++i) {
    made.recording.angle.row(i) = made.recording.angle.row(0);
    made.recording.rate.row(i) = made.recording.rate.row(0);
    made.recording.orientation.row(i) = made.recording.orientation.row(0);
    made.recording.angular_velocity.row(i) = made.recording.angular_velocity.row(0);
    made.recording.position.row(i) = made.recording.position.row(0);
    made.recording.measured.row(i) = made.recording.measured.row(0);
  }
  const BodyTorques full = estimate_recording(made.suite, made.recording);
  BodyRecording gaps = made.recording;
  for (Index i = 10; i < 15; ++i) {  // dropped frames: nothing is there
    gaps.angle.row(i).setConstant(kNaN);
    gaps.measured.row(i).setConstant(kNaN);
  }
  for (Index i = 20; i < 25; ++i) gaps.angle(i, 3) = kNaN;  // a joint's angle only
  for (Index i = 30; i < 50; ++i) gaps.orientation.row(i).setConstant(kNaN);  // too long
  gaps.rate(59, 0) = kNaN;                                                    // at the end
  const BodyTorques bridged = estimate_recording(made.suite, gaps);
  EXPECT_EQ(bridged.unusable, 21);
  for (Index i = 0; i < 60; ++i) {
    const bool lost = (i >= 30 && i < 50) || i == 59;
    const bool bridge = (i >= 10 && i < 15) || (i >= 20 && i < 25);
    EXPECT_EQ(bridged.bridged[static_cast<std::size_t>(i)] != 0, bridge) << i;
    EXPECT_EQ(std::isnan(bridged.torque(i, 0)), lost) << i;
    if (lost) continue;
    const Vector wider =
        (bridged.torque_deviation.row(i) - full.torque_deviation.row(i)).transpose();
    if (bridge) {
      EXPECT_GT(wider.maxCoeff(), 0.1) << i;
      EXPECT_GE(wider.minCoeff(), -1e-9) << i;
    } else {
      EXPECT_EQ(largest(wider), 0.0) << i;
    }
  }
}

TEST(BodyRecording, IsCheckedAndCanBeCancelled) {
  const Made made = made_recording(4, suit());
  const auto refused = [&](auto change, const char* words) {
    BodyRecording r = made.recording;
    change(r);
    try {
      estimate_recording(made.suite, r);
      ADD_FAILURE() << "accepted: " << words;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  refused([](auto& r) { r.rate.conservativeResize(3, 48); }, "rate is 3 x 48");
  refused([](auto& r) { r.angle.conservativeResize(4, 47); }, "angle is 4 x 47");
  refused([](auto& r) { r.measured.conservativeResize(4, 5); }, "measured is 4 x 5");
  refused([](auto& r) { r.orientation.conservativeResize(4, 3); }, "orientation is 4 x 3");
  refused([](auto& r) { r.orientation.row(2) *= 3.0; }, "frame 2");
  EXPECT_THROW(estimate_recording(made.suite, made.recording, {}, {}, -1), Error);
  Token token;
  token.cancel();
  EXPECT_THROW(estimate_recording(made.suite, made.recording, {}, {}, 3, &token), Error);
  BodyRecording none = made.recording;
  none.angle.resize(0, 48);
  none.rate.resize(0, 48);
  none.measured.resize(0, made.suite->rows());
  none.position.resize(0, 0);
  none.orientation.resize(0, 0);
  none.angular_velocity.resize(0, 0);
  EXPECT_EQ(estimate_recording(made.suite, none).torque.rows(), 0);
}

TEST(SensorVariances, AreFoundAgain) {
  const Made made = made_recording(250, suit());
  const Vector truth = made.suite->deviations();
  // Everything wrong: accelerometers by 3, shoes by 1/3, hinges by 2.
  Vector wrong = truth;
  for (Index s = 0; s < made.suite->size(); ++s) {
    const BodySensor& sensor = made.suite->sensor(s);
    const double factor = sensor.kind == Kind::kAccelerometer       ? 3.0
                          : sensor.kind == Kind::kJointAcceleration ? 2.0
                                                                    : 1.0 / 3.0;
    wrong.segment(made.suite->row(s), sensor_rows(sensor.kind)) *= factor;
  }
  const SensorSuite start = made.suite->with_deviations(wrong);
  const SensorVariances found = sensor_variances(start, made.recording);
  EXPECT_TRUE(found.converged);
  EXPECT_EQ(found.freedom.size(), truth.size());
  for (std::size_t k = 1; k < found.log_likelihood.size(); ++k) {
    EXPECT_GE(found.log_likelihood[k], found.log_likelihood[k - 1] - 1e-6);
  }
  Index checked = 0;
  for (Index row = 0; row < truth.size(); ++row) {
    if (found.freedom[row] < 60.0) continue;  // a row that others hardly check: found slowly
    ++checked;
    // Five standard errors of a deviation, and what the steps have not finished.
    const double error = 5.0 / std::sqrt(2.0 * std::max(found.freedom[row], 1.0)) + 0.02;
    EXPECT_NEAR(std::log(found.deviation[row] / truth[row]), 0.0, error)
        << made.suite->row_names()[static_cast<std::size_t>(row)];
  }
  EXPECT_GT(checked, 50);
  // Rows that are left alone stay as they are.
  std::vector<Index> groups(static_cast<std::size_t>(truth.size()), -1);
  groups[0] = groups[1] = groups[2] = 0;
  const SensorVariances one =
      sensor_variances(start, made.recording, {.groups = groups, .steps = 3});
  EXPECT_EQ(one.deviation.tail(truth.size() - 3), wrong.tail(truth.size() - 3));
  EXPECT_NE(one.deviation[0], wrong[0]);
  EXPECT_THROW(sensor_variances(start, made.recording, {.groups = {0, 1}}), Error);
  EXPECT_THROW(sensor_variances(start, made.recording, {.steps = 0}), Error);
  groups[0] = -2;
  EXPECT_THROW(sensor_variances(start, made.recording, {.groups = groups}), Error);
}

TEST(SensorVariances, AnErrorOfThePublishedKindIsSmall) {
  const Made made = made_recording(50, suit());
  const BodyTorques torques = estimate_recording(made.suite, made.recording);
  const Vector errors = relative_errors(*made.suite, made.recording, torques);
  EXPECT_EQ(errors.size(), made.suite->size());
  // Noise of 0.1 m/s^2 on about 10 m/s^2.
  EXPECT_LT(errors[0], 0.03);
  EXPECT_GT(errors[0], 0.0);
  EXPECT_THROW(relative_errors(*made.suite, made.recording, BodyTorques{}), Error);
}

TEST(Identifiability, CountsFreeHands) {
  const auto body = made::human();
  std::vector<BodySensor> sensors = made::suit(*body);
  const made::Truth t = made::make_truth(body, 1, {0});
  EXPECT_TRUE(identifiability(SensorSuite(body, sensors), t.state).complete());
  sensors.push_back({.name = "right hand",
                     .kind = Kind::kFreeWrench,
                     .link = body->at_link("RightHand"),
                     .position = {0, -0.1, 0}});
  EXPECT_TRUE(identifiability(SensorSuite(body, sensors), t.state).complete());
  sensors.push_back({.name = "left hand",
                     .kind = Kind::kFreeWrench,
                     .link = body->at_link("LeftHand"),
                     .position = {0, 0.1, 0}});
  const Identifiability both = identifiability(SensorSuite(body, sensors), t.state);
  EXPECT_FALSE(both.complete());
  EXPECT_EQ(both.wrench_unknowns, 12);
  EXPECT_EQ(both.wrench_rank, 6);
  // Two forces: all but the pull along the line between the hands.
  EXPECT_EQ(both.force_unknowns, 6);
  EXPECT_EQ(both.force_rank, 5);
  EXPECT_NE(both.words.find("right hand, left hand"), std::string::npos) << both.words;
  EXPECT_NE(both.words.find("12 unknowns"), std::string::npos) << both.words;
  sensors[sensors.size() - 1].kind = sensors[sensors.size() - 2].kind = Kind::kFreeForce;
  const Identifiability forces = identifiability(SensorSuite(body, sensors), t.state);
  EXPECT_EQ(forces.wrench_unknowns, 6);
  EXPECT_EQ(forces.wrench_rank, 5);
}

TEST(Identifiability, NamesJointsThatNothingMeasures) {
  const auto body = made::human();
  const SensorSuite suite(body, made::suit(*body));
  const made::Truth t = made::make_truth(body, 1, {0});
  Vector y = Vector::Zero(suite.rows());
  y[suite.row(suite.find("ddq_jRightBallFoot_roty"))] = kNaN;  // beyond it is no sensor
  const Identifiability toe = identifiability(suite, t.state, y);
  EXPECT_EQ(toe.undetermined, std::vector<std::string>{"jRightBallFoot_roty"});
  EXPECT_EQ(toe.motion_rank, 53);
  EXPECT_EQ(
      identifiability(suite, t.state, Vector::Constant(suite.rows(), kNaN)).undetermined.size(),
      49u);
  EXPECT_THROW(identifiability(suite, t.state, Vector::Zero(3)), Error);
  EXPECT_THROW(identifiability(suite, BodyState{}), Error);
}

}  // namespace
}  // namespace ulna
