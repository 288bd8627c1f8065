// Intrinsic and reflex torque of one joint from a perturbation experiment, as a parallel cascade:
//
//     -F = M x'' + B x' + K x + c        intrinsic: acts at once (or an impulse response of x)
//          + G H(s) r(t - tau)           reflex: r the half-wave rectified velocity, H a low pass
//
// F: torque by the human on the robot; r = side max(side x' - threshold, 0), so that a positive G
// resists the motion whatever the side. The idea is that of Kearney, Stein and Parameswaran 1997;
// here both paths are fitted together, the linear parameters projected away at every delay and
// dynamics (variable projection) instead of path by path in turn. Each segment is a run of its own
// with its own offset, and a trial's unknown past is part of the fit: nothing is concatenated.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "ident/consistency.hpp"
#include "ident/prepare.hpp"
#include "impedance/estimate.hpp"
#include "impedance/split.hpp"
#include "record/record.hpp"

namespace ulna {

enum class Intrinsic { kSecondOrder, kImpulseResponse };

enum ReflexOutcome : std::uint32_t {
  kReflexGood = 0,
  kReflexNotSignificant = 1u << 0,  // delay and dynamics then mean nothing
  kReflexDelayAtBound = 1u << 1,    // the data prefer a delay outside the range
  kReflexDynamicsAtBound = 1u << 2,
  kReflexPoorFit = 1u << 3,
  kReflexNotConverged = 1u << 4,
  kReflexSuspectData = 1u << 6,  // the inertia is negative
  kReflexUntested = 1u << 5,     // too few blocks for a test
};

struct ReflexOptions {
  PrepareOptions prepare;
  std::string position, force;  // words as in find_roles; one axis
  Intrinsic intrinsic = Intrinsic::kSecondOrder;
  int side = 0;              // +1: rising position excites, -1: falling, 0: the better of both
  int order = 2;             // of the reflex dynamics, 1 or 2
  int position_powers = 1;   // static terms x^2 ... x^powers beside K x, up to 5
  int drift = 0;             // order of the polynomial offset of each run, up to 3
  double threshold = 0.0;    // rad/s, below which the velocity excites nothing
  double delay_min_s = 0.0;  // range of the delay
  double delay_max_s = 0.12;
  double intrinsic_irf_s = 0.04;  // the two-sided impulse response reaches so far to either side
  double reflex_irf_s = 0.4;      // length of the reflex impulse response; 0: none is made
  double train_s = 0.0;           // as in split_rows
  Refit refit = Refit::kAuto;     // auto: when trials hold several segments
  double hac_lag_s = 0.4;
  double block_s = 1.0;  // of the test and of the bootstrap of the VAF
  Index draws = 1999;    // sign flips of the test
  double level = 0.05;   // of the test
  double poor_vaf = 80.0;
  std::uint64_t seed = 0;
  int threads = 0;
};

// Parameters in this order in every vector and covariance; order 1 has no zeta (NaN).
enum ReflexParameter {
  kReflexM,
  kReflexB,
  kReflexK,
  kReflexGain,
  kReflexOmega,
  kReflexZeta,
  kReflexDelay,
  kReflexParameterCount
};

struct ReflexFit {
  Vector value;       // kReflexParameterCount
  Matrix covariance;  // of them
  Matrix
      interval;   // 2 x count, 95 %; of the delay from its profile, of omega and zeta by logarithms
  Vector powers;  // coefficients of (x - x_mean)^2 ..., torque
  Vector powers_error;
  double position_mean = 0.0;
  bool converged = false;
};

// Both paths as impulse responses, lag by lag: the same cascade without a choice of orders.
struct ReflexImpulse {
  Vector intrinsic_lag_s, intrinsic, intrinsic_error;  // N m/rad per lag step
  Vector reflex_lag_s, reflex, reflex_error;  // N m/rad: torque per rad of rectified motion
  double vaf = 0.0;                           // held out; NaN where nothing is
  double penalty = 0.0;  // on the reflex response's roughness, by cross-validation
  Index values = 0;      // of both responses and the static powers
  double rank = 0.0;     // how many of them the data determine
  bool available = false;
};

struct ReflexEstimate {
  std::string axis;
  bool rotational = true;
  int side = 1;
  ReflexFit fit;
  double p_value = 1.0;  // that there is no rectified path of any delay in the range
  Index test_blocks = 0;
  // Percent, on held-out rows, NaN where nothing is held out: both paths, each alone, and the best
  // fit without a reflex path.
  double vaf = 0.0, vaf_intrinsic = 0.0, vaf_reflex = 0.0, vaf_without = 0.0;
  double vaf_interval[2] = {0.0, 0.0}, gain_interval[2] = {0.0, 0.0};  // gain: vaf - vaf_without
  double vaf_train = 0.0, vaf_train_without = 0.0;
  double vaf_train_other = 0.0;  // of the other side; NaN when the side was given
  Vector profile_delay_s;        // delays over the range
  Vector profile_vaf;            // training VAF at each, all else refitted
  ReflexImpulse impulse;
  PrepareReport report;
  DerivativeConsistency consistency;
  ReflexOptions options;
  Index train_rows = 0, held_out_rows = 0;
  double train_s = 0.0;
  bool refitted = false;
  std::uint32_t outcome = kReflexGood;
  std::vector<std::string> warnings, notes, provenance;
  // Per trial, prepared rows x 6: time, torque F, intrinsic path, reflex path (both in the sign of
  // F, NaN where the past is unknown), rectified velocity, use (0 none, 1 train, 2 held out).
  std::vector<Matrix> signals;
};

// Throws Error: as prepare; kArgument for options out of range or several axes; kData when too
// little is left; kAnalysis when the velocity never passes the threshold, or the data do not
// determine the paths.
ReflexEstimate identify_reflex(const Record& record, const ReflexOptions& options,
                               Token* token = nullptr);

}  // namespace ulna
