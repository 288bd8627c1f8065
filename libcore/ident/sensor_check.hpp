// Do accelerometer and encoder see the same motion? The accelerometer is integrated twice and
// compared with the position, the slow drift of both removed by one and the same linear operator.
#pragma once

#include <string>
#include <vector>

#include "base/token.hpp"
#include "ident/prepare.hpp"
#include "record/record.hpp"

namespace ulna {

struct SensorCheckOptions {
  std::string position;      // word; "": channels that are positions
  std::string acceleration;  // word, as many channels as positions
  double highpass_hz = 0.0;  // drift is removed below; 0: half the slowest frequency of the motion
                             // that matters, 0.2 to 1 Hz
  double max_lag_s = 0.25;   // looked for in either direction
  PrepareOptions prepare;    // of both; the low pass of the comparison
  int threads = 0;
};

// What differs, in the order of how much it matters. kWarning: correct it before use.
enum class Disagreement { kNone, kUnrelated, kAxes, kSign, kUnit, kTurned, kScale, kLag };

// Twice integrated accelerometer p_i(t) against sum over j of gain(i, j) x_j(t - lag_i).
struct SensorCheck {
  std::vector<std::string> accelerations, positions;
  Matrix gain;                 // n x n; the identity when both agree
  Matrix gain_error;           // standard errors, by leaving out blocks
  Vector lag_s;                // accelerometer later than the encoder; of every accelerometer axis
  Vector lag_error_s;          // standard errors
  Matrix correlation;          // n x n, accelerometer axis with encoder axis at its lag
  Vector agreement;            // percent of the variance of p that x accounts for as recorded
  Vector corrected;            // percent, with gain and lag
  Vector offset;               // mean of the accelerometer: bias, or gravity through a tilt, m/s^2
  Vector scale;                // gain towards the axis that it follows best, sign included
  std::vector<Index> follows;  // that axis
  double turned_rad = 0.0;     // of the accelerometer's axes in the plane (n = 2); else 0
  double turned_error_rad = 0.0;
  double highpass_hz = 0.0;
  double lowpass_hz = 0.0;
  Disagreement worst = Disagreement::kNone;
  std::vector<Finding> findings;  // one sentence each: what disagrees, by how much, what to do
  // Traces of the comparison for a figure: first trial, every `stride`-th row.
  Matrix trace;  // time, then p (n columns), then x (n columns), m
};

// Throws Error: kArgument when channels do not pair up or options do not fit, kData for units other
// than m and m/s^2 (an acceleration without a unit, or "1", is compared as it is), NaN, jitter, or
// a record shorter than eight periods of the high pass.
SensorCheck check_sensors(const Record& record, const SensorCheckOptions& options,
                          Token* token = nullptr);

}  // namespace ulna
