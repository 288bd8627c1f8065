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

// Of K and of D over noisy repetitions of one record.
struct Spread {
  double mean[2] = {0.0, 0.0}, deviation[2] = {0.0, 0.0};
  double error[2] = {0.0, 0.0};    // mean of those reported
  double covered[2] = {0.0, 0.0};  // share of intervals that hold `about`
};

Spread spread_of(const Record& record, const NominalModel& nominal, const JointSensors& sensors,
                 int count, std::uint64_t seed, double k, double d) {
  Spread s;
  const double about[2] = {k, d};
  double squares[2] = {0.0, 0.0};
  for (int run = 0; run < count; ++run) {
    const Viscoelasticity v =
        identify_viscoelasticity(
            sim::with_errors(record, nominal, sensors, seed, static_cast<std::uint64_t>(run)),
            nominal)
            .at(0);
    const double value[2] = {v.k, v.d};
    const double error[2] = {v.k_error, v.d_error};
    const double* interval[2] = {v.k_interval, v.d_interval};
    for (int i = 0; i < 2; ++i) {
      const double away = value[i] - about[i];
      s.mean[i] += away / count;
      squares[i] += away * away / count;
      s.error[i] += error[i] / count;
      s.covered[i] += interval[i][0] <= about[i] && about[i] <= interval[i][1] ? 1.0 / count : 0.0;
    }
  }
  for (int i = 0; i < 2; ++i) s.deviation[i] = std::sqrt(squares[i] - s.mean[i] * s.mean[i]);
  return s;
}

// There and back at two speeds: curves of the muscles over angle and rate that no line is.
const Record& there_and_back() {
  static const Record kLog = [] {
    Protocol p;
    p.motion = {.shape = MotionShape::kMinimumJerk, .speeds = {1.0, 2.0}};
    p.moved = {{"J4", 10 * kDegree}};
    return moved(arm(), p);
  }();
  return kLog;
}

struct Noise {
  const char* name;
  JointSensors sensors;
};

// An encoder of 0.006 degrees, a rate from it, and a motor's current.
constexpr JointSensors kSensors{
    .angle_rad = 1e-4, .rate_rad_s = 2e-3, .acceleration_rad_s2 = 0.05, .torque_nm = 0.1};

JointSensors band(double hz) {
  JointSensors sensors;
  sensors.slow_torque_nm = 0.1;
  sensors.slow_hz = hz;
  return sensors;
}

// Coupling and nominal model are true here, so that the mean is the truth. A standard deviation of
// 100 repetitions has an error of 7 %, a share of 95 % one of 2.2 %: bounds are those asked for
// over 300 (0.85 to 1.2, 93 to 97 %, measured in Python) and two such errors.
TEST(Viscoelastic, ErrorsAreThoseOfRepetitions) {
  constexpr int kRuns = 100;
  for (const Record* record : {&log(), &there_and_back()}) {
    const Viscoelasticity v = assess(*record);
    for (const Noise& noise :
         {Noise{"white", kSensors}, Noise{"10 Hz", band(10.0)}, Noise{"3 Hz", band(3.0)}}) {
      const Spread s =
          spread_of(*record, arm().nominal(), noise.sensors, kRuns, 1, v.truth.k, v.truth.d);
      for (int i = 0; i < 2; ++i) {
        SCOPED_TRACE(std::string(noise.name) + (i == 0 ? ", K, " : ", D, ") +
                     std::to_string(record->rows()) + " rows");
        EXPECT_GT(s.error[i] / s.deviation[i], 0.85 - 0.14);
        EXPECT_LT(s.error[i] / s.deviation[i], 1.2 + 0.14);
        EXPECT_GE(s.covered[i], 0.93 - 0.045);
      }
    }
  }
}

// Noise as slow as the movement looks like the arm; with the misfit counted it is held.
TEST(Viscoelastic, SlowErrorsAreInTheMisfit) {
  const Viscoelasticity v = assess(there_and_back());
  int held = 0;
  for (std::uint64_t run = 0; run < 40; ++run) {
    const Viscoelasticity noisy =
        assess(sim::with_errors(there_and_back(), arm().nominal(), band(0.5), 3, run));
    held += noisy.k_misfit_interval[0] <= v.k && v.k <= noisy.k_misfit_interval[1] ? 1 : 0;
  }
  EXPECT_GE(held, 34);  // of 40; 38 are expected, 3 standard errors are 4
}

// An arm whose torque is a line: there is no misfit, and every error is that of the noise.
TEST(Viscoelastic, MisfitOfALineIsNoise) {
  Record::Parts parts = log().parts();
  const Index motor = log().find("tau_motor_J4");
  const Viscoelasticity v = assess(log());
  // What the motor would have held of an arm that is its own line.
  const Vector line = v.offset - v.k * column(log(), "theta_J4").array() -
                      v.d * column(log(), "theta_dot_J4").array();
  parts.values.col(motor) += column(log(), "tau_hum_J4") - line;
  const Record straight = Record::make(std::move(parts));
  // Columns that depend on others to 1e-6 are not taken off.
  EXPECT_LT(assess(straight).k_error, 1e-6);
  for (const ErrorModel errors : {ErrorModel::kNeweyWest, ErrorModel::kBlockBootstrap}) {
    ViscoelasticOptions o;
    o.errors = errors;
    o.bootstrap = 300;
    double ratio = 0.0;
    int held = 0;
    constexpr int kRuns = 60;
    for (std::uint64_t run = 0; run < kRuns; ++run) {
      const Viscoelasticity noisy =
          assess(sim::with_errors(straight, arm().nominal(), kSensors, 2, run), o);
      ratio += noisy.k_misfit_error / noisy.k_error / kRuns;
      held += noisy.k_misfit_interval[0] <= v.k && v.k <= noisy.k_misfit_interval[1] ? 1 : 0;
    }
    EXPECT_NEAR(ratio, 1.0, 0.15);
    EXPECT_GE(held, 0.87 * kRuns);  // 3 standard errors of 60 repetitions
  }
}

TEST(Viscoelastic, MisfitIsTold) {
  const Viscoelasticity v = assess(log());
  EXPECT_GT(v.k_misfit_error, 3.0 * v.k_error);
  EXPECT_GT(v.d_misfit_error, 3.0 * v.d_error);
  EXPECT_LT(v.k_misfit_interval[0], v.k_interval[0]);
  EXPECT_LT(v.noise_rms, 0.05 * v.residual_rms);
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
