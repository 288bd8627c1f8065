// Continuous-time transfer functions from sampled data: the simplified refined instrumental
// variable method (SRIVC; Young and Jakeman 1980, Garnier and Young 2014), and the output-error
// method on the same parameters (Levenberg-Marquardt) as the prediction-error baseline.
//
// Both end where the sensitivities are orthogonal to the output error. With white output noise that
// is the maximum of the likelihood, so the covariance meets the Cramer-Rao bound; with coloured
// noise that is independent of the input the estimate stays consistent, and the covariance takes
// the correlation of the residuals into account. Data from a closed loop make it biased: the noise
// reaches the input.
#pragma once

#include <string>
#include <vector>

#include "base/token.hpp"
#include "ident/rational_problem.hpp"
#include "ident/residual_noise.hpp"

namespace ulna {

enum class FitMethod { kInstrumental, kOutputError };

enum class FitOutcome {
  kGood,
  kNotConverged,    // the iterations ended before the estimate stood still
  kUnstable,        // the data ask for a pole in the right half plane; the model is the best stable
  kIllConditioned,  // the data do not determine all coefficients
  kUnexplained,     // the model explains no more than chance
};

struct RationalOptions {
  RationalSetup setup;
  FitMethod method = FitMethod::kInstrumental;
  Vector lower, upper;  // of a_0 ... a_(n-1), b_0 ... by input; empty: none; equal: fixed
  std::vector<double> cutoffs_hz;  // of the state-variable filters that start it; empty: a grid
  int max_iterations = 60;
  double tolerance = 1e-3;  // of a step, in standard errors
  bool white = false;       // take the residuals as white for the covariance
  bool refit = true;        // after validation, estimate from all rows
};

struct RationalFit {
  Rational model;
  RationalSetup setup;
  double rate_hz = 0.0;
  FitMethod method = FitMethod::kInstrumental;
  Vector theta;            // a_0 ... a_(n-1), then b_0 ... b_m of each input
  Matrix covariance;       // of theta; zero rows for what is fixed or at a bound
  std::vector<int> state;  // of each coefficient: 0 free, 1 fixed, 2 at its bound
  Matrix nuisance;         // runs x (n + 1): free response and its derivatives at its first row
                           // (unit / s^i), offset
  FitOutcome outcome = FitOutcome::kGood;
  std::vector<std::string>
      notes;  // one sentence each; the first explains an outcome that is not good
  int iterations = 0;
  double condition = 0.0;   // of the sensitivities in unit columns
  Index rows = 0;           // in the sums of the estimate
  Index held_out_rows = 0;  // that validated
  bool refitted = false;
  double sse = 0.0;             // sum of squared output errors
  double noise_variance = 0.0;  // sse over degrees of freedom
  ResidualNoise noise;          // correlation of the residuals
  double vaf = 0.0;             // percent, of the rows in the sums
  double vaf_held_out = 0.0;    // percent; NaN without held-out rows
  double aic = 0.0, aicc = 0.0, bic = 0.0, yic = 0.0;
  Vector simulated;         // one a row of the record; NaN outside of the runs
  Vector output_error;      // output less simulated
  Vector validation_error;  // of the model before the refit, on held-out rows; NaN elsewhere
};

// "a0", "b2", or "b2[1]" for the second of several inputs.
std::string coefficient_name(const RationalOrders& orders, Index coefficient);

RationalFit identify_rational(MatrixRef inputs, VectorRef output, double rate_hz,
                              const std::vector<RowRange>& ranges, const RationalOptions& options,
                              Token* token = nullptr);

}  // namespace ulna
