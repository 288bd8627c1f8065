// The clock of a recorded log: how much its stamps jitter, where samples are missing, and the
// band-limited signal behind jittered stamps on a uniform grid.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"

namespace ulna {

struct Jitter {
  double median_step_s = 0.0;
  double rms_fraction = 0.0;  // rms of step / median - 1, without the gaps
  double max_fraction = 0.0;  // largest |step / median - 1|, without the gaps
  Index worst_row = 0;        // row whose step from the row before is that one
  Index gaps = 0;             // steps above 1.5 medians
  Index first_gap_row = -1;   // row before the first gap, -1 without one
  Index largest_gap_row = -1;
  double largest_gap_s = 0.0;
  std::vector<Index> gap_rows;  // row before each gap
};

// times: s, at least 2, finite, strictly increasing (else Error kData with the row).
Jitter check_clock(VectorRef times);

struct ResampleOptions {
  double max_gap_steps =
      2.5;  // refuse a longer step, in median steps: a lone lost sample is bridged
  double tolerance =
      1e-7;  // stop when the residual at the recorded instants is this share of the rms
  int max_iterations = 300;
};

// Values of columns(y) at t0_s + k / rate_hz, k = 0 ... n - 1, which must lie within the recorded
// times. The record is taken as band-limited to 0.7 of its own Nyquist frequency (mean rate / 2)
// and fitted by least squares in windowed-sinc functions, so jitter up to 30 % rms of the step is
// undone; a lower rate_hz low-passes to 0.7 of the new Nyquist frequency. Some 64 samples at either
// end are less exact. Throws Error (kData) at a gap, with its row.
Matrix resample_columns(VectorRef times, MatrixRef y, double t0_s, double rate_hz, Index n,
                        const ResampleOptions& options = {}, Token* token = nullptr);

// The same for one channel.
Vector resample_uniform(VectorRef times, VectorRef y, double t0_s, double rate_hz, Index n,
                        const ResampleOptions& options = {}, Token* token = nullptr);

}  // namespace ulna
