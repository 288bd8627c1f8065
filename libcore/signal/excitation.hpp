// Perturbations for an experiment: what a robot is told to do, with exact derivatives, and which
// rows of the recording are the perturbation. Section 3.4.1 and 4.1 of Dyck 2013.
#pragma once

#include <string>
#include <vector>

#include "base/types.hpp"
#include "signal/second_order.hpp"
#include "signal/spectrum.hpp"

namespace ulna {

enum class Drive {
  kPosition,  // the reference of a position controller, m or rad
  kForce,     // the force that the robot exerts on the human, N or N m
};

// amplitude cos(2 pi freq_hz t + phase_rad), t from row 0.
struct Line {
  Index axis = 0;
  double freq_hz = 0.0;
  double amplitude = 0.0;
  double phase_rad = 0.0;
};

// One step: from its onset the filter's input is `size` along `direction` for hold_s.
struct StepEvent {
  double onset_s = 0.0;
  double hold_s = 0.0;
  Index direction = 0;  // row of the directions
  Vector size;          // one value an axis
};

struct Excitation {
  Drive drive = Drive::kPosition;
  double rate_hz = 0.0;
  Matrix value;                    // rows x axes, SI; row i at i / rate_hz
  Matrix rate;                     // per s
  Matrix acceleration;             // per s^2
  std::vector<RowRange> segments;  // rows of the perturbation, or of each
  std::vector<Line> lines;         // of a multisine
  std::vector<StepEvent> events;   // of steps
  double period_s = 0.0;           // of a multisine; 0: not periodic
  std::vector<std::string> notes;  // what to know before using it, a sentence each
  std::string provenance;          // how to make it again, one line

  Index rows() const noexcept { return value.rows(); }
  Index axes() const noexcept { return value.cols(); }
  double duration_s() const noexcept { return static_cast<double>(rows()) / rate_hz; }
};

// Per axis over the rows of the segments: largest magnitude, root mean square, and their ratio
// (NaN for an axis that does not move).
struct Extent {
  Vector peak, rms, crest;
};

Extent extent_of(const Excitation& excitation);

// The same perturbation `factor` times as large; finite, not 0.
Excitation scaled(const Excitation& excitation, double factor);

// A signal of one's own. segments empty: all rows. rate and acceleration: its derivatives in the
// same shape; empty: by central differences. Throws Error (kData) for a value that is not finite,
// kArgument for fewer than 3 rows, another shape, and segments that overlap or reach outside.
Excitation excitation_of(Drive drive, double rate_hz, MatrixRef value,
                         std::vector<RowRange> segments, const Matrix& rate = {},
                         const Matrix& acceleration = {});

// From a state to rest at 0 in `duration_s` by the polynomial of fifth order that meets value, rate
// and acceleration at both ends (minimum jerk); t_s in [0, duration_s].
SignalPoint gently_back(const SignalPoint& from, double duration_s, double t_s);

// 0 to 1 over [0, 1] with zero first and second derivative at both ends; derivatives are by t.
SignalPoint smooth_rise(double t);

// What every design checks alike. axes from 1 to 6; rows of a duration at a rate.
void check_rate(double rate_hz);
void check_axes(Index axes);
Index rows_of(double duration_s, double rate_hz, const char* argument);

}  // namespace ulna
