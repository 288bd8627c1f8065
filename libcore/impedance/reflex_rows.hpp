// Rows of the parallel cascade drawn from prepared signals: the linear block of the intrinsic path,
// the torque, and the reflex path's output for given dynamics and delay.
#pragma once

#include <vector>

#include "base/types.hpp"
#include "ident/prepare.hpp"
#include "impedance/causal_element.hpp"
#include "impedance/reflex.hpp"
#include "impedance/scores.hpp"
#include "impedance/split.hpp"

namespace ulna {

// Signals of one trial, a value a prepared row.
struct CascadeTrial {
  Matrix motion;   // x - x_mean, x', x''
  Matrix powers;   // (x - x_mean)^k, k = 2 ..., filtered as the torque was
  Vector torque;   // -F
  Vector drive;    // rectified velocity, filtered as the torque was
  Index edge = 0;  // rows at either end where filters show the end
};

// The rectified signal passes the low pass that the torque has passed: H and the filter commute,
// rectifying and filtering do not.
std::vector<CascadeTrial> cascade_trials(const Prepared& prepared, const ReflexOptions& options,
                                         int side, double position_mean);

// Every stride-th prepared row of spans, with the margins that lags and delays need taken off.
struct CascadeSample {
  struct Run {
    int trial = 0;
    Index first = 0;  // prepared row
    Index count = 0;
  };
  std::vector<Run> runs;
  Runs bounds;
  Index stride = 1;
  Index rows() const noexcept { return bounds.rows(); }
};

CascadeSample cascade_sample(const std::vector<CascadeTrial>& trials,
                             const std::vector<Span>& spans, Index back, Index ahead, Index stride,
                             Index least_rows);

// Gathers a signal (by trial) at the rows of a sample, `lag` prepared rows earlier.
template <class Pick>
Vector gather(const CascadeSample& sample, Index lag, Pick pick) {
  Vector out(sample.rows());
  for (std::size_t r = 0; r < sample.runs.size(); ++r) {
    const auto& run = sample.runs[r];
    const auto signal = pick(run.trial);
    for (Index i = 0; i < run.count; ++i) {
      out[sample.bounds.begin[r] + i] = signal[run.first + i * sample.stride - lag];
    }
  }
  return out;
}

// Offsets and drifts of every run, projected out of columns.
class RunOffsets {
 public:
  RunOffsets(const CascadeSample& sample, int drift);
  void remove(Matrix& columns) const;
  Vector removed(Vector column) const;
  void remove_in_run(std::size_t run, Matrix& rows_of_run) const;

 private:
  const CascadeSample* sample_;
  Matrix basis_;  // rows x (drift + 1), orthonormal within each run
};

// Output of the reflex element at the rows of a sample, for unit gain.
Vector reflex_column(const std::vector<CascadeTrial>& trials, const CascadeSample& sample,
                     const CausalElement& element, double delay_s, double step_s);

// What an unknown past at the start of a trial leaves behind, a column a state; only for runs that
// begin while it lasts.
struct PastRun {
  std::size_t run = 0;
  Index first = 0;  // sample row
  Matrix columns;
};
std::vector<PastRun> past_columns(const std::vector<CascadeTrial>& trials,
                                  const CascadeSample& sample, const CausalElement& element,
                                  double delay_s, double step_s);

}  // namespace ulna
