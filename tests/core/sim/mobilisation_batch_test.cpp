// Batches of mobilisations: the bits of any number of threads, failures that stay in their
// row, cancelling.
#include "sim/mobilisation_batch.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "base/error.hpp"
#include "plant/engine_mobilised.hpp"
#include "plant/soft/soft_mobilised.hpp"

namespace ulna::sim {
namespace {

// 0.6 s of minimum jerk from 80 degrees.
Protocol short_protocol() {
  Protocol p;
  Vector start(4);
  start << -5.0, -85.0, 0.0, 80.0;
  p.start = start * kDegree;
  p.moved = {{"J4", 50 * kDegree}};
  p.motion = {.shape = MotionShape::kMinimumJerk, .duration_s = 0.6};
  p.control.weight = true;
  p.excitation.balanced = true;
  return p;
}

ExoScene arm_of_row(Index row) {
  ExoScene scene;
  scene.arm = ArmDescription::cylinders(1.0, 0.9 + 0.02 * static_cast<double>(row), 1.761,
                                        0.6 + 0.1 * static_cast<double>(row));
  return scene;
}

// Slope of the motor's torque over the angle, and its last torque.
Vector simple_values(const Mobilisation& m) {
  const Record& record = *m.record;
  const Vector q = record.column(record.find("theta_J4"));
  const Vector torque = record.column(record.find("tau_motor_J4"));
  const Vector centred = q.array() - q.mean();
  Vector values(2);
  values << centred.dot(torque) / centred.squaredNorm(), torque[torque.size() - 1];
  return values;
}

BatchWork rigid_work() {
  return {[](Index row, Token*) { return mobilised(ExoPlant(arm_of_row(row))); },
          [](Index) { return short_protocol(); },
          [](Index, const MobilisedPlant&, const Mobilisation& m) { return simple_values(m); }, 2};
}

void expect_same_bits(const std::vector<BatchRow>& a, const std::vector<BatchRow>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].status, b[i].status) << i;
    EXPECT_EQ(a[i].reason, b[i].reason) << i;
    EXPECT_EQ(a[i].start_s, b[i].start_s) << i;
    EXPECT_EQ(a[i].largest_slip, b[i].largest_slip) << i;
    ASSERT_EQ(a[i].values.size(), b[i].values.size()) << i;
    for (Index k = 0; k < a[i].values.size(); ++k) EXPECT_EQ(a[i].values[k], b[i].values[k]) << i;
  }
}

TEST(MobilisationBatch, TheSameBitsOnAnyNumberOfThreads) {
  const std::vector<BatchRow> one = mobilise_rows(6, rigid_work(), 1);
  for (const BatchRow& row : one) {
    EXPECT_EQ(row.status, RunStatus::kOk) << row.reason;
    EXPECT_GT(row.wall_s, 0.0);
    EXPECT_TRUE(row.values.allFinite());
  }
  EXPECT_NE(one[0].values[1], one[5].values[1]);
  expect_same_bits(one, mobilise_rows(6, rigid_work(), 2));
  expect_same_bits(one, mobilise_rows(6, rigid_work(), 5));
}

TEST(MobilisationBatch, ARowIsTheMobilisationOfItsPlant) {
  const std::vector<BatchRow> batch = mobilise_rows(3, rigid_work(), 2);
  const Mobilisation alone = mobilise(*mobilised(ExoPlant(arm_of_row(2))), short_protocol());
  EXPECT_EQ(batch[2].start_s, alone.start_s);
  const Vector values = simple_values(alone);
  EXPECT_EQ(batch[2].values[0], values[0]);
  EXPECT_EQ(batch[2].values[1], values[1]);
}

TEST(MobilisationBatch, SoftInterfacesToo) {
  BatchWork work = rigid_work();
  work.plant = [](Index row, Token*) {
    SoftScene scene = SoftScene::of(ExoScene());
    for (SoftInterfaceOptions& i : scene.interfaces) {
      i.tissue.stiffness = 300.0 + 200.0 * static_cast<double>(row);
    }
    return mobilised(std::make_shared<const SoftPlant>(scene));
  };
  work.protocol = [](Index) {
    Protocol p = short_protocol();
    p.settle_s = 0.01;
    p.motion.duration_s = 0.1;
    p.start_angle = 10 * kDegree;  // as it is, without waiting
    p.start_rate = 10.0;
    return p;
  };
  const std::vector<BatchRow> one = mobilise_rows(2, work, 1);
  EXPECT_EQ(one[0].status, RunStatus::kOk) << one[0].reason;
  EXPECT_NE(one[0].values[1], one[1].values[1]);
  expect_same_bits(one, mobilise_rows(2, work, 2));
}

TEST(MobilisationBatch, FailuresStayInTheirRow) {
  BatchWork work = rigid_work();
  work.plant = [](Index row, Token*) {
    if (row == 1) throw Error(Fault::kArgument, "arm", "this arm cannot be");
    return mobilised(ExoPlant(arm_of_row(row)));
  };
  work.protocol = [](Index row) {
    Protocol p = short_protocol();
    if (row == 2) p.rate_limit = 0.01;  // diverged at once
    if (row == 3) p.moved = {{"J9", 0.0}};
    return p;
  };
  work.assess = [](Index row, const MobilisedPlant&, const Mobilisation& m) {
    if (row == 4) throw Error(Fault::kAnalysis, "record", "nothing is determined");
    return simple_values(m);
  };
  const std::vector<BatchRow> rows = mobilise_rows(6, work, 2);
  const std::vector<RunStatus> wanted = {RunStatus::kOk,        RunStatus::kFailedInit,
                                         RunStatus::kDiverged,  RunStatus::kFailedInit,
                                         RunStatus::kNonfinite, RunStatus::kOk};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].status, wanted[i]) << i << ": " << rows[i].reason;
    EXPECT_EQ(rows[i].reason.empty(), wanted[i] == RunStatus::kOk) << i;
    EXPECT_EQ(rows[i].values.allFinite(), wanted[i] == RunStatus::kOk) << i;
  }
  EXPECT_EQ(rows[1].reason, "this arm cannot be");
  EXPECT_EQ(rows[4].reason, "nothing is determined");
  EXPECT_EQ(mobilise_rows(0, work, 2).size(), 0u);
}

TEST(MobilisationBatch, AQuestionThatIsWrongIsNoFailureOfARow) {
  BatchWork work = rigid_work();
  work.assess = [](Index, const MobilisedPlant&, const Mobilisation&) -> Vector {
    throw Error(Fault::kArgument, "joints", "the device has no joint J9");
  };
  try {
    mobilise_rows(2, work, 2);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kArgument);
  }
}

TEST(MobilisationBatch, ADefectIsNoResultOfARow) {
  BatchWork work = rigid_work();
  work.values = 3;
  try {
    mobilise_rows(2, work, 2);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kInternal);
  }
}

TEST(MobilisationBatch, IsCancelledInTheMiddle) {
  Token token;
  std::atomic<int> begun{0};
  BatchWork work = rigid_work();
  work.plant = [&](Index row, Token*) {
    if (++begun == 3) token.cancel();
    return mobilised(ExoPlant(arm_of_row(row % 6)));
  };
  try {
    mobilise_rows(1000, work, 2, &token);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kCancelled);
  }
  EXPECT_LT(begun, 10);
}

}  // namespace
}  // namespace ulna::sim
