// A two-axis bending-beam force sensor: its calibration lines, and force channels from its volts.
// Dyck 2013, appendix E: lines (E.2), lever arm (E.3), turn from the sensor to the world (E.4).
#pragma once

#include <string>

#include "ident/force_errors.hpp"
#include "plant/spring_array.hpp"
#include "record/record.hpp"

namespace ulna {

// force = slope * volts + intercept.
struct CalibrationLine {
  double slope = 0.0;                    // N/V
  double intercept = 0.0;                // N
  Matrix2 covariance = Matrix2::Zero();  // of slope and intercept
  double r_squared = 0.0;                // weighted
  double residual_n = 0.0;               // standard deviation of a point of weight one, N
  double chi_square = 0.0;               // of the residuals in units of the errors given; else NaN
  double fit_p = 1.0;  // chance of a chi_square this large for a true line; NaN without errors
  double curvature_p = 1.0;  // chance of a quadratic part this large for a true line; NaN: 3 points
  double largest_residual = 0.0;  // internally studentised
  Index largest_row = 0;
  // Chance that the largest of all these residuals is so large for a true line, when the other
  // points give the scatter (the externally studentised residual, by Bonferroni); NaN: no scatter
  // left.
  double outlier_p = 1.0;
  Index points = 0;
};

// Weighted least squares of known forces (N) on volts. errors: standard deviation of every force
// (weights 1 / error^2), empty for equal ones. relative: the errors give weights only, the scatter
// of the points their scale. Throws Error: kArgument for lengths that differ or errors not above 0,
// kData for values that are not finite (with the row), kAnalysis for fewer than three points or
// volts that are all the same.
CalibrationLine calibrate_line(const Vector& volts, const Vector& forces, const Vector& errors,
                               bool relative);

struct StrainGauge {
  CalibrationLine x, y;
  double lever_m = 0.0688;     // L0 of the calibration
  double lever_error_m = 0.0;  // its standard error
};

// (E.2) as published, with the standard errors printed there.
StrainGauge published_gauge();

enum class GaugeZero {
  kCalibration,  // the intercepts of the lines
  kRest,         // mean volts of rows without force, as the thesis re-tunes before each experiment
};

struct GaugeOptions {
  std::string volts;           // word for two channels in V: x_s, then y_s
  std::string angle;           // channel in rad that the sensor turns with (theta_2); "": none
  double lever_m = 0.0;        // of this recording; 0: as calibrated
  double lever_error_m = 0.0;  // its standard error
  GaugeZero zero = GaugeZero::kCalibration;
  Index rest_begin = 0, rest_end = 0;  // rows of kRest
  int sign = 1;                        // -1: the volts rise with the force on the human
  std::string name = "F";              // channels F_x and F_y
};

struct GaugedForce {
  Record record;
  ForceErrors errors;  // "slope x", "zero x", "slope y", "zero y", "lever"
};

// The record with two force channels more, N, in the world frame where an angle is given, else in
// the sensor's. Throws Error with channel and row: kData for channels that are not in V or rad, or
// without a number; kArgument for a rest outside the record, a lever that is not above zero, a name
// that is taken.
GaugedForce apply_gauge(const Record& record, const StrainGauge& gauge,
                        const GaugeOptions& options);

}  // namespace ulna
