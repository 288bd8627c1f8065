// Forward-backward filtering by second-order sections, with odd extension at the ends and the
// steady state of each section as its start (Gustafsson 1996 gives the problem, SciPy the
// convention).
#pragma once

#include "base/types.hpp"
#include "signal/butterworth.hpp"

namespace ulna {

enum class Pad {
  kPoleRadius,  // until the slowest transient has fallen to epsilon
  kScipy,  // the default padlen of scipy.signal.sosfiltfilt, which is shorter than the transient
};

struct ZeroPhase {
  Pad pad = Pad::kPoleRadius;
  double epsilon = 1e-3;  // of the transient, for kPoleRadius: 0 < epsilon < 1
};

// Samples by which each end is extended, before any limit by the length of the signal.
Index pad_samples(const Sos& sos, const ZeroPhase& options);

// What filter_zero_phase uses for signals of this length: pad_samples, at most rows - 1. A result
// below pad_samples tells that the signal is too short for the transient to die out within the pad.
Index effective_pad_samples(const Sos& sos, const ZeroPhase& options, Index rows);

// Filters every column on its own, in place. Throws Error (kData) when signals has fewer than 2
// rows or holds a value that is not finite; signals is then unchanged.
void filter_zero_phase(const Sos& sos, const ZeroPhase& options, Eigen::Ref<Matrix> signals);

}  // namespace ulna
