// Butterworth low pass as second-order sections, by the bilinear transform with prewarping. The
// (b, a) form is not offered: it errs by 1e-2 at order 5 and a normalised cut-off of 0.001.
#pragma once

#include "base/types.hpp"

namespace ulna {

// n x 6: b0 b1 b2 a0 a1 a2 with a0 = 1, applied from the first row to the last. A first-order
// section has b2 = a2 = 0.
struct Sos {
  Matrix sections;
};

// Throws Error (kArgument) unless sections is n x 6, finite, with a0 = 1, and every pole is inside
// the unit circle.
void check_sos(const Sos& sos);

// Order 1 to 20, 0 < cutoff_hz < rate_hz / 2. Section order and gain as
// scipy.signal.butter(order, cutoff_hz, fs=rate_hz, output='sos').
Sos butterworth_lowpass(int order, double cutoff_hz, double rate_hz);

// Largest magnitude of a pole: the slowest transient decays as radius^n.
double max_pole_radius(const Sos& sos);

// Samples until the slowest transient has fallen to epsilon: ceil(ln epsilon / ln max_pole_radius).
// 0 when every pole is at the origin.
Index settle_samples(const Sos& sos, double epsilon);

// -3 dB frequency of the forward-backward filter. Two passes square the gain, so with the prewarped
// frequency tan(pi f / fs) it lies at (sqrt(2) - 1)^(1 / (2 order)) of the design's: 0.9156 at
// order 5 in the analogue limit.
double two_pass_cutoff(int order, double cutoff_hz, double rate_hz);

// The design cut-off whose forward-backward filter is -3 dB at wanted_hz, 0 < wanted_hz < rate_hz
// / 2.
double corrected_cutoff(int order, double wanted_hz, double rate_hz);

}  // namespace ulna
