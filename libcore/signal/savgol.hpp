// Savitzky-Golay smoothing and differentiation: a polynomial of given order is fitted by least
// squares to every window; its value and derivatives at the centre are the output (Savitzky and
// Golay 1964). Thesis defaults: order 6, window 101 at 1 kHz (Dyck 2013, section 3.4).
#pragma once

#include "base/types.hpp"

namespace ulna {

struct SavgolSpec {
  int window = 101;  // samples, odd
  int order = 6;     // of the polynomial, below the window
};

// Throws Error (kArgument) unless window is odd and at most 100001, 0 <= order < window, order <=
// 30, and 0 <= max_derivative <= 6.
void check_savgol(const SavgolSpec& spec, int max_derivative);

// window x (max_derivative + 1). Column d holds the weights for derivative d at the centre, in
// units of 1 / s^d: value[i] = sum over k of w[k] y[i + k - half], half = (window - 1) / 2. Columns
// are exactly even (d even) or odd (d odd); a derivative above the order is zero.
Matrix savgol_kernels(const SavgolSpec& spec, int max_derivative, double rate_hz);

// First frequency at which the value kernel's gain is 1/sqrt(2), as a fraction of the Nyquist
// frequency; 1 when the gain never falls that far. Exact, where (3.6) of Dyck 2013 approximates.
double savgol_cutoff(const SavgolSpec& spec);

// Rows at either end whose output comes from the end polynomial instead of a centred window.
inline Index savgol_edge_rows(const SavgolSpec& spec) { return (spec.window - 1) / 2; }

// Kernels (even and odd columns in turn, as savgol_kernels and matched_kernels give them) at every
// row that has a full window. y: at least as many rows as the kernels; out: rows(y) - window + 1
// rows, one column a kernel.
void savgol_correlate(const Matrix& kernels, VectorRef y, Eigen::Ref<Matrix> out);

// out: rows(y) x (max_derivative + 1), derivative d in 1 / s^d. The savgol_edge_rows at either end
// come from the polynomial fitted to the first or last window, as scipy.signal.savgol_filter does
// with mode='interp'; they are less certain and callers flag them. Throws Error (kData) when y is
// shorter than the window or holds a value that is not finite.
void savgol_apply(const SavgolSpec& spec, double rate_hz, VectorRef y, int max_derivative,
                  Eigen::Ref<Matrix> out);

}  // namespace ulna
