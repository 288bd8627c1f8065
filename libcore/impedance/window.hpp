// Impedance in a short window after each perturbation's onset, before the nervous system can have
// reacted, against impedance in what follows.
//
//     -F = M x'' + B_e x' + K_e x  in the window,   -F = M x'' + B_l x' + K_l x  after it
//
// All signals count from their means over a rest before the onset, so that no constant is left.
// The whole record is filtered before anything is cut, and rows near the border, where the filter
// mixes both sides, are left out. Each perturbation is one independent piece of evidence:
// covariances leave one out at a time (jackknife).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "ident/consistency.hpp"
#include "ident/linear.hpp"
#include "impedance/estimate.hpp"
#include "impedance/onsets.hpp"

namespace ulna {

enum WindowOutcome : std::uint32_t {
  kWindowGood = 0,
  kWindowSmeared = 1u << 0,  // the low pass reaches across the border of the windows
  kWindowIllConditioned = 1u << 1,
  kWindowUntested = 1u << 2,  // too few perturbations for a test
};

struct WindowOptions {
  PrepareOptions prepare;  // lowpass_hz 0: 5 / window_s, so that the window is five periods long
  std::string position, force, reference;
  EstimatorChoice estimator = EstimatorChoice::kAuto;
  double window_s = 0.1;
  double after_s = 1.0;          // a perturbation is used so long, at most to the next
  double baseline_s = 0.1;       // the rest before the onset
  bool free_inertia = false;     // M of its own in either window
  std::vector<double> onsets_s;  // empty: found
  double condition_limit = 1000.0;
  Index draws = 1999;
  double level = 0.05;
  std::uint64_t seed = 0;
  int threads = 0;
};

struct WindowFit {
  Matrix m, b, k;     // n x n
  Matrix covariance;  // of M, B, K row by row
  Vector vaf;         // percent, per axis, on the window's own rows
  Index rows = 0;
};

struct WindowComparison {
  Index n = 0;
  std::vector<std::string> axes;
  bool rotational = false;
  Estimator estimator = Estimator::kLeastSquares;
  WindowFit early, late;
  Matrix difference_covariance;  // of late - early, M, B, K row by row
  double guard_s = 0.0;          // left out on either side of the border
  double degrees = 0.0;          // of Student's t for intervals: perturbations - 1
  double p_value = 1.0;          // that both windows have the same B and K (and M where it is free)
  double condition = 0.0;
  std::vector<Onset> onsets;  // used
  std::vector<double> onset_time_s;
  std::uint32_t outcome = kWindowGood;
  PrepareReport report;
  DerivativeConsistency consistency;
  std::vector<std::string> warnings, notes, provenance;
};

// Throws Error: as prepare and find_onsets; kData for fewer than 3 usable perturbations; kAnalysis
// when a window does not determine its parameters.
WindowComparison compare_windows(const Record& record, const WindowOptions& options,
                                 Token* token = nullptr);

}  // namespace ulna
