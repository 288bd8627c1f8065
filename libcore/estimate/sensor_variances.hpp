// Variances of sensors from a recording, by maximum likelihood: those for which every row's
// innovations are as large as they are expected to be. Each step sets, for a group of rows,
//
//     variance = sum of innovations^2 / sum of (1 - share of the row that the estimate takes over)
//
// (MacKay's form of expectation-maximisation for variance components, with the same fixed point);
// where it would lower the likelihood, the step of expectation-maximisation itself is taken, which
// cannot. Latella et al. 2021 tune by hand to a relative error of 3 %, their (17): see
// relative_errors().
#pragma once

#include "estimate/body_recording.hpp"

namespace ulna {

struct VarianceOptions {
  // Group of each row of y; rows of one group share a variance, -1 leaves a row as it is. Empty: a
  // group for each sensor, forces and moments of a wrench apart. Rows of one group cannot take the
  // blame for one another, which keeps the likelihood from making one of them exact.
  std::vector<Index> groups = {};
  Index steps = 60;
  // Stops when no deviation changes by more than this part, or by more than a twentieth of its own
  // standard error.
  double tolerance = 1e-3;
  Index frames = 2000;  // at most, evenly over the recording
  // No row is believed to be better than this part of what it was said to be: likelihood alone can
  // explain what two rows disagree on by one of them and make the other exact.
  double least = 0.03;
  int threads = 0;
};

struct SensorVariances {
  Vector deviation;  // of each row of y
  // Of each row: independent pieces of information about its variance, so that the deviation has a
  // relative standard error of 1/sqrt(2 freedom) for noise without memory. Near 0: nothing else
  // measures what this row measures, and its deviation stays as it was.
  Vector freedom;
  std::vector<double> log_likelihood;  // before each step, and at the end
  bool converged = false;
};

// Throws Error: kArgument for groups of another size and options that are not positive; as
// estimate_recording.
SensorVariances sensor_variances(const SensorSuite& suite, const BodyRecording& recording,
                                 const VarianceOptions& options = {}, Token* token = nullptr);

// The groups that an empty list stands for.
std::vector<Index> variance_groups(const SensorSuite& suite);

// Per sensor: norm of measured - estimated over norm of measured, over all frames ((17) as
// published; NaN for sensors without rows).
Vector relative_errors(const SensorSuite& suite, const BodyRecording& recording,
                       const BodyTorques& torques);

}  // namespace ulna
