// Passive mobilisation: reference movements, the log against the nominal model, how runs end, what
// the nerves do, and descriptions that cannot be.
#include "sim/mobilisation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "base/error.hpp"
#include "plant/arm_muscles.hpp"
#include "plant/engine_mobilised.hpp"
#include "refusal.hpp"

namespace ulna::sim {
namespace {

using made::expect_refusal;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::shared_ptr<const MobilisedPlant> rigid_plant(const std::function<void(ExoScene&)>& change =
                                                      [](ExoScene&) {}) {
  ExoScene scene;
  change(scene);
  return mobilised(ExoPlant(scene));
}

const MobilisedPlant& plant() {
  static const std::shared_ptr<const MobilisedPlant> kPlant = rigid_plant();
  return *kPlant;
}

// Short: 1.2 s of minimum jerk from 80 to 50 degrees, the weight carried.
Protocol brief() {
  Protocol p;
  p.start = plant().reference();
  p.start[0] = -5 * kDegree;  // inside the limits
  p.start[1] = -85 * kDegree;
  p.start[3] = 80 * kDegree;
  p.moved = {{"J4", 50 * kDegree}};
  p.motion = {.shape = MotionShape::kMinimumJerk, .duration_s = 1.2};
  p.control.weight = true;
  p.excitation.balanced = true;
  return p;
}

Mobilisation run_ok(const MobilisedPlant& on, const Protocol& p) {
  Mobilisation m = mobilise(on, p);
  EXPECT_EQ(m.status, RunStatus::kOk) << m.reason;
  EXPECT_TRUE(m.record.has_value());
  return m;
}

Vector column(const Record& record, const std::string& name) {
  return record.column(record.find(name));
}

double worst(const Record& record, const std::string& joint) {
  return (column(record, "tau_hum_" + joint) - column(record, "tau_muscle_" + joint))
      .cwiseAbs()
      .maxCoeff();
}

// Reference movements
// -----------------------------------------------------------------------------

// x0 [1 - 1 / (1.1 (1 + e^(5 - 2t)))]: 0.9939 x0 at first, 0.0917 x0 at last, x0 / 2.2 rad/s.
TEST(ReferenceMotion, LogisticIsThePublishedOne) {
  const ReferenceMotion motion;
  EXPECT_EQ(motion.length_s(), 6.0);
  EXPECT_NEAR(1.0 - motion.at(0.0).share, 0.9939, 5e-5);
  EXPECT_NEAR(1.0 - motion.at(6.0).share, 0.0917, 5e-5);
  EXPECT_NEAR(motion.at(2.5).share, 0.5 / 1.1, 1e-12);
  EXPECT_NEAR(motion.at(2.5).rate, 1.0 / 2.2, 1e-12);
}

TEST(ReferenceMotion, RatesAreSlopesAndWaysMeet) {
  for (const MotionShape shape : {MotionShape::kLogistic, MotionShape::kMinimumJerk,
                                  MotionShape::kRamp, MotionShape::kSinusoid}) {
    ReferenceMotion motion{.shape = shape, .duration_s = 2.0, .rest_s = 0.25};
    if (shape != MotionShape::kLogistic) {
      motion.speeds = {0.5, 1.0, 2.0};
      motion.repeats = 2;
    }
    motion.check();
    const double length = motion.length_s();
    if (shape != MotionShape::kLogistic) {
      // Twelve ways, a rest before each and one at last.
      EXPECT_NEAR(length, 4 * (4.0 + 2.0 + 1.0) + 12 * 0.25 + 0.25, 1e-12);
      EXPECT_NEAR(motion.at(length).share, 0.0, 1e-12);
    }
    constexpr double kStep = 1e-6;
    for (int i = 1; i < 997; ++i) {
      const double t = length * i / 997.0;
      const double slope = (motion.at(t + kStep).share - motion.at(t - kStep).share) / (2 * kStep);
      // Second derivatives are below 40 1/s^2; corners of the ramp are no instants of this grid.
      EXPECT_NEAR(motion.at(t).rate, slope, 1e-4) << static_cast<int>(shape) << " at " << t;
      EXPECT_GE(motion.at(t).share, -1e-12);
      EXPECT_LE(motion.at(t).share, 1.0 + 1e-12);
    }
  }
}

TEST(ReferenceMotion, RefusesWhatCannotBe) {
  const auto refuse = [](const ReferenceMotion& motion, const char* words) {
    expect_refusal([&] { motion.check(); }, words);
  };
  refuse({.duration_s = 0.0}, "between 0.1 and 600 s");
  refuse({.duration_s = kNan}, "between 0.1 and 600 s");
  refuse({.speeds = {}}, "between 1 and 100 speeds");
  refuse({.speeds = {1.0, -2.0}}, "speed -2 is not");
  refuse({.speeds = {1.0, 2.0}}, "logistic movement ends short");
  refuse({.repeats = 0}, "repeats must be");
  refuse({.rest_s = -1.0}, "rest between movements");
}

// Friction
// ----------------------------------------------------------------------------------------

// The closed form and the engine's solver, from creeping to slipping.
TEST(FrictionLaw, IsTheEngines) {
  ExoScene scene;
  scene.arm.muscles.clear();
  scene.exo.links[1].friction = 0.7;
  const ExoPlant with(scene);
  ExoScene smooth = scene;
  for (ExoLink& link : smooth.exo.links) link.friction = 0.0;
  const ExoPlant without(smooth);
  EngineRun a(with.model());
  EngineRun b(without.model());
  bool creeps = false;
  bool slips = false;
  for (int i = 0; i < 200; ++i) {
    const double x = static_cast<double>(i);
    Vector angle(4), rate(4), acceleration(4);
    angle << -0.5, -1.0, -0.3, 1.2;
    rate << 0.1, 0.03 * std::sin(x), -0.2, 0.05 * std::sin(1.3 * x);
    acceleration << 0.4, std::cos(2.1 * x), 0.3, 2.0 * std::cos(0.7 * x);
    for (EngineRun* run : {&a, &b}) {
      run->position() = angle;
      run->velocity() = rate;
    }
    const Vector difference = a.inverse(acceleration) - b.inverse(acceleration);
    for (Index j = 0; j < 4; ++j) {
      const FrictionLaw law = friction_law(with.model(), "J" + std::to_string(j + 1));
      const double torque = law.torque(rate[j], acceleration[j]);
      EXPECT_NEAR(difference[j], torque, 1e-12);
      creeps = creeps || (law.limit > 0.0 && std::fabs(torque) < 0.99 * law.limit);
      slips = slips || (law.limit > 0.0 && std::fabs(torque) == law.limit);
    }
  }
  EXPECT_TRUE(creeps && slips);
  EXPECT_EQ(friction_law(without.model(), "J4").torque(1.0, 1.0), 0.0);
  EXPECT_NEAR(friction_law(with.model(), "J4").limit, 2.787, 1e-12);
  expect_refusal([&] { friction_law(with.model(), "J9"); }, "no joint 'J9'");
}

// The log
// -----------------------------------------------------------------------------------------

// What motors, muscles and the nominal model say is the same torque, whatever drives the arm.
TEST(Mobilisation, NominalModelExplainsTheLog) {
  for (const TorqueUpdate mode :
       {TorqueUpdate::kEveryStep, TorqueUpdate::kImplicitDamping, TorqueUpdate::kHeld}) {
    for (const ExcitationKind kind : {ExcitationKind::kConstant, ExcitationKind::kStretchReflex,
                                      ExcitationKind::kVelocityDependent}) {
      Protocol p = brief();
      p.control.mode = mode;
      if (mode == TorqueUpdate::kHeld) p.control.kd = 5.0;  // 15 swings: see the next but one test
      p.excitation.kind = kind;
      const Record record = *run_ok(plant(), p).record;
      for (const char* joint : {"J1", "J2", "J3", "J4"}) {
        EXPECT_LT(worst(record, joint), 1e-6) << joint << " " << static_cast<int>(mode);
      }
    }
  }
}

TEST(Mobilisation, FrictionOnAndOffExplainTheDifference) {
  const auto smooth = rigid_plant([](ExoScene& s) {
    for (ExoLink& link : s.exo.links) link.friction = link.damping = 0.0;
  });
  const Record rough = *run_ok(plant(), brief()).record;
  const NominalModel& nominal = plant().nominal();
  const NominalModel& lossless = smooth->nominal();
  Index slipping = 0;
  for (Index i = 0; i < rough.rows(); ++i) {
    Vector angle(4), rate(4), acceleration(4), motor(4), muscle(4);
    for (Index j = 0; j < 4; ++j) {
      const std::string joint = "J" + std::to_string(j + 1);
      angle[j] = column(rough, "theta_" + joint)[i];
      rate[j] = column(rough, "theta_dot_" + joint)[i];
      acceleration[j] = column(rough, "theta_ddot_" + joint)[i];
      motor[j] = column(rough, "tau_motor_" + joint)[i];
      muscle[j] = column(rough, "tau_muscle_" + joint)[i];
    }
    // The plant with friction, seen by a model without: friction is what is missing.
    const Vector missing = motor + muscle - lossless.torque(angle, rate, acceleration);
    for (Index j = 0; j < 4; ++j) {
      EXPECT_NEAR(missing[j], column(rough, "tau_loss_J" + std::to_string(j + 1))[i], 1e-6);
    }
    const FrictionLaw& law = nominal.friction()[3];
    if (std::fabs(rate[3]) < 0.3) continue;  // faster than it creeps
    ++slipping;
    // 1 N m s/rad, with the rate at the end of the step.
    const double later = rate[3] + 0.005 * acceleration[3];
    EXPECT_NEAR(missing[3], later + std::copysign(law.limit, rate[3]), 1e-6);
  }
  EXPECT_GT(slipping, 50);
  // And the plant without friction needs none.
  const Record record = *run_ok(*smooth, brief()).record;
  EXPECT_LT(worst(record, "J4"), 1e-6);
}

TEST(Mobilisation, TorqueHeldTooLongEndsTheRun) {
  Protocol p;
  p.control.mode = TorqueUpdate::kHeld;
  const Mobilisation m = mobilise(plant(), p);
  EXPECT_EQ(m.status, RunStatus::kDiverged);
  EXPECT_NE(m.reason.find("unstable on this arm"), std::string::npos) << m.reason;
}

TEST(Mobilisation, ReferenceIsHeldAsLongAsItIsTold) {
  Protocol p = brief();
  p.log_rate_hz = 200.0;
  p.control.reference_hold_s = 0.01;
  const Mobilisation m = run_ok(plant(), p);
  const Vector reference = column(*m.record, "theta_ref_J4");
  const Vector free = column(*run_ok(plant(), brief()).record, "theta_ref_J4");
  for (Index i = 0; i < 240; ++i) {
    EXPECT_EQ(reference[i], reference[i - i % 2]);
    // From where the start ended, which differs in the last digits.
    EXPECT_NEAR(reference[i], free[i / 2], 1e-9);
  }
  EXPECT_GT(reference[120] - reference[122], 1e-3);
}

TEST(Mobilisation, LogsBothChainsAtItsRate) {
  const Mobilisation m = run_ok(plant(), brief());
  const Record& record = *m.record;
  EXPECT_EQ(record.rows(), 121);
  EXPECT_EQ(record.rate_hz(), 100.0);
  EXPECT_NEAR(record.time()[120], 1.2, 1e-12);
  EXPECT_EQ(record.channels()[static_cast<std::size_t>(record.find("theta_J4"))].role,
            Role::kPosition);
  EXPECT_EQ(record.with_role(Role::kPosition).size(), 1u);
  EXPECT_EQ(record.with_role(Role::kForce).size(), 1u);
  EXPECT_EQ(record.with_role(Role::kReference).size(), 1u);
  // Rates and accelerations are of the same row: the state moves by semi-implicit steps of 5 ms.
  const Vector angle = column(record, "theta_J4");
  const Vector rate = column(record, "theta_dot_J4");
  const Vector acceleration = column(record, "theta_ddot_J4");
  for (Index i = 1; i < 120; ++i) {
    EXPECT_NEAR((angle[i + 1] - angle[i - 1]) / 0.02, rate[i], 0.02);
    EXPECT_NEAR((rate[i + 1] - rate[i - 1]) / 0.02, acceleration[i], 0.4);
  }
  EXPECT_EQ((column(record, "q_J4") - angle).norm(), 0.0);  // rigid
  EXPECT_EQ(m.largest_slip, 0.0);
  EXPECT_EQ(m.saturated_rows, 0);
  EXPECT_TRUE(m.notes.empty()) << m.notes[0];
  EXPECT_NEAR(column(record, "a_biceps_long")[60], 0.4, 1e-3);
  const Mobilisation again = mobilise(plant(), brief());
  EXPECT_EQ((again.record->values() - record.values()).norm(), 0.0);
}

TEST(Mobilisation, PublishedMovementBeginsWhereTheStartEnded) {
  Protocol p;
  p.control.weight = true;
  const Mobilisation m = run_ok(plant(), p);
  const Record& record = *m.record;
  EXPECT_EQ(record.rows(), 601);
  const Vector reference = column(record, "theta_ref_J4");
  const double x0 = column(record, "theta_J4")[0];
  EXPECT_NEAR(x0, 110 * kDegree, 1 * kDegree);
  for (Index i = 0; i < 601; i += 50) {
    const double t = 0.01 * static_cast<double>(i);
    EXPECT_NEAR(reference[i], x0 * (1.0 - 1.0 / (1.1 * (1.0 + std::exp(5.0 - 2.0 * t)))), 1e-12);
  }
  // The published start is on the limits of J1 and J2, and the log says so.
  ASSERT_FALSE(m.notes.empty());
  EXPECT_NE(m.notes[0].find("'J1' rests on a limit"), std::string::npos);
  EXPECT_LT(worst(record, "J4"), 1e-6);  // the limits hold other joints
}

// How runs end
// ------------------------------------------------------------------------------------

// A plant that breaks after so many steps.
class Breaking final : public MobilisedPlant {
 public:
  using Break = std::function<void(Vector& angle)>;
  Breaking(Index steps, Break breaks) : steps_(steps), breaks_(std::move(breaks)) {}

  const std::vector<std::string>& device_joints() const override { return plant().device_joints(); }
  const std::vector<std::string>& human_joints() const override { return plant().human_joints(); }
  const std::vector<std::string>& muscles() const override { return plant().muscles(); }
  const std::vector<MuscleGroup>& groups() const override { return plant().groups(); }
  const std::vector<PlantChannel>& extras() const override { return extras_; }
  const std::vector<Index>& counterparts() const override { return plant().counterparts(); }
  double timestep() const override { return plant().timestep(); }
  Vector reference() const override { return plant().reference(); }
  Matrix device_range() const override { return plant().device_range(); }
  Matrix human_range() const override { return plant().human_range(); }
  Vector motor_limit() const override { return plant().motor_limit(); }
  const NominalModel& nominal() const override { return plant().nominal(); }
  std::unique_ptr<MuscleProbe> probe() const override { return plant().probe(); }
  std::unique_ptr<MobilisedRun> start(const VectorRef& angle,
                                      const VectorRef& damping) const override {
    return std::make_unique<Run>(*this, plant().start(angle, damping));
  }

 private:
  class Run final : public MobilisedRun {
   public:
    Run(const Breaking& p, std::unique_ptr<MobilisedRun> run) : p_(p), run_(std::move(run)) {}
    Vector device_angle() override {
      Vector angle = run_->device_angle();
      if (done_ >= p_.steps_) p_.breaks_(angle);
      return angle;
    }
    Vector device_rate() override { return run_->device_rate(); }
    Vector human_angle() override { return run_->human_angle(); }
    Vector human_rate() override { return run_->human_rate(); }
    void command(const VectorRef& torque, const VectorRef& excitation) override {
      run_->command(torque, excitation);
    }
    void step() override {
      run_->step();
      ++done_;
    }
    Vector device_acceleration() const override { return run_->device_acceleration(); }
    Vector device_loss() const override { return run_->device_loss(); }
    Vector motor_torque() const override { return run_->motor_torque(); }
    Vector muscle_torque() const override { return run_->muscle_torque(); }
    Vector activation() const override { return run_->activation(); }
    Vector muscle_length() const override { return run_->muscle_length(); }
    Vector muscle_rate() const override { return run_->muscle_rate(); }
    Vector extras() const override { return Vector::Constant(1, static_cast<double>(done_)); }

   private:
    const Breaking& p_;
    std::unique_ptr<MobilisedRun> run_;
    Index done_ = 0;
  };

  Index steps_;
  Break breaks_;
  std::vector<PlantChannel> extras_ = {{"F_cuff", "N"}};
};

void expect_end(const Mobilisation& m, RunStatus status, const std::string& words) {
  EXPECT_EQ(m.status, status) << word(m.status);
  EXPECT_NE(m.reason.find(words), std::string::npos) << m.reason;
  EXPECT_FALSE(m.reason.empty());
}

TEST(MobilisationStatus, OutOfReachIsFailedInit) {
  Protocol p = brief();
  p.control.kp = p.control.ki = 0.0;
  p.control.weight = false;
  p.start_limit_s = 1.0;
  const Mobilisation m = mobilise(plant(), p);
  expect_end(m, RunStatus::kFailedInit, "the start was not reached within 1 s: joint 'J");
  EXPECT_FALSE(m.record.has_value());
  EXPECT_TRUE(std::isnan(m.largest_slip));
}

TEST(MobilisationStatus, TooFastIsDiverged) {
  Protocol p = brief();
  p.rate_limit = 0.4;
  const Mobilisation m = mobilise(plant(), p);
  expect_end(m, RunStatus::kDiverged, "joint 'J4' moves with -0.4");
  ASSERT_TRUE(m.record.has_value());
  EXPECT_LT(m.record->rows(), 121);  // as far as it came
  EXPECT_GT(m.record->rows(), 10);
}

TEST(MobilisationStatus, WeakMotorsAreDiverged) {
  Protocol p = brief();
  p.follow_limit = 1.0 * kDegree;
  expect_end(mobilise(plant(), p), RunStatus::kDiverged, "degrees away from where it should");
}

TEST(MobilisationStatus, EndOfTheRangeIsALimit) {
  Protocol p = brief();
  p.start[3] = 30 * kDegree;
  p.moved = {{"J4", 0.0}};
  // Without its integral and the weight the controller gives way to the extensors.
  p.excitation.balanced = false;
  p.excitation.flexors = 0.0;
  p.control.ki = 0.0;
  p.control.weight = false;
  p.start_angle = p.follow_limit = 1.0;
  p.motion = {.shape = MotionShape::kMinimumJerk, .duration_s = 0.5, .rest_s = 1.0};
  expect_end(mobilise(plant(), p), RunStatus::kLimit, "joint 'J4' left its range of 0 to 125");
}

// Towards positive angles, of a moved joint, faster than 2 rad/s: nothing else is looked at.
TEST(MobilisationStatus, PublishedFlagsSeeOneDirection) {
  Protocol p = brief();
  p.rate_limit = 0.4;
  p.follow_limit = 1e-6;
  p.published_flags = true;
  run_ok(plant(), p);
  p.start[3] = 20 * kDegree;
  p.moved = {{"J4", 100 * kDegree}};
  p.motion.duration_s = 0.6;
  expect_end(mobilise(plant(), p), RunStatus::kDiverged, "above 2 rad/s: the published flag");
}

TEST(MobilisationStatus, TooSlowIsTimeout) {
  Protocol p = brief();
  p.time_limit_s = 1e-9;
  expect_end(mobilise(plant(), p), RunStatus::kTimeout, "computing took longer than 1e-09 s");
}

TEST(MobilisationStatus, NanIsNonfinite) {
  const Breaking breaking(200, [](Vector& angle) { angle[2] = kNan; });
  const Mobilisation m = mobilise(breaking, brief());
  expect_end(m, RunStatus::kNonfinite, "joint 'J3' is not finite at");
  ASSERT_TRUE(m.record.has_value());
  EXPECT_TRUE(m.record->values().allFinite());  // rows before it, nothing filled in
  EXPECT_GT(column(*m.record, "F_cuff")[3], 0.0);
}

TEST(MobilisationStatus, FaultsOfThePlantHaveAStatusAndAReason) {
  const auto ended = [](Fault fault) {
    const Breaking breaking(150,
                            [fault](Vector&) { throw Error(fault, "", "the plant says why"); });
    return mobilise(breaking, brief());
  };
  expect_end(ended(Fault::kAnalysis), RunStatus::kDiverged, "the plant says why");
  expect_end(ended(Fault::kInternal), RunStatus::kDiverged, "the plant says why");
  expect_end(ended(Fault::kUnsupported), RunStatus::kLimit, "the plant says why");
  expect_end(ended(Fault::kData), RunStatus::kNonfinite, "the plant says why");
  // These are not the run's.
  expect_refusal([&] { ended(Fault::kMemory); }, "why", Fault::kMemory);
  expect_refusal([&] { ended(Fault::kArgument); }, "why", Fault::kArgument);
  Token token;
  token.cancel();
  expect_refusal([&] { mobilise(plant(), brief(), &token); }, "cancelled", Fault::kCancelled);
}

// Nerves
// ------------------------------------------------------------------------------------------

TEST(Excitation, BalancedMusclesPullNeitherWayAtTheStart) {
  const Record record = *run_ok(plant(), brief()).record;
  EXPECT_LT(std::fabs(column(record, "tau_muscle_J4")[0]), 0.2);
  Protocol p = brief();
  p.excitation.balanced = false;
  EXPECT_GT(std::fabs(column(*run_ok(plant(), p).record, "tau_muscle_J4")[0]), 3.0);
}

TEST(Excitation, StretchedMusclesAnswerAfterTheirDelay) {
  for (const double delay : {0.04, 0.2}) {
    Protocol p = brief();
    p.excitation.kind = ExcitationKind::kStretchReflex;
    p.excitation.rate_threshold = 0.02;
    p.excitation.rate_gain = 2.0;
    p.excitation.delay_s = delay;
    const Record record = *run_ok(plant(), p).record;
    const Vector flexor = column(record, "a_brachialis");
    const Vector extensor = column(record, "a_triceps_medial");
    // Extension stretches flexors and not extensors.
    EXPECT_GT(flexor.maxCoeff(), flexor[0] + 0.02);
    EXPECT_LT(extensor.maxCoeff(), extensor[0] + 1e-3);
    Index peak = 0;
    flexor.maxCoeff(&peak);
    // The fastest stretch is near the middle of the movement; activation follows within 40 ms.
    EXPECT_NEAR(0.01 * static_cast<double>(peak), 0.6 + delay, 0.12);
  }
}

TEST(Excitation, VelocityDependentResistanceGrowsWithSpeed) {
  double before = 0.0;
  for (const double duration : {2.4, 1.2, 0.6}) {
    Protocol p = brief();
    p.motion.duration_s = duration;
    p.excitation.kind = ExcitationKind::kVelocityDependent;
    p.excitation.rate_threshold = 0.02;
    p.excitation.rate_gain = 2.0;
    const double most = column(*run_ok(plant(), p).record, "a_brachialis").maxCoeff();
    EXPECT_GT(most, before + 0.02);
    before = most;
  }
}

TEST(Excitation, RefusesWhatCannotBe) {
  const auto refuse = [](auto spoil, const char* words, Fault fault = Fault::kArgument) {
    Protocol p = brief();
    spoil(p.excitation);
    expect_refusal([&] { mobilise(plant(), p); }, words, fault);
  };
  refuse([](ExcitationModel& e) { e.flexors = 1.2; }, "the flexors is 1.2; it must be between");
  refuse([](ExcitationModel& e) { e.extensors = kNan; }, "excitation of the extensors");
  refuse([](ExcitationModel& e) { e.rate_gain = -1.0; }, "rate_gain must be");
  refuse([](ExcitationModel& e) { e.delay_s = 2.0; }, "delay of the reflex");
}

// Slopes of the muscles' torque, against the torque of a real movement.
TEST(LocalImpedance, IsTheSlopeOfTheTorqueAlongAMovement) {
  const Record record = *run_ok(plant(), brief()).record;
  const auto probe = plant().probe();
  const auto row = [&](Index i, const char* prefix) {
    Vector v(4);
    for (Index j = 0; j < 4; ++j) v[j] = column(record, prefix + ("J" + std::to_string(j + 1)))[i];
    return v;
  };
  Vector activation(8);
  double largest = 0.0;
  double error = 0.0;
  for (Index i = 20; i < 100; ++i) {
    for (Index k = 0; k < 8; ++k) {
      activation[k] = column(record, "a_" + plant().muscles()[static_cast<std::size_t>(k)])[i];
    }
    // In the middle between two rows, where a difference is of second order.
    const LocalImpedance at =
        local_impedance(*probe, 0.5 * (row(i, "q_") + row(i + 1, "q_")),
                        0.5 * (row(i, "q_dot_") + row(i + 1, "q_dot_")), activation);
    const Vector change = row(i + 1, "tau_muscle_") - row(i, "tau_muscle_");
    const Vector said = -at.k * (row(i + 1, "q_") - row(i, "q_")) -
                        at.d * (row(i + 1, "q_dot_") - row(i, "q_dot_"));
    error += (change[3] - said[3]) * (change[3] - said[3]) / 80.0;
    largest = std::max(largest, std::fabs(change[3]));
    EXPECT_GT(at.d(3, 3), 0.0);  // force falls with shortening
  }
  EXPECT_GT(largest, 0.05);
  EXPECT_LT(std::sqrt(error),
            1e-3);  // where a curve has a corner, a single row has 5e-3
}

// Sensors
// -----------------------------------------------------------------------------------------

TEST(JointSensors, AddTheirErrorsAndNothingElse) {
  const Record clean = *run_ok(plant(), brief()).record;
  const NominalModel& nominal = plant().nominal();
  const Record same = with_errors(clean, nominal, {}, 1);
  EXPECT_LT((same.values() - clean.values()).cwiseAbs().maxCoeff(), 1e-12);
  const JointSensors sensors{
      .angle_rad = 1e-3, .rate_rad_s = 1e-2, .acceleration_rad_s2 = 0.1, .torque_nm = 0.2};
  const Record noisy = with_errors(clean, nominal, sensors, 7, 3);
  const auto rms = [&](const char* name) {
    const Vector e = column(noisy, name) - column(clean, name);
    return std::sqrt(e.squaredNorm() / static_cast<double>(e.size()));
  };
  // 121 rows tell an rms to 6 %.
  EXPECT_NEAR(rms("theta_J4"), 1e-3, 2e-4);
  EXPECT_NEAR(rms("theta_dot_J4"), 1e-2, 2e-3);
  EXPECT_NEAR(rms("theta_ddot_J4"), 0.1, 0.02);
  EXPECT_NEAR(rms("tau_motor_J4"), 0.2, 0.04);
  EXPECT_GT(rms("tau_hum_J4"), 0.15);
  EXPECT_EQ(rms("tau_muscle_J4"), 0.0);
  EXPECT_EQ(rms("q_J4"), 0.0);
  EXPECT_EQ((with_errors(clean, nominal, sensors, 7, 3).values() - noisy.values()).norm(), 0.0);
  EXPECT_GT((with_errors(clean, nominal, sensors, 7, 4).values() - noisy.values()).norm(), 1.0);
  expect_refusal([&] { with_errors(clean, nominal, {.torque_nm = -1.0}, 1); }, "torque_nm must");
  expect_refusal([&] { with_errors(clean, nominal, {.torque_nm = 1e300}, 1); },
                 "torque_nm is 1e+300; it must be at most 1e+06");
}

// Bad scenes
// --------------------------------------------------------------------------------------

TEST(Protocol, SaysWhatCannotBe) {
  const auto refuse = [](auto spoil, const std::string& words) {
    Protocol p = brief();
    spoil(p);
    expect_refusal([&] { mobilise(plant(), p); }, words);
  };
  refuse([](Protocol& p) { p.moved[0].name = "knee"; },
         "no joint 'knee'; its joints are: J1, J2, J3, J4");
  refuse([](Protocol& p) { p.moved.push_back(p.moved[0]); }, "'J4' is moved twice");
  refuse([](Protocol& p) { p.moved[0].end = -1.0; }, "the end of joint 'J4' is -57.3 degrees");
  refuse([](Protocol& p) { p.moved[0].end = kNan; }, "the end of joint 'J4' is not finite");
  refuse([](Protocol& p) { p.start[3] = 3.0; },
         "the start of joint 'J4' is 171.9 degrees, outside");
  refuse([](Protocol& p) { p.start[1] = kNan; }, "the start of joint 'J2' is not finite");
  refuse([](Protocol& p) { p.start = Vector::Zero(2); }, "the start has 2 angles");
  refuse([](Protocol& p) { p.log_rate_hz = 130.0; }, "whole number of the plant's time steps");
  refuse([](Protocol& p) { p.log_rate_hz = 0.0; }, "rate of the log");
  refuse([](Protocol& p) { p.control.kp = -1.0; }, "kp must be between");
  refuse([](Protocol& p) { p.control.kd = kNan; }, "kd must be between");
  refuse([](Protocol& p) { p.settle_s = -1.0; }, "time to settle");
  refuse([](Protocol& p) { p.control.reference_hold_s = -1.0; }, "the hold of the reference in s");
  refuse([](Protocol& p) { p.control.reference_hold_s = 0.012; }, "the hold of the reference of");
  refuse([](Protocol& p) { p.start_angle = 0.0; }, "tolerance of the start in rad");
  refuse([](Protocol& p) { p.motion.duration_s = 0.0; }, "duration of a movement");
  refuse(
      [](Protocol& p) {
        p.control.mode = TorqueUpdate::kHeld;
        p.control.hold_s = 0.012;
      },
      "the hold of the torque of 12 ms");
  const auto motorless = rigid_plant([](ExoScene& s) { s.exo.links[3].motor_limit = 0.0; });
  expect_refusal([&] { mobilise(*motorless, brief()); }, "joint 'J4' has no motor");
}

TEST(Protocol, NeedsAnArmThatIsHeld) {
  for (const Coupling coupling : {Coupling::kApart, Coupling::kExoOnly, Coupling::kArmOnly}) {
    expect_refusal([&] { rigid_plant([&](ExoScene& s) { s.coupling = coupling; }); },
                   "does not hold the arm");
  }
  const ExoPlant plain{ExoScene()};
  const ExoPlant changed = plain.changed({{ModelQuantity::kMass, "Link1", {7.0}}});
  expect_refusal([&] { mobilised(changed); }, "no nominal model", Fault::kUnsupported);
  EXPECT_EQ(mobilised(changed, &plain.scene())->muscles(), mobilised(plain)->muscles());
  expect_refusal([] { rigid_plant([](ExoScene& s) { s.exo.links[3].mass = -0.5; }); },
                 "body 'Link4' must have a positive mass");
  expect_refusal([] { rigid_plant([](ExoScene& s) { s.arm.ulna.centre[0] = kNan; }); }, "ulna");
  EngineWiring wiring;
  wiring.device_joints = {"J7"};
  wiring.motors = {""};
  wiring.counterparts = {-1};
  expect_refusal([&] { mobilised(plain.model(), wiring, nullptr); }, "no joint 'J7'");
  wiring.counterparts.clear();
  expect_refusal([&] { mobilised(plain.model(), wiring, nullptr); }, "each joint of the device");
}

// A nominal model of another arm is a choice: its errors are then in the torque.
TEST(Protocol, NominalModelMayBeOfAnotherArm) {
  const ExoScene scene;
  ExoScene heavier;
  heavier.arm = ArmDescription::cylinders(1.0, 1.0, 1.761, 1.2);
  heavier.arm.muscles.clear();
  const auto other = mobilised(ExoPlant(scene), &heavier);
  const Record record = *run_ok(*other, brief()).record;
  EXPECT_GT(worst(record, "J4"), 0.1);
  EXPECT_LT(worst(record, "J4"), 2.0);
}

}  // namespace
}  // namespace ulna::sim
