// Savitzky-Golay derivative kernels that pass the same band as the value kernel.
//
// The kernels of one polynomial fit do not have the same response: at 3 Hz (101 samples, order 6,
// 1 kHz) the first and second derivative deviate from omega and omega^2 by 1e-5 where the value
// deviates by 1e-6, and a regression of force on motion turns that into an error of the parameters.
// Here each derivative kernel gets the smallest change (in the sum of squares, that is in noise
// gain) that makes its response (j omega)^d times the response of the value kernel throughout the
// band that the low pass leaves. Force and motion then carry one and the same linear operator, and
// the parameters of a noise-free record come out exact. Above the band the kernels pass more noise
// than plain ones: they are for use before a low pass.
#pragma once

#include "base/types.hpp"
#include "signal/savgol.hpp"

namespace ulna {

// window x (max_derivative + 1) as savgol_kernels; column 0 is unchanged. band_hz: upper end of the
// band to match, above 0; it is limited to 1.25 times the value kernel's -3 dB frequency.
Matrix matched_kernels(const SavgolSpec& spec, int max_derivative, double rate_hz, double band_hz);

}  // namespace ulna
