// What an experiment will tell: standard errors of M, B, K and x0, and the bias of least squares,
// before anything is recorded.
//
// The noise-free recording is simulated exactly and goes through the preparation, the split and the
// estimator of identify_impedance; what tremor, encoder and force sensor add has a known spectrum,
// so the covariance of the estimate follows from it by one sum over frequencies:
//     cov(vec theta) = bread [ integral of Z_w(f)^H Z_w(f) (x) S_e(f) df ] bread,
// Z_w the transform of the weighted instruments over the rows in use and S_e the spectrum of the
// filtered residual, |H|^2 [S_d I + S_F I + S_x Z_h Z_h^H]. To first order in the noise.
#pragma once

#include <string>
#include <vector>

#include "impedance/arm_loop.hpp"
#include "impedance/estimate.hpp"

namespace ulna {

struct SensorNoise {
  double force = 0.0;     // standard deviation of white noise on a sample, N or N m
  double position = 0.0;  // m or rad; an encoder's step over sqrt(12)
};

struct PlanOptions {
  PrepareOptions prepare;
  Structure structure;  // the passive model is planned as the symmetric one
  EstimatorChoice estimator = EstimatorChoice::kAuto;  // automatic: instrumental variables
  Refit refit = Refit::kAuto;
  double train_s = 0.0;
  double condition_limit = 1000.0;
  double repetitions = 1.0;  // of the whole design; fractions stand for a share of the time
};

// Natural parameters: M, B and K row by row, then x0 (from where the robot starts).
struct Plan {
  Index n = 0;
  Vector truth;       // the prior
  Matrix covariance;  // predicted, of all repetitions
  Vector bias;        // predicted, of the estimator in use: 0 to first order for instruments
  Estimator estimator = Estimator::kInstrumental;
  Vector least_squares_bias;   // what least squares would tend to, less the truth
  Vector least_squares_error;  // its standard errors
  Vector rho;  // axes: share of the motion's power that the reference does not cause
  double condition = 0.0;
  double weakness = 0.0;  // noise in the instruments' hold on the motion, relative to it
  double seconds = 0.0;   // all repetitions, pauses of the design included
  double used_s = 0.0;    // of it in the fit
  double repetitions = 1.0;
  PrepareReport report;
  std::vector<std::string> warnings;

  Vector standard_error() const;
};

// Throws Error as ArmLoop and the preparation; kAnalysis when the design does not determine the
// parameters, with the direction in words.
Plan plan_experiment(const Excitation& excitation, const ArmModel& arm, const RobotModel& robot,
                     const Tremor& tremor, const SensorNoise& noise, const PlanOptions& options,
                     Token* token = nullptr);

// Seconds until the standard error of a natural parameter is `error` (in its unit): errors fall
// with the square root of time. Throws Error (kArgument).
double seconds_for(const Plan& plan, Index parameter, double error);

}  // namespace ulna
