// From a record to the endpoint or joint impedance
//     M x'' + B x' + K (x - x0) = -F_h,   F_h: force by the human on the robot    (3.2, Dyck 2013)
// with covariance, held-out validation, the closed-loop check and warnings in words.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "ident/closed_loop.hpp"
#include "ident/linear.hpp"
#include "ident/prepare.hpp"
#include "impedance/structure.hpp"
#include "record/record.hpp"

namespace ulna {

enum class EstimatorChoice { kAuto, kLeastSquares, kInstrumental };
enum class ErrorModel { kNeweyWest, kBlockBootstrap };
enum class Refit { kAuto, kYes, kNo };

// Reasons to look before use; a value of zero is a good estimate.
enum Outcome : std::uint32_t {
  kGood = 0,
  kClosedLoopBiased = 1u << 0,  // least squares differs from instrumental variables
  kPoorFit = 1u << 1,           // VAF of an axis below the limit, and not for the human's own force
  kIllConditioned = 1u << 2,
  kForceLag = 1u << 3,      // force and motion are not simultaneous
  kNotConverged = 1u << 4,  // of the constrained fit
  kNotFinite = 1u << 5,     // x0: K is singular
  kUnchecked = 1u << 6,     // no reference: causality of the motion could not be checked
  kSuspectData = 1u << 7,   // the look at the record found something to check first
};

// Condition number of the regressors above which an estimate is marked; an error comes later.
inline constexpr double kIllCondition = 200.0;

struct ImpedanceOptions {
  PrepareOptions prepare;
  std::string position, force, reference;  // words for Record::resolve; empty: by role
  Structure structure;
  EstimatorChoice estimator = EstimatorChoice::kAuto;
  ErrorModel errors = ErrorModel::kNeweyWest;
  Refit refit = Refit::kAuto;  // report parameters of all data; auto: when trials hold segments
  double payload_kg = 0.0;
  double train_s =
      0.0;  // 0: first 40 s, at most 80 % of a trial, or the first half of its segments
  double hac_lag_s = 0.4;  // of the Newey-West errors
  double block_s = 2.0;    // of the bootstrap, when the record has no segments
  Index bootstrap = 1000;  // resamples, for kBlockBootstrap
  Index draws = 4000;      // for intervals of derived quantities
  std::uint64_t seed = 0;
  double condition_limit = 1000.0;  // above: an error that names the direction
  double poor_vaf = 80.0;           // percent
  int threads = 0;
};

// One estimator's answer. "Natural" parameters: M, B, K row by row, then x0: 3 n^2 + n values.
struct ImpedanceFit {
  Estimator estimator = Estimator::kLeastSquares;
  Matrix m, b, k;     // n x n
  Vector x0;          // n; NaN when K is singular
  Matrix covariance;  // of the natural parameters
  Vector vaf;         // percent, per axis, on held-out rows; NaN when there are none
  Vector vaf_train;
  Vector
      vaf_reference;  // percent, of the force that the perturbation caused; NaN without a reference
  Matrix vaf_interval;  // 2 x n, 95 %, block bootstrap of the held-out rows
  double condition = 0.0;
  std::uint32_t outcome = kGood;
  bool constrained = false;  // a positive-semidefinite constraint is active
  Matrix theta;              // (3 n + 1) x n, with positions centred on position_mean
  Vector position_mean;
  // What parameter_draws needs: bootstrap replicates, or the covariance of vec(theta).
  Matrix replicates;
  Matrix theta_covariance;
  Index draw_count = 0;
  std::uint64_t seed = 0;
};

// draws x natural parameters: the bootstrap replicates, or Gaussian draws from the covariance.
Matrix parameter_draws(const ImpedanceFit& fit);

struct TrialFit {
  Vector natural;
  double condition = 0.0;
};

struct ImpedanceEstimate {
  Index n = 0;
  std::vector<std::string> axes;
  bool rotational = false;
  ImpedanceFit fit;                           // what is reported
  std::unique_ptr<ImpedanceFit> alternative;  // least squares beside instrumental variables
  std::vector<TrialFit> trials;               // when the record has several
  Vector trial_mean, trial_error;             // natural parameters: mean and its standard error
  MotionShare motion;
  DifferenceTest test;
  LagCheck lag;
  PrepareReport report;
  Structure structure;
  double payload_kg = 0.0;
  double train_s = 0.0;
  Index train_rows = 0;
  Index held_out_rows = 0;
  bool refitted = false;
  std::vector<std::string> warnings;  // one sentence each
  std::vector<std::string> notes;
  std::vector<std::string> provenance;
  std::vector<Span> train, held_out;
  std::shared_ptr<const Prepared> prepared;
  std::shared_ptr<const Record> record;
};

// `findings` (of record/look.hpp): those above a note that concern the clock or a channel in use
// become warnings. Throws Error: kData or kArgument as prepare; kAnalysis when the data do not
// determine the parameters, with the direction in words.
ImpedanceEstimate identify_impedance(const Record& record, const ImpedanceOptions& options,
                                     Token* token = nullptr,
                                     const std::vector<Finding>& findings = {});

// -F predicted from prepared rows, rows x n, with the payload's share added back; sign of F.
Matrix predict_force(const ImpedanceEstimate& estimate, const ImpedanceFit& fit, int trial);

}  // namespace ulna
