// Stiffness and damping of a passively moved joint: against the muscles' true ones, with errors of
// the sensors, by the published estimator, and where they cannot be found.
#include "impedance/viscoelastic.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "plant/arm_muscles.hpp"
#include "plant/engine_mobilised.hpp"
#include "refusal.hpp"
#include "sim/mobilisation.hpp"

namespace ulna {
namespace {

using made::expect_refusal;

using sim::ExcitationKind;
using sim::JointSensors;
using sim::MotionShape;
using sim::Protocol;

std::shared_ptr<const MobilisedPlant> make_plant(bool published_muscles = false,
                                                 double timestep = 0.005) {
  ExoScene scene;
  scene.solver.timestep = timestep;
  if (published_muscles) scene.arm.muscles = published_elbow_muscles();
  return mobilised(ExoPlant(scene));
}

const MobilisedPlant& arm() {
  static const std::shared_ptr<const MobilisedPlant> kPlant = make_plant();
  return *kPlant;
}

Record moved(const MobilisedPlant& plant, const Protocol& protocol = {}) {
  const sim::Mobilisation m = sim::mobilise(plant, protocol);
  EXPECT_EQ(m.status, sim::RunStatus::kOk) << m.reason;
  return *m.record;
}

// The default: published movement, co-contraction of 0.4.
const Record& log() {
  static const Record kLog = moved(arm());
  return kLog;
}

Viscoelasticity assess(const Record& record, const ViscoelasticOptions& options = {}) {
  return identify_viscoelasticity(record, arm().nominal(), options).at(0);
}

Vector column(const Record& record, const std::string& name) {
  return record.column(record.find(name));
}

// Rigid coupling, perfect alignment, true nominal model.
TEST(Viscoelastic, IsTheTruthWhereNothingIsUncertain) {
  for (const bool published : {false, true}) {
    const auto plant = make_plant(published);
    // The published muscles would pull the elbow to its limit at the end.
    const double end = published ? 20 * kDegree : 0.0;
    for (const ExcitationKind kind : {ExcitationKind::kConstant, ExcitationKind::kStretchReflex,
                                      ExcitationKind::kVelocityDependent}) {
      Protocol p;
      p.moved = {{"J4", end}};
      p.excitation.kind = kind;
      const Record record = moved(*plant, p);
      const Viscoelasticity v = identify_viscoelasticity(record, plant->nominal()).at(0);
      ASSERT_TRUE(v.truth.known);
      // Half a percent is asked for; the residual of the dynamics is rounding.
      EXPECT_NEAR(v.k, v.truth.k, 1e-6 * std::fabs(v.truth.k));
      EXPECT_NEAR(v.d, v.truth.d, 1e-6 * std::fabs(v.truth.d));
      EXPECT_LT(v.model_residual_max, 1e-6);
      EXPECT_EQ(v.joint, "J4");
      EXPECT_EQ(v.rows, 601);
    }
  }
}

// K = -d tau / d q: flexing torque of the co-contracted published muscles grows with flexion.
TEST(Viscoelastic, HasTheSignOfAResistance) {
  const auto plant = make_plant(true);
  Protocol p;
  p.moved = {{"J4", 20 * kDegree}};
  const Viscoelasticity v = identify_viscoelasticity(moved(*plant, p), plant->nominal()).at(0);
  EXPECT_LT(v.k, -5.0);
  EXPECT_LT(v.k_interval[1], 0.0);
  ASSERT_FALSE(v.warnings.empty());
  EXPECT_NE(v.warnings.back().find("anti-spring"), std::string::npos);
  EXPECT_GT(v.d, 0.0);  // muscles that are stretched pull more
}

TEST(Viscoelastic, HalvingTheStepChangesLittle) {
  for (const bool published : {false, true}) {
    const auto coarse = make_plant(published);
    const auto fine = make_plant(published, 0.0025);
    Protocol p;
    p.moved = {{"J4", 20 * kDegree}};
    const double k = identify_viscoelasticity(moved(*coarse, p), coarse->nominal()).at(0).k;
    const double half = identify_viscoelasticity(moved(*fine, p), fine->nominal()).at(0).k;
    EXPECT_NEAR(k, half, 0.003 * std::fabs(half));  // asked for: 1 %
  }
}

struct Coverage {
  int k = 0, d = 0;
  double worst_error = 0.0;  // of K, relative
  double width = 0.0;
};

Coverage coverage_of(const JointSensors& sensors, const ViscoelasticOptions& options,
                     std::uint64_t count, std::uint64_t seed) {
  Coverage c;
  for (std::uint64_t run = 0; run < count; ++run) {
    const Viscoelasticity v =
        assess(sim::with_errors(log(), arm().nominal(), sensors, seed, run), options);
    c.k += v.k_interval[0] <= v.truth.k && v.truth.k <= v.k_interval[1] ? 1 : 0;
    c.d += v.d_interval[0] <= v.truth.d && v.truth.d <= v.d_interval[1] ? 1 : 0;
    c.worst_error = std::max(c.worst_error, std::fabs(v.k / v.truth.k - 1.0));
    c.width += (v.k_interval[1] - v.k_interval[0]) / static_cast<double>(count);
  }
  return c;
}

// An encoder of 0.006 degrees, a rate from it, and a motor's current.
constexpr JointSensors kSensors{
    .angle_rad = 1e-4, .rate_rad_s = 2e-3, .acceleration_rad_s2 = 0.05, .torque_nm = 0.1};

// 95 of 100 intervals are asked to hold the truth. Over 300 repetitions a share has a standard
// error of 1.3 %: these bounds are two of them below and three above.
TEST(Viscoelastic, IntervalsCoverTheTruth) {
  constexpr int kRuns = 300;
  const Coverage c = coverage_of(kSensors, {}, kRuns, 1);
  EXPECT_GE(c.k, 0.925 * kRuns);
  EXPECT_GE(c.d, 0.925 * kRuns);
  EXPECT_LE(c.k, 0.99 * kRuns);  // nor too wide to say anything
  EXPECT_LT(c.worst_error, 0.05);
  RecordProperty("covered_k", c.k);
  RecordProperty("covered_d", c.d);
}

TEST(Viscoelastic, BootstrapCoversTheTruthToo) {
  constexpr int kRuns = 60;
  ViscoelasticOptions o;
  o.errors = ErrorModel::kBlockBootstrap;
  o.bootstrap = 300;
  const Coverage c = coverage_of(kSensors, o, kRuns, 2);
  EXPECT_GE(c.k, 0.87 * kRuns);  // 3 standard errors of 60 repetitions
  EXPECT_GE(c.d, 0.87 * kRuns);
}

// Errors that last as long as a good part of the movement look like the arm. Those of 3 Hz are
// seen.
TEST(Viscoelastic, IntervalsSeeCorrelatedErrors) {
  JointSensors slow;
  slow.slow_torque_nm = 0.1;
  slow.slow_hz = 3.0;
  const Coverage c = coverage_of(slow, {}, 100, 3);
  EXPECT_GE(c.k, 85);  // two standard errors below 91
  JointSensors white;
  white.torque_nm = 0.1;
  EXPECT_GT(c.width, 2.0 * coverage_of(white, {}, 20, 3).width);
}

TEST(Viscoelastic, CountedMisfitIsWider) {
  ViscoelasticOptions o;
  o.count_misfit = true;
  const Viscoelasticity all = assess(log(), o);
  const Viscoelasticity noise = assess(log());
  EXPECT_EQ(all.k, noise.k);
  EXPECT_GT(all.k_error, 3.0 * noise.k_error);
  EXPECT_LT(noise.noise_rms, 0.5 * noise.residual_rms);
}

// The published label and regressors, by hand.
TEST(Viscoelastic, PublishedEstimatorIsTheSlopeOnTheHumanAngle) {
  const Viscoelasticity v = assess(log(), ViscoelasticOptions::published());
  const Index rows = log().rows();
  Vector label(rows);
  for (Index i = 0; i < rows; ++i) {
    Vector angle(4), rate(4);
    for (Index j = 0; j < 4; ++j) {
      angle[j] = column(log(), "theta_J" + std::to_string(j + 1))[i];
      rate[j] = column(log(), "theta_dot_J" + std::to_string(j + 1))[i];
    }
    const Vector bias = arm().nominal().tree().inverse_dynamics(angle, rate, Vector::Zero(4));
    label[i] = bias[3] - column(log(), "tau_motor_J4")[i];
  }
  const Vector q = column(log(), "q_J4");
  const Vector centred = q.array() - q.mean();
  const double slope = centred.dot(label) / centred.squaredNorm();
  EXPECT_NEAR(v.k, -slope, 1e-9);
  EXPECT_TRUE(std::isnan(v.d));
  const Vector muscle = column(log(), "tau_muscle_J4");
  EXPECT_NEAR(v.truth.k_alone, -centred.dot(muscle) / centred.squaredNorm(), 1e-9);
  EXPECT_NEAR(v.truth.k, v.truth.k_alone, 1e-9);
  // What it leaves out, friction above all, is taken for the arm's.
  EXPECT_GT(v.model_residual_max, 2.787);
}

// A device that measures angles and torques only.
TEST(Viscoelastic, RatesThatAreNotThereAreDerivatives) {
  Record::Parts parts;
  std::vector<Channel> kept;
  std::vector<Index> columns;
  for (Index c = 0; c < log().channel_count(); ++c) {
    const Channel& channel = log().channels()[static_cast<std::size_t>(c)];
    if (channel.name.rfind("theta_dot_", 0) == 0 || channel.name.rfind("theta_ddot_", 0) == 0) {
      continue;
    }
    kept.push_back(channel);
    columns.push_back(c);
  }
  parts.values.resize(log().rows(), static_cast<Index>(columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i) {
    parts.values.col(static_cast<Index>(i)) = log().column(columns[i]);
  }
  parts.channels = kept;
  parts.rate_hz = 100.0;
  const Viscoelasticity v = assess(Record::make(std::move(parts)));
  const Viscoelasticity whole = assess(log());
  EXPECT_NEAR(v.k, whole.k, 0.02 * std::fabs(whole.k));
  EXPECT_NEAR(v.d, whole.d, 0.02 * whole.d);
}

// The log is an ordinary record: the endpoint estimator reads it, with its own sign of K.
TEST(Viscoelastic, OrdinaryIdentificationReadsTheLog) {
  Protocol p;
  p.motion = {
      .shape = MotionShape::kSinusoid, .duration_s = 1.0, .speeds = {0.5, 1.0, 1.7}, .repeats = 3};
  p.start = arm().reference();
  p.start[3] = 90 * kDegree;
  p.moved = {{"J4", 60 * kDegree}};
  p.excitation.balanced = true;
  const Record record = moved(arm(), p);
  const Viscoelasticity v = assess(record);
  ImpedanceOptions options;
  options.refit = Refit::kYes;
  options.estimator = EstimatorChoice::kLeastSquares;
  const ImpedanceEstimate e = identify_impedance(record, options);
  EXPECT_TRUE(e.rotational);
  EXPECT_EQ(e.n, 1);
  // The same regression by hand, without smoothing: acceleration is a regressor there.
  const Index rows = record.rows();
  Matrix x(rows, 4);
  x << column(record, "theta_ddot_J4"), column(record, "theta_dot_J4"), column(record, "theta_J4"),
      Vector::Ones(rows);
  const Vector theta = -Vector(x.colPivHouseholderQr().solve(column(record, "tau_hum_J4")));
  EXPECT_NEAR(e.fit.m(0, 0), theta[0], 0.02);
  EXPECT_NEAR(e.fit.b(0, 0), theta[1], 0.03 * theta[1]);
  EXPECT_NEAR(e.fit.k(0, 0), theta[2], 0.05 * std::fabs(theta[2]) + 0.1);
  EXPECT_NEAR(v.d, theta[1], 0.1 * theta[1]);
}

TEST(Viscoelastic, SaysWhatItCannotDo) {
  const auto refuse = [](const Record& record, const ViscoelasticOptions& o, const char* words,
                         Fault fault) { expect_refusal([&] { assess(record, o); }, words, fault); };
  refuse(log(), {.joints = {"knee"}}, "no joint 'knee'", Fault::kArgument);
  refuse(log(), {.level = 1.5}, "level must be", Fault::kArgument);
  refuse(log(), {.hac_lag_s = 0.0}, "hac_lag_s must be", Fault::kArgument);
  refuse(log(), {.bootstrap = 3}, "bootstrap must be", Fault::kArgument);
  refuse(log(), {.joints = {"J1"}}, "does not determine its stiffness", Fault::kAnalysis);
  Record::Parts parts = log().parts();
  parts.values(17, log().find("tau_motor_J4")) = std::numeric_limits<double>::quiet_NaN();
  refuse(Record::make(parts), {}, "tau_motor_J4 is not finite in row 17", Fault::kData);
  parts = log().parts();
  parts.values = Matrix(log().values().topRows(20));
  parts.time.clear();
  parts.trials.clear();
  parts.segments.clear();
  refuse(Record::make(parts), {}, "only 20 rows", Fault::kData);
  parts = log().parts();
  for (Channel& channel : parts.channels) channel.role = Role::kOther;
  refuse(Record::make(parts), {}, "has the role position", Fault::kArgument);
  for (Channel& channel : parts.channels) {
    if (channel.name == "theta_J2") channel.name = "shoulder";
  }
  refuse(Record::make(parts), {.joints = {"J4"}}, "theta_J2", Fault::kArgument);
  ViscoelasticOptions human;
  human.human_angle = true;
  for (Channel& channel : parts.channels) {
    if (channel.name == "shoulder") channel.name = "theta_J2";
    if (channel.name == "q_J4") channel.name = "elbow";
  }
  human.joints = {"J4"};
  refuse(Record::make(parts), human, "no true human angle", Fault::kArgument);
  Token token;
  token.cancel();
  EXPECT_THROW(identify_viscoelasticity(log(), arm().nominal(), {}, &token), Error);
}

}  // namespace
}  // namespace ulna
