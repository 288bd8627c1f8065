// Phases that keep the peak of a sum of sinusoids low: more motion inside the same limits.
#pragma once

#include <cstdint>

#include "base/token.hpp"
#include "base/types.hpp"

namespace ulna {

// sum over k of amplitude(k) cos(2 pi freq_hz(k) t + phase_rad(k)).
struct Sinusoids {
  Vector freq_hz;
  Vector amplitude;
  Vector phase_rad;
};

// Schroeder 1970 ("Synthesis of low-peak-factor signals and binary sequences with low
// autocorrelation"): phase(k) = -2 pi sum over j < k of (k - j) p(j), p the share of each line in
// the power; -pi k (k - 1) / count for equal amplitudes, k from 1.
Vector schroeder_phases(VectorRef amplitude);

// Largest magnitude over rms, both over [0, span_s] on a grid of 64 points per period of the
// fastest line (and at least 4096 points): within 0.1 % of the continuous crest factor.
double crest_factor(const Sinusoids& lines, double span_s);

// Phases of low crest factor, from lines.phase_rad and from `starts` random sets: minimises the
// L_2p norm for p = 2, 4, ..., 128 in turn by Levenberg-Marquardt, each from the last, since the
// limit of the norms is the peak (Guillaume, Schoukens, Pintelon and Kollar 1991, "Crest-factor
// minimization using nonlinear Chebyshev approximation methods"). The best of all, never worse than
// the given phases. A local minimum: another seed or more starts may find a lower one.
Vector low_crest_phases(const Sinusoids& lines, double span_s, int starts, std::uint64_t seed,
                        std::uint64_t stream, Token* token = nullptr);

}  // namespace ulna
