// Identification of records whose impedance is known.
#include "impedance/estimate.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "made_record.hpp"

namespace ulna {
namespace {

Matrix random_matrix(Index n, std::uint64_t seed) {
  Random random(seed);
  Matrix out(n, n);
  for (double& x : out.reshaped()) x = random.normal();
  return out;
}

// A free truth of any size: positive definite plus an antisymmetric part.
Truth free_truth(Index n) {
  const auto matrix = [&](double size, std::uint64_t seed) {
    return Matrix(size * (Matrix::Identity(n, n) + 0.2 * random_matrix(n, seed)));
  };
  const auto un = static_cast<std::uint64_t>(n);
  return {matrix(1.5, un), matrix(8.0, 10 + un), matrix(90.0, 20 + un),
          0.1 * random_matrix(n, 30 + un).col(0)};
}

Matrix symmetric(const Matrix& a) { return 0.5 * (a + a.transpose()); }

double relative(const Matrix& value, const Matrix& expected) {
  return (value - expected).norm() / expected.norm();
}

void expect_truth(const ImpedanceFit& fit, const Truth& truth, double tolerance) {
  EXPECT_LT(relative(fit.m, truth.m), tolerance);
  EXPECT_LT(relative(fit.k, truth.k), tolerance);
  EXPECT_LT(relative(fit.x0, truth.x0), tolerance);
  if (truth.b.norm() > 0.0) {
    EXPECT_LT(relative(fit.b, truth.b), tolerance);
  } else {
    EXPECT_EQ(fit.b.norm(), 0.0);
  }
}

ImpedanceEstimate identify(const Truth& truth, const Recording& recording,
                           const ImpedanceOptions& options = {}) {
  return identify_impedance(make_record(truth, recording), options);
}

TEST(Identify, WithoutNoiseTheTruthComesBack) {
  for (const Index n : {1, 2, 3, 6}) {
    for (const bool reference : {true, false}) {
      SCOPED_TRACE(::testing::Message() << n << (reference ? " axes, reference" : " axes"));
      const Truth truth = free_truth(n);
      Recording recording;
      recording.reference = reference;
      const ImpedanceEstimate e = identify(truth, recording);
      expect_truth(e.fit, truth, 1e-6);
      EXPECT_EQ(e.fit.estimator, reference ? Estimator::kInstrumental : Estimator::kLeastSquares);
      EXPECT_EQ(e.alternative != nullptr, reference);
      if (reference) expect_truth(*e.alternative, truth, 1e-6);
      EXPECT_NEAR(e.fit.vaf.minCoeff(), 100.0, 1e-6);
      EXPECT_EQ(e.fit.outcome & ~kUnchecked, 0u);
      EXPECT_EQ((e.fit.outcome & kUnchecked) != 0, !reference);
    }
  }
}

TEST(Identify, AtOneKilohertzWithTheArmOfTheThesis) {
  for (int p = 1; p <= 6; ++p) {
    Recording recording;
    recording.rate_hz = 1000.0;
    recording.duration_s = 25.0;
    const ImpedanceEstimate e = identify(participant(p), recording);
    expect_truth(e.fit, participant(p), 1e-6);
    EXPECT_TRUE(e.warnings.empty()) << e.warnings[0];
  }
}

TEST(Identify, EveryStructureFindsATruthOfItsKind) {
  for (const Index n : {1, 2, 3}) {
    for (const Model model : {Model::kFree, Model::kSymmetric, Model::kPassive}) {
      for (const bool no_damping : {false, true}) {
        for (const bool diagonal_mass : {false, true}) {
          SCOPED_TRACE(::testing::Message() << "n " << n << " model " << static_cast<int>(model)
                                            << " B=0 " << no_damping << " M=mI " << diagonal_mass);
          Truth truth = free_truth(n);
          if (model != Model::kFree) {
            truth = {symmetric(truth.m), symmetric(truth.b), symmetric(truth.k), truth.x0};
          }
          if (no_damping) truth.b.setZero();
          if (diagonal_mass) truth.m = 1.7 * Matrix::Identity(n, n);
          ImpedanceOptions options;
          options.structure = {model, no_damping, diagonal_mass};
          const ImpedanceEstimate e = identify(truth, {}, options);
          expect_truth(e.fit, truth, 1e-6);
          EXPECT_FALSE(e.fit.constrained);
          EXPECT_EQ(e.fit.outcome, kGood);
        }
      }
    }
  }
}

// The constraint is part of the fit: the other parameters move as well.
TEST(Identify, AnActiveConstraintIsMetAndSaid) {
  Truth truth = participant(1);
  truth = {symmetric(truth.m), Matrix{{-2.0, 0.5}, {0.5, 6.0}}, symmetric(truth.k), truth.x0};
  ImpedanceOptions options;
  options.structure.model = Model::kPassive;
  const ImpedanceEstimate e = identify(truth, {}, options);
  EXPECT_TRUE(e.fit.constrained);
  for (const Matrix* z : {&e.fit.m, &e.fit.b, &e.fit.k}) {
    EXPECT_LT((*z - z->transpose()).norm(), 1e-12 * z->norm());
    EXPECT_GE(Eigen::SelfAdjointEigenSolver<Matrix>(*z).eigenvalues()[0], -1e-12 * z->norm());
  }
  EXPECT_LT(e.fit.vaf.minCoeff(), 99.9);
  const auto says = [&](const std::string& text) {
    return text.find("constraint") != std::string::npos;
  };
  EXPECT_TRUE(std::any_of(e.notes.begin(), e.notes.end(), says));
}

TEST(Identify, AStructureThatDoesNotHoldShowsInTheFit) {
  Truth truth = participant(1);
  ImpedanceOptions options;
  options.structure.no_damping = true;
  const ImpedanceEstimate e = identify(truth, {}, options);
  EXPECT_EQ(e.fit.b.norm(), 0.0);
  EXPECT_LT(e.fit.vaf.minCoeff(), 99.0);
}

TEST(Identify, ThePayloadIsTakenOutOfTheInertia) {
  const Truth arm = participant(1);
  Truth seen = arm;
  seen.m += 0.329 * Matrix::Identity(2, 2);  // wrist support and handle of the thesis
  ImpedanceOptions options;
  options.payload_kg = 0.329;
  const ImpedanceEstimate e = identify(seen, {}, options);
  expect_truth(e.fit, arm, 1e-6);
  EXPECT_NEAR(e.fit.vaf.minCoeff(), 100.0, 1e-6);
  // The prediction is of the force that was measured, payload included.
  const Matrix force = predict_force(e, e.fit, 0);
  EXPECT_LT(relative(force, e.prepared->trials[0].force()), 1e-6);
  // Together with M = m I the payload goes out of m.
  options.structure.diagonal_mass = true;
  seen.m = (1.2 + 0.329) * Matrix::Identity(2, 2);
  EXPECT_NEAR(identify(seen, {}, options).fit.m(0, 0), 1.2, 1e-6);
}

TEST(Identify, SeveralTrialsGiveAMeanAnErrorAndAJointFit) {
  Recording recording;
  recording.trials = 4;
  recording.duration_s = 20.0;
  recording.force_noise = 2.0;
  const Truth truth = participant(3);
  const Record record = make_record(truth, recording);
  const ImpedanceEstimate e = identify_impedance(record, {});
  ASSERT_EQ(e.trials.size(), 4u);
  ASSERT_EQ(e.trial_mean.size(), 14);
  Matrix table(4, 14);
  for (Index t = 0; t < 4; ++t)
    table.row(t) = e.trials[static_cast<std::size_t>(t)].natural.transpose();
  for (Index j = 0; j < 14; ++j) {
    const double mean = table.col(j).mean();
    const double error = std::sqrt((table.col(j).array() - mean).square().sum() / 3.0 / 4.0);
    EXPECT_NEAR(e.trial_mean[j], mean, 1e-12 * std::abs(mean));
    EXPECT_NEAR(e.trial_error[j], error, 1e-12 * error + 1e-15);
    // Standard errors of four trials are uncertain: Student's t with 3 degrees, 1e-4: 18.
    EXPECT_NEAR(e.trial_mean[j], truth.natural()[j], 18.0 * error) << j;
  }
  // The joint fit uses all trials: not one of them, but near their mean.
  EXPECT_NE(e.fit.k, matrix_of_row(table, 0, 8, 2));
  EXPECT_LT(relative(e.fit.k, truth.k), 0.05);
  // A trial's own result is what that trial alone gives.
  recording.trials = 1;
  const ImpedanceEstimate first = identify_impedance(make_record(truth, recording), {});
  EXPECT_LT(relative(matrix_of_row(table, 0, 8, 2), first.fit.k), 1e-9);
}

TEST(Identify, OfSegmentsTheFirstHalfIdentifies) {
  Recording recording;
  recording.segments = 5;
  recording.force_noise = 1.0;
  const Record record = make_record(participant(1), recording);
  ImpedanceOptions options;
  options.refit = Refit::kNo;
  const ImpedanceEstimate e = identify_impedance(record, options);
  ASSERT_EQ(e.train.size(), 3u);  // three of five
  ASSERT_EQ(e.held_out.size(), 2u);
  const Index begin = e.prepared->trials[0].begin();
  EXPECT_EQ(e.train[0].begin, 0);  // the rows without a window are gone
  EXPECT_EQ(e.train[2].end + begin, 6000);
  EXPECT_EQ(e.held_out[0].begin + begin, 6000);
  EXPECT_EQ(e.held_out[1].end, e.prepared->trials[0].rows());
  EXPECT_EQ(e.train_s, 0.0);
  EXPECT_FALSE(e.refitted);
  // By default the parameters are those of all segments, the VAF still that of the first half's
  // fit.
  const ImpedanceEstimate all = identify_impedance(record, {});
  EXPECT_TRUE(all.refitted);
  EXPECT_NE(all.fit.k, e.fit.k);
  // Positions are centred on other rows, so only to rounding.
  EXPECT_LT((all.fit.vaf - e.fit.vaf).norm(), 1e-9);
}

TEST(Identify, TheSplitIsByTimeOtherwise) {
  Recording recording;
  recording.duration_s = 50.0;
  const ImpedanceEstimate e = identify(participant(1), recording);
  EXPECT_EQ(e.train_s, 40.0);
  EXPECT_EQ(e.train[0].end + e.prepared->trials[0].begin(), 10000);
  EXPECT_EQ(e.train_rows + e.held_out_rows, e.prepared->trials[0].rows());
  recording.duration_s = 20.0;
  EXPECT_EQ(identify(participant(1), recording).train_s, 16.0);  // at most 80 %
  ImpedanceOptions options;
  options.train_s = 7.0;
  EXPECT_EQ(identify(participant(1), recording, options).train_s, 7.0);
  options.train_s = 100.0;  // nothing held out: said, not refused
  const ImpedanceEstimate none = identify(participant(1), recording, options);
  EXPECT_EQ(none.held_out_rows, 0);
  EXPECT_TRUE(std::isnan(none.fit.vaf[0]));
  EXPECT_NEAR(none.fit.vaf_train[0], 100.0, 1e-6);
  EXPECT_FALSE(none.warnings.empty());
}

// The one sentence with which an identification is refused.
std::string refusal(const Record& record, Fault fault, const ImpedanceOptions& options = {}) {
  try {
    identify_impedance(record, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), fault) << error.what();
    return error.what();
  }
  return {};
}

void expect_words(const std::string& text, const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    EXPECT_NE(text.find(word), std::string::npos) << '"' << word << "\" in: " << text;
  }
}

TEST(Identify, ASingleSinusoidIsNamed) {
  Recording recording;
  recording.reference = false;
  recording.motion = [](Index, double t) {
    const double w = 2.0 * kPi * 1.1;
    return Vector{
        {0.01 * std::sin(w * t), 0.01 * w * std::cos(w * t), -0.01 * w * w * std::sin(w * t)}};
  };
  const Truth truth{Matrix::Constant(1, 1, 1.0), Matrix::Constant(1, 1, 5.0),
                    Matrix::Constant(1, 1, 80.0), Vector::Zero(1)};
  // A sine's acceleration is minus its position: M and K cannot be told apart.
  expect_words(
      refusal(make_record(truth, recording), Fault::kAnalysis),
      {"acceleration of x", "position of x", "condition number", "more than one frequency"});
}

TEST(Identify, MotionAlongOneDirectionIsNamed) {
  Recording recording;
  recording.reference = false;
  recording.motion = [](Index axis, double t) {
    Vector s = Vector::Zero(3);
    for (int line = 1; line <= 8; ++line) {
      const double w = 2.0 * kPi * 0.33 * line;
      const double angle = w * t + line * line;
      s += Vector{{std::cos(angle), -w * std::sin(angle), -w * w * std::cos(angle)}};
    }
    return Vector((axis == 0 ? 0.004 : 0.002) * s);  // y = x / 2
  };
  const std::string text = refusal(make_record(participant(1), recording), Fault::kAnalysis);
  expect_words(text, {"condition number", "perturb in every direction", " x", " y"});
}

TEST(Identify, AReferenceThatDoesNotMoveIsNamed) {
  const Record moving = make_record(participant(1), {});
  Record::Parts parts = moving.parts();
  parts.values.col(4).setConstant(0.1);  // x_ref
  const std::string text = refusal(Record::make(parts), Fault::kData);
  expect_words(text, {"x_ref", "constant"});
}

// Instruments of deficient rank must not pass for good ones.
TEST(Identify, AReferenceOfOneDirectionIsNamed) {
  Record::Parts parts = make_record(participant(1), {}).parts();
  parts.values.col(5) = 2.0 * parts.values.col(4);
  expect_words(refusal(Record::make(parts), Fault::kAnalysis), {"reference as instrument"});
  ImpedanceOptions options;  // least squares alone is still possible, and said to stand alone
  options.estimator = EstimatorChoice::kLeastSquares;
  const ImpedanceEstimate e = identify_impedance(Record::make(parts), options);
  EXPECT_EQ(e.alternative, nullptr);
  expect_truth(e.fit, participant(1), 1e-6);
}

TEST(Identify, OptionsAreChecked) {
  const Record record = make_record(participant(1), {});
  const auto refused = [&](auto change) {
    ImpedanceOptions options;
    change(options);
    return refusal(record, Fault::kArgument, options);
  };
  expect_words(refused([](auto& o) { o.payload_kg = -1.0; }), {"payload"});
  expect_words(refused([](auto& o) { o.payload_kg = std::nan(""); }), {"payload"});
  expect_words(refused([](auto& o) { o.train_s = -1.0; }), {"identify"});
  expect_words(refused([](auto& o) { o.hac_lag_s = 0.0; }), {"lag"});
  expect_words(refused([](auto& o) { o.draws = 3; }), {"draws"});
  expect_words(refused([](auto& o) {
                 o.errors = ErrorModel::kBlockBootstrap;
                 o.bootstrap = 3;
               }),
               {"resamples"});
  Recording blind;
  blind.reference = false;
  ImpedanceOptions options;
  options.estimator = EstimatorChoice::kInstrumental;
  expect_words(refusal(make_record(participant(1), blind), Fault::kArgument, options),
               {"reference"});
}

TEST(Identify, TheLagCheckSeesFiveMilliseconds) {
  Recording recording;
  recording.rate_hz = 1000.0;
  recording.force_noise = 0.05;
  const ImpedanceEstimate straight = identify(participant(1), recording);
  ASSERT_TRUE(straight.lag.available);
  EXPECT_LT(std::abs(straight.lag.lag_s), 1e-3);
  EXPECT_EQ(straight.fit.outcome & kForceLag, 0u);
  for (const double lag : {0.005, -0.005}) {
    recording.force_delay_s = lag;
    const ImpedanceEstimate late = identify(participant(1), recording);
    ASSERT_TRUE(late.lag.available);
    EXPECT_NEAR(late.lag.lag_s, lag, 1e-3);  // first order in the lag: 20 % of it
    EXPECT_NE(late.fit.outcome & kForceLag, 0u);
    const auto says = [&](const std::string& text) {
      return text.find(lag > 0.0 ? "later" : "earlier") != std::string::npos;
    };
    EXPECT_TRUE(std::any_of(late.warnings.begin(), late.warnings.end(), says));
  }
}

TEST(Identify, ThreadsDoNotChangeABit) {
  Recording recording;
  recording.trials = 3;
  recording.force_noise = 1.0;
  const Record record = make_record(participant(1), recording);
  for (const ErrorModel errors : {ErrorModel::kNeweyWest, ErrorModel::kBlockBootstrap}) {
    ImpedanceOptions options;
    options.errors = errors;
    options.bootstrap = 60;
    options.threads = 1;
    const ImpedanceEstimate one = identify_impedance(record, options);
    options.threads = 4;
    const ImpedanceEstimate four = identify_impedance(record, options);
    EXPECT_EQ(one.fit.theta, four.fit.theta);
    EXPECT_EQ(one.fit.covariance, four.fit.covariance);
    EXPECT_EQ(one.fit.vaf_interval, four.fit.vaf_interval);
    EXPECT_EQ(parameter_draws(one.fit), parameter_draws(four.fit));
  }
}

TEST(Identify, ErrorsOfBothKindsAreOfTheSameSize) {
  Recording recording;
  recording.force_noise = 1.0;
  recording.duration_s = 60.0;
  const Record record = make_record(participant(1), recording);
  ImpedanceOptions options;
  const Vector newey_west =
      identify_impedance(record, options).fit.covariance.diagonal().cwiseSqrt();
  options.errors = ErrorModel::kBlockBootstrap;
  const ImpedanceEstimate e = identify_impedance(record, options);
  const Vector bootstrap = e.fit.covariance.diagonal().cwiseSqrt();
  // Twenty blocks, a few hundred degrees of freedom of the Newey-West sum: both within a factor
  // of 2.
  EXPECT_LT((bootstrap.cwiseQuotient(newey_west)).maxCoeff(), 2.0);
  EXPECT_GT((bootstrap.cwiseQuotient(newey_west)).minCoeff(), 0.5);
  EXPECT_EQ(e.fit.replicates.rows(), 1000);
}

TEST(ParameterDraws, HaveTheCovarianceOfTheEstimate) {
  Recording recording;
  recording.force_noise = 1.0;
  ImpedanceOptions options;
  options.draws = 20000;
  const ImpedanceEstimate e = identify(participant(1), recording, options);
  const Matrix draws = parameter_draws(e.fit);
  ASSERT_EQ(draws.rows(), 20000);
  const Eigen::RowVectorXd mean = draws.colwise().mean();
  const Matrix centred = draws.rowwise() - mean;
  const Matrix covariance = centred.transpose() * centred / 19999.0;
  for (Index j = 0; j < 14; ++j) {
    // Standard deviations of 20000 draws: 0.5 %, five of them; x0 is a quotient, so only nearly.
    EXPECT_NEAR(std::sqrt(covariance(j, j) / e.fit.covariance(j, j)), 1.0, j < 12 ? 0.025 : 0.05)
        << j;
  }
}

// x0 = x_mean - K^-1 c; a K of rank one has no x0, and everything else still stands.
TEST(Identify, ASingularStiffnessHasNoEquilibrium) {
  Truth truth = participant(1);
  truth.k.setZero();
  truth.x0.setZero();
  ImpedanceOptions options;
  options.structure.model = Model::kFree;
  const ImpedanceEstimate e = identify(truth, {}, options);
  EXPECT_LT(relative(e.fit.m, truth.m), 1e-6);
  EXPECT_LT(e.fit.k.norm(), 1e-4);
}

}  // namespace
}  // namespace ulna
