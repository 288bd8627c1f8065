// Passivity by the model and by the energy, against closed forms and the published matrices.
#include <gtest/gtest.h>

#include <cmath>

#include "../impedance/made_record.hpp"
#include "base/error.hpp"
#include "passivity/energy.hpp"
#include "passivity/model.hpp"
#include "passivity/verdict.hpp"

namespace ulna {
namespace {

TEST(Model, ExcessOfTheRelaxedArms) {
  static constexpr double kExcess[] = {4.924, 4.361, 4.236, 3.162, 4.010, 2.839};
  for (int p = 1; p <= 6; ++p) {
    const Truth arm = participant(p);
    const ModelMargins margins = model_passivity(arm.m, arm.b, arm.k, 0.2);
    EXPECT_NEAR(margins.b_min, kExcess[p - 1], 5e-4) << p;  // printed to three decimals
    EXPECT_EQ(margins.excess, margins.b_min);
    EXPECT_EQ(margins.answer, Answer::kPassive) << p;
    EXPECT_GT(margins.m_min, 0.0);
    EXPECT_GT(margins.k_min, 0.0);
  }
  // P6's stiffness is 16.4 % antisymmetric: above the default threshold of 15 %.
  const Truth arm = participant(6);
  const ModelMargins margins = model_passivity(arm.m, arm.b, arm.k);
  EXPECT_FALSE(margins.k_symmetric);
  EXPECT_EQ(margins.answer, Answer::kNotPassive);
  EXPECT_EQ(margins.excess, -kInfinity);
  EXPECT_NEAR(margins.b_min, 2.839, 5e-4);
}

// Table 3.4, underdamped perturbations.
TEST(Model, ExcessOfTheUnderdampedTrials) {
  const Matrix one = Matrix::Identity(2, 2);
  EXPECT_NEAR(model_passivity(one, Matrix{{8.80, -3.77}, {1.56, 14.08}}, one).excess, 8.58, 5e-3);
  EXPECT_NEAR(model_passivity(one, Matrix{{6.02, -4.97}, {-2.24, 10.88}}, one).excess, 4.10, 5e-3);
}

// Theorem 3.2 as printed passes this one.
TEST(Model, ANegativeSecondStiffnessIsNotPassive) {
  const Matrix one = Matrix::Identity(2, 2);
  const Matrix k{{0.0, 0.0}, {0.0, -1.0}};
  const ModelMargins margins = model_passivity(one, one, k);
  EXPECT_EQ(margins.answer, Answer::kNotPassive);
  EXPECT_EQ(margins.k_min, -1.0);
  EXPECT_EQ(margins.excess, -kInfinity);
  EXPECT_EQ(model_passivity(k, one, one).answer, Answer::kNotPassive);
  const ModelMargins damping = model_passivity(one, k, one);
  EXPECT_EQ(damping.answer, Answer::kNotPassive);
  EXPECT_EQ(damping.excess, -1.0);  // a finite shortage
}

TEST(Model, ExactlySingularIsUndecidedAndExactlyZeroPassive) {
  const Matrix one = Matrix::Identity(2, 2);
  const Matrix zero = Matrix::Zero(2, 2);
  EXPECT_EQ(model_passivity(one, zero, one).answer, Answer::kPassive);
  EXPECT_EQ(model_passivity(zero, zero, zero).answer, Answer::kPassive);
  const Matrix singular{{1.0, 2.0}, {2.0, 4.0}};
  EXPECT_EQ(model_passivity(one, singular, one).answer, Answer::kUndecided);
  EXPECT_EQ(model_passivity(one, one, singular).answer, Answer::kUndecided);
  EXPECT_EQ(model_passivity(singular, one, one).answer, Answer::kUndecided);
  // Not passive for another reason outweighs undecided.
  EXPECT_EQ(model_passivity(singular, -one, one).answer, Answer::kNotPassive);
  // The tolerance is a share of the norm.
  const Matrix nearly{{1.0, 0.0}, {0.0, 1e-6}};
  EXPECT_EQ(model_passivity(one, nearly, one).answer, Answer::kPassive);
  EXPECT_EQ(model_passivity(one, nearly, one, 0.15, 1e-3).answer, Answer::kUndecided);
}

TEST(Model, AntisymmetryOfDampingIsAllowed) {
  const Matrix one = Matrix::Identity(2, 2);
  const Matrix turning{{1.0, 5.0}, {-5.0, 1.0}};
  EXPECT_EQ(model_passivity(one, turning, one).answer, Answer::kPassive);
  EXPECT_EQ(model_passivity(one, one, turning).answer, Answer::kNotPassive);
  EXPECT_EQ(model_passivity(turning, one, one).answer, Answer::kNotPassive);
  // Threshold 0: no antisymmetry is dropped.
  const Matrix little{{1.0, 1e-9}, {-1e-9, 1.0}};
  EXPECT_EQ(model_passivity(one, one, little, 0.0).answer, Answer::kNotPassive);
  EXPECT_EQ(model_passivity(one, one, one, 0.0).answer, Answer::kPassive);
}

TEST(Model, AnySizeAndBadSizes) {
  const Matrix six = Matrix::Identity(6, 6);
  EXPECT_EQ(model_passivity(six, 2.0 * six, six).excess, 2.0);
  EXPECT_EQ(model_passivity(Matrix::Constant(1, 1, 1.0), Matrix::Constant(1, 1, -0.5),
                            Matrix::Constant(1, 1, 1.0))
                .excess,
            -0.5);
  EXPECT_THROW(model_passivity(six, six, Matrix::Identity(5, 5)), Error);
  EXPECT_THROW(model_passivity(Matrix(0, 0), Matrix(0, 0), Matrix(0, 0)), Error);
  EXPECT_THROW(model_passivity(six, Matrix::Constant(6, 6, std::nan("")), six), Error);
  EXPECT_THROW(model_passivity(six, six, six, -0.1), Error);
}

constexpr double kRate = 1000.0;

// Position 1 - cos, velocity sin: starts at rest, ends each second at rest.
struct Motion {
  Matrix position, velocity, acceleration;
};
Motion motion(Index rows) {
  Motion out{Matrix(rows, 1), Matrix(rows, 1), Matrix(rows, 1)};
  const double w = 2.0 * kPi;
  for (Index i = 0; i < rows; ++i) {
    const double t = static_cast<double>(i) / kRate;
    out.position(i, 0) = (1.0 - std::cos(w * t)) / w;
    out.velocity(i, 0) = std::sin(w * t);
    out.acceleration(i, 0) = w * std::cos(w * t);
  }
  return out;
}

TEST(Energy, ADamperAbsorbsWhatItDissipates) {
  const Motion m = motion(3001);
  const double b = 4.0;
  const EnergySeries series = absorbed_energy(-b * m.velocity, m.velocity, kRate);
  // The trapezoid is exact for whole periods of a sine: b / 2 each second.
  EXPECT_NEAR(series.energy_j[3000], 1.5 * b, 1e-10);
  EXPECT_NEAR(series.dissipation[3000], 1.5, 1e-10);
  EXPECT_EQ(series.time_s[3000], 3.0);
  EXPECT_EQ(series.energy_j[0], 0.0);
  const EnergyIndex index = energy_index(series, 0.0, 0.05);
  EXPECT_NEAR(index.delta, b, 1e-12);
  // A negative damper: the shortage is found with its sign.
  EXPECT_NEAR(energy_index(absorbed_energy(b * m.velocity, m.velocity, kRate), 0.0, 0.05).delta, -b,
              1e-12);
}

TEST(Energy, ASpringGivesBackWhatItTook) {
  const Motion m = motion(3001);
  const double k = 50.0;
  const EnergySeries series = absorbed_energy(-k * m.position, m.velocity, kRate);
  for (const Index i : {0, 250, 700, 1500, 2900}) {
    // Trapezoid: step^2 / 12 of the slope of the power, at most k w: 3e-5.
    EXPECT_NEAR(series.energy_j[i], 0.5 * k * m.position(i, 0) * m.position(i, 0), 3e-5);
  }
  const EnergyIndex index = energy_index(series, 0.0, 0.05);
  EXPECT_NEAR(index.delta, 0.0, 1e-9);  // at whole seconds it is at rest
  EXPECT_NEAR(std::remainder(index.time_s, 1.0), 0.0, 1e-12);
}

TEST(Energy, BetaIsWhatWasStoredBefore) {
  // Starts stretched, and the spring lets go: without beta it looks active.
  const Motion m = motion(501);
  const double k = 50.0;
  const Matrix stretched = m.position.array() - 1.0 / kPi;  // ends at 0 after half a second
  const EnergySeries series = absorbed_energy(-k * stretched, m.velocity, kRate);
  const double stored = 0.5 * k / (kPi * kPi);
  EXPECT_NEAR(series.energy_j[500], -stored, 1e-4);
  EXPECT_LT(energy_index(series, 0.0, 0.05).delta, -1.0);
  EXPECT_GT(energy_index(series, -stored, 0.05).delta, -1e-3);  // the trapezoid's error over D
}

// M, B, K with a shortage: over whole periods only the damping counts.
TEST(Energy, AKnownShortageIsFound) {
  const Motion m = motion(20001);
  const double b = -1.5;
  const Matrix force = -(2.0 * m.acceleration + b * m.velocity + 30.0 * m.position);
  const EnergySeries series = absorbed_energy(force, m.velocity, kRate);
  const EnergyIndex index = energy_index(series, 0.0, 0.05);
  // At rest (whole seconds) E = b D exactly; elsewhere the stored energy is on top.
  EXPECT_NEAR(index.delta, b, 1e-4);
  const std::vector<double> draws = energy_index_bootstrap({series}, 0.05, 2.0, 200, 4);
  ASSERT_EQ(draws.size(), 200u);
  for (const double d : draws) EXPECT_NEAR(d, b, 1e-3);
  EXPECT_EQ(draws, energy_index_bootstrap({series}, 0.05, 2.0, 200, 4));
}

TEST(Energy, SeveralTrialsTheWeakestCounts) {
  const Motion m = motion(2001);
  const EnergySeries strong = absorbed_energy(-5.0 * m.velocity, m.velocity, kRate);
  const EnergySeries weak = absorbed_energy(-2.0 * m.velocity, m.velocity, kRate);
  EXPECT_NEAR(energy_index({strong, weak}, {0.0, 0.0}, 0.05).delta, 2.0, 1e-12);
}

TEST(Energy, NothingMovedIsNoAnswer) {
  const Matrix rest = Matrix::Zero(100, 2);
  EXPECT_TRUE(std::isnan(energy_index(absorbed_energy(rest, rest, kRate), 0.0, 0.05).delta));
  EXPECT_TRUE(std::isnan(
      energy_index(absorbed_energy(Matrix(0, 1), Matrix(0, 1), kRate), 0.0, 0.05).delta));
  EXPECT_THROW(absorbed_energy(rest, Matrix::Zero(99, 2), kRate), Error);
  EXPECT_THROW(absorbed_energy(rest, rest, 0.0), Error);
  EXPECT_TRUE(
      energy_index_bootstrap({absorbed_energy(rest, rest, kRate)}, 0.05, 2.0, 100, 0).empty());
}

// At rest about the place of the motion: a spring stretched to elsewhere would hold joules, and
// beta would excuse any shortage of so short a record.
Verdict judge(Truth truth, double noise = 0.5, const VerdictOptions& options = {}) {
  truth.x0 = Vector{{0.1, 0.1}};
  Recording recording;
  recording.duration_s = 50.0;
  recording.force_noise = noise;
  return assess_passivity(identify_impedance(make_record(truth, recording), {}), options);
}

TEST(Verdict, ARelaxedArmIsPassiveByBothApproaches) {
  const Truth arm = participant(1);
  const Verdict v = judge(arm);
  EXPECT_EQ(v.answer, Answer::kPassive);
  EXPECT_EQ(v.approach, Approach::kModel);
  EXPECT_GT(v.probability, 0.95);
  EXPECT_GT(v.energy_probability, 0.95);
  EXPECT_LT(v.excess_interval[0], 4.924);
  EXPECT_GT(v.excess_interval[1], 4.924);
  EXPECT_LT(v.beta_j, 0.0);
  EXPECT_FALSE(v.reason.empty());
  EXPECT_FALSE(v.would_change.empty());
}

TEST(Verdict, NegativeDampingIsNotPassive) {
  Truth truth = participant(1);
  truth.b = Matrix{{-3.0, 0.0}, {0.0, -3.0}};
  const Verdict v = judge(truth);
  EXPECT_EQ(v.answer, Answer::kNotPassive);
  EXPECT_LT(v.probability, 0.05);
  EXPECT_NEAR(v.model.b_min, -3.0, 0.5);
  EXPECT_LT(v.energy.delta, -1.0);
}

TEST(Verdict, ADampingThatNoiseHidesIsUndecided) {
  Truth truth = participant(1);
  truth.b = 0.1 * Matrix::Identity(2, 2);  // one to two standard errors
  const Verdict v = judge(truth);
  EXPECT_EQ(v.answer, Answer::kUndecided);
  EXPECT_LT(v.excess_interval[0], 0.0);
  EXPECT_GT(v.excess_interval[1], 0.0);
  EXPECT_NE(v.would_change.find("damping"), std::string::npos) << v.would_change;
}

TEST(Verdict, OptionsAreChecked) {
  VerdictOptions options;
  options.level = 0.4;
  EXPECT_THROW(judge(participant(1), 0.5, options), Error);
  options = {};
  options.min_share = 1.0;
  EXPECT_THROW(judge(participant(1), 0.5, options), Error);
  options = {};
  options.block_s = 0.0;
  EXPECT_THROW(judge(participant(1), 0.5, options), Error);
}

}  // namespace
}  // namespace ulna
