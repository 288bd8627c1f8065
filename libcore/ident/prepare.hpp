// From a record to the rows of a regression: position, velocity, acceleration, force and reference,
// all through one linear operator (Savitzky-Golay, then a zero-phase Butterworth low pass), so that
// a linear relation between the recorded signals stays exactly the same relation. Dyck 2013, 3.4.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "record/record.hpp"
#include "signal/zero_phase.hpp"

namespace ulna {

struct PrepareOptions {
  int window = 0;             // samples, odd; 0: from the low pass (101 at 1 kHz and 5 Hz)
  int order = 0;              // of the polynomial; 0: 6
  int lowpass_order = 0;      // 0: 5
  double lowpass_hz = 0.0;    // 0: from the motion, 5 to 60 Hz; negative: no low pass
  bool corrected = false;     // lowpass_hz is the effective -3 dB frequency after both passes
  bool plain_savgol = false;  // derivative kernels as published (as without a low pass)
  ZeroPhase zero_phase;
};

// Channel numbers of the record, by axis.
struct Roles {
  std::vector<Index> position;
  std::vector<Index> force;
  std::vector<Index> reference;  // empty: the log holds none
};

struct PrepareReport {
  double rate_hz = 0.0;
  int window = 0;
  int order = 0;
  int lowpass_order = 0;             // 0: no low pass
  double lowpass_hz = 0.0;           // design frequency of one pass; 0: no low pass
  double effective_cutoff_hz = 0.0;  // -3 dB of the whole smoother for the value
  double motion_band_hz = 0.0;       // 95 % of the power of velocity (of the reference's, if any)
  Index dropped_rows = 0;            // at either end of every trial: no full window
  ZeroPhase zero_phase;              // how the ends are extended
  Index pad_rows = 0;                // odd extension at either end
  Index transient_rows = 0;          // at either end: the extension still shows (share epsilon)
  bool short_trials = false;         // a trial is shorter than the pad asked for
  bool lowpass_chosen = false;       // from the motion, not by the caller
};

// One trial after preparation. Rows are the record's rows [begin, begin + rows).
class PreparedTrial {
 public:
  // table: position, velocity, acceleration (n columns each), force (n), then reference, its rate
  // and its acceleration (m each).
  PreparedTrial() = default;
  PreparedTrial(Index begin, Index n, Index m, Matrix table)
      : begin_(begin), n_(n), m_(m), table_(std::move(table)) {}

  Index begin() const noexcept { return begin_; }
  Index rows() const noexcept { return table_.rows(); }
  auto position() const { return table_.middleCols(0, n_); }
  auto velocity() const { return table_.middleCols(n_, n_); }
  auto acceleration() const { return table_.middleCols(2 * n_, n_); }
  auto force() const { return table_.middleCols(3 * n_, n_); }
  auto reference() const { return table_.middleCols(4 * n_, m_); }
  auto reference_rate() const { return table_.middleCols(4 * n_ + m_, m_); }
  auto reference_acceleration() const { return table_.middleCols(4 * n_ + 2 * m_, m_); }
  const Matrix& table() const noexcept { return table_; }

 private:
  Index begin_ = 0;
  Index n_ = 0;
  Index m_ = 0;
  Matrix table_;
};

struct Prepared {
  Roles roles;
  PrepareReport report;
  std::vector<PreparedTrial> trials;
};

// Words as Record::resolve takes them, or names with commas ("x," "x,y"), which mean exactly these;
// an empty word means the channels that have the role.
Roles find_roles(const Record& record, const std::string& position, const std::string& force,
                 const std::string& reference);

// Throws Error: kData for a channel with NaN, a jittered clock or too few rows (with channel and
// row), kArgument for options that do not fit the record.
Prepared prepare(const Record& record, const Roles& roles, const PrepareOptions& options,
                 int threads = 1, Token* token = nullptr);

// Frequency below which the given share of the power of d(signals)/dt lies, up to max_hz; the
// largest over the signals.
double motion_band(const Record& record, const std::vector<Index>& channels, double share,
                   double max_hz);

}  // namespace ulna
