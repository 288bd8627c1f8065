// What the smoothing does to each frequency: the Savitzky-Golay kernels for value, first and second
// derivative, times the two-pass (squared) gain of the low pass. Fig. 3.5 of Dyck 2013.
#pragma once

#include "base/types.hpp"
#include "signal/butterworth.hpp"
#include "signal/savgol.hpp"

namespace ulna {

// Magnitudes, rows(freq_hz) x 3: value (1), first derivative (1/s), second derivative (1/s^2), that
// is the amplitude of the output for a unit sine. sos may be null: the kernels alone. Frequencies
// from 0 to rate_hz / 2.
Matrix smoother_gain(const SavgolSpec& spec, const Sos* sos, double rate_hz, VectorRef freq_hz);

// The same relative to the ideal operators 1, omega and omega^2: 1 where the smoother is
// transparent. At 0 Hz the limit.
Matrix smoother_response(const SavgolSpec& spec, const Sos* sos, double rate_hz, VectorRef freq_hz);

// Magnitude of one pass of the sections (square it for forward-backward).
Vector sos_gain(const Sos& sos, double rate_hz, VectorRef freq_hz);

}  // namespace ulna
