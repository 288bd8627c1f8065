// Stiffness and damping of a joint from a passive mobilisation by an exoskeleton: (9), (20) and
// (21) of Tesfazgi 2023.
//
//     tau_hum = M(theta) theta'' + C theta' + g + losses - tau_motor nominal
//     model tau_hum = offset - K theta - D theta' + misfit regression, each
//     joint
//
// Sign: K = -d tau_hum / d theta, D = -d tau_hum / d theta', so that what resists is positive and
// an anti-spring has K < 0. The publication has the other sign (its K is the slope of the torque).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "impedance/estimate.hpp"
#include "plant/nominal_model.hpp"
#include "record/record.hpp"

namespace ulna {

struct ViscoelasticOptions {
  std::vector<std::string> joints = {};  // of the device; empty: whose theta_ has the role position
  NominalTerms terms = {};
  bool human_angle = false;  // regress on the true q instead of theta; a simulated record only
  bool intercept = true;     // the angle of rest is not known
  bool damping = true;       // rate as a regressor; false: no D
  ErrorModel errors = ErrorModel::kNeweyWest;  // with the misfit counted; and its settings
  double hac_lag_s = 0.4;
  double block_s = 0.4;
  Index bootstrap = 1000;
  double level = 0.95;
  std::uint64_t seed = 0;
  double condition_limit = 1000.0;

  // The estimator of the published simulation: true human angle with intercept, no rate, no
  // inertia, damping or friction in the nominal torque.
  static ViscoelasticOptions published();
};

// Line through a torque over the same rows: the muscles' true one on the true human angle.
struct TrueViscoelasticity {
  bool known = false;
  double k = kNaN;        // same regressors as the estimate, N m/rad
  double d = kNaN;        // N m s/rad
  double k_alone = kNaN;  // slope on the angle with intercept only: the published ground truth
};

struct Viscoelasticity {
  std::string joint;
  double k = kNaN, d = kNaN;  // N m/rad, N m s/rad; D is NaN without rate regressor
  double offset = kNaN;       // N m; NaN without intercept
  // What a straight line leaves of the muscles' curves and of a soft interface repeats itself when
  // the movement is repeated: these standard errors are those of the noise of the measurement.
  double k_error = kNaN, d_error = kNaN;
  double k_interval[2] = {kNaN, kNaN};
  double d_interval[2] = {kNaN, kNaN};
  // With all counted that the line leaves: slope of a population of such movements. Errors of the
  // measurement that are as slow as the movement are in these alone.
  double k_misfit_error = kNaN, d_misfit_error = kNaN;
  double k_misfit_interval[2] = {kNaN, kNaN};
  double d_misfit_interval[2] = {kNaN, kNaN};
  double level = 0.95;
  double r_squared = kNaN;
  double residual_rms = kNaN;  // of the regression, N m
  double noise_rms = kNaN;     // of it, what is no function of angle and rate, N m
  double condition = kNaN;     // of the regressors in unit columns
  Index rows = 0;
  TrueViscoelasticity truth;
  // Nominal less true torque of the muscles, N m: (16). NaN where the truth is not known.
  double model_residual_rms = kNaN;
  double model_residual_max = kNaN;
  std::vector<std::string> warnings;
};

// Nominal torque of the muscles at every row, rows x device joints, from theta_, theta_dot_,
// theta_ddot_ and tau_motor_ of a record. Rates and accelerations that the record does not hold are
// derivatives of the angle (Savitzky-Golay), and the torque is smoothed alike. Throws Error: kData
// for what is not finite, kArgument for channels that are not there.
Matrix nominal_human_torque(const Record& record, const NominalModel& nominal,
                            const NominalTerms& terms = {});

// Throws Error: kArgument for joints and channels that are not there, kData for numbers that are
// not finite or too few rows, kAnalysis for a movement that does not determine the parameters.
std::vector<Viscoelasticity> identify_viscoelasticity(const Record& record,
                                                      const NominalModel& nominal,
                                                      const ViscoelasticOptions& options = {},
                                                      Token* token = nullptr);

}  // namespace ulna
