// An endpoint or joint impedance with a delayed feedback beside it:
//
//     M x'' + B x' + K (x - x0) + K_d (x(t - tau) - x0) + B_d x'(t - tau) = -F
//
// F: force by the human on the robot. tau is identified with the rest: at every delay the model is
// linear, so the linear parameters are projected away.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "ident/consistency.hpp"
#include "ident/linear.hpp"
#include "ident/prepare.hpp"
#include "impedance/estimate.hpp"
#include "record/record.hpp"

namespace ulna {

enum DelayedOutcome : std::uint32_t {
  kDelayedGood = 0,
  kDelayedNotSignificant = 1u << 0,
  kDelayedAtBound = 1u << 1,  // its interval reaches the end of the range
  kDelayedIllConditioned = 1u << 2,
  kDelayedPoorFit = 1u << 3,
  kDelayedSuspectData = 1u << 5,  // the inertia is negative
  kDelayedUntested = 1u << 4,
};

struct DelayedOptions {
  PrepareOptions prepare;
  std::string position, force, reference;
  EstimatorChoice estimator = EstimatorChoice::kAuto;
  double delay_min_s = 0.02;
  double delay_max_s = 0.25;
  double train_s = 0.0;
  Refit refit = Refit::kAuto;
  double hac_lag_s = 0.4;
  double block_s = 2.0;  // of the test
  Index draws = 1999;
  double level = 0.05;
  double condition_limit = 1000.0;
  double poor_vaf = 80.0;
  std::uint64_t seed = 0;
  int threads = 0;
};

struct DelayedEstimate {
  Index n = 0;
  std::vector<std::string> axes;
  bool rotational = false;
  Estimator estimator = Estimator::kLeastSquares;
  Matrix m, b, k, k_delayed, b_delayed;  // n x n
  Vector x0;                             // NaN when K + K_d is singular
  double delay_s = 0.0;
  double delay_interval[2] = {0.0, 0.0};  // 95 %, from the profile
  // M, B, K, K_d, B_d row by row, x0, delay: 5 n^2 + n + 1.
  Matrix covariance;
  Vector vaf, vaf_without;  // percent per axis, held out (NaN without), with and without feedback
  Vector profile_delay_s, profile_statistic;  // chi-square of one degree against the best delay
  double p_value = 1.0;                       // that there is no delayed feedback
  Index test_blocks = 0;
  double condition = 0.0;
  Index train_rows = 0, held_out_rows = 0;
  bool refitted = false;
  std::uint32_t outcome = kDelayedGood;
  PrepareReport report;
  DerivativeConsistency consistency;
  std::vector<std::string> warnings, notes, provenance;
};

// Throws Error: as prepare; kArgument for options out of range or more than two axes; kData when
// too little is left; kAnalysis when the motion does not tell the immediate from the delayed.
DelayedEstimate identify_delayed(const Record& record, const DelayedOptions& options,
                                 Token* token = nullptr);

}  // namespace ulna
