// Cross spectra by Welch's method (Hann window, 50 % overlap, mean of each segment removed), and
// what follows from them: multiple coherence and the H1 frequency response with its confidence
// region.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"

namespace ulna {

struct RowRange {
  Index begin = 0;
  Index end = 0;  // one past the last row
};

// All rows where no ranges are given.
std::vector<RowRange> used_ranges(Index rows, const std::vector<RowRange>& ranges);

struct Spectra {
  Vector freq_hz;  // 0 ... rate / 2, segment / 2 + 1 values
  std::vector<Eigen::MatrixXcd>
      s;               // per frequency, channels x channels: s(i, j) = <conj(X_i) X_j>,
                       // one-sided density (unit_i unit_j / Hz) as scipy.signal.csd
  Index averages = 0;  // segments averaged
  double effective_averages =
      0.0;  // independent segments they are worth, for 50 % overlap 0.95 times
};

struct Averaging {
  Index averages = 0;
  double effective = 0.0;
};

// What welch averages over; throws as it does.
Averaging welch_averaging(Index rows, Index segment, const std::vector<RowRange>& ranges = {});

// Averages over every whole segment of every range (empty: all rows); a segment never reaches
// across two ranges. Throws Error (kData) when no range holds a whole segment. Lengths with small
// prime factors are fast.
Spectra welch(MatrixRef signals, double rate_hz, Index segment,
              const std::vector<RowRange>& ranges = {}, Token* token = nullptr);

struct Coherence {
  Vector freq_hz;
  Matrix raw;  // frequencies x outputs, 0 to 1: share of the output's power explained linearly
  Matrix corrected;  // the same less the bias q / n of q inputs and n averages, not below 0
};

// Multiple coherence of each output on all the inputs (channel numbers of the spectra):
// gamma^2 = S_yx S_xx^-1 S_xy / S_yy; corrected = 1 - (1 - gamma^2) n / (n - q) (Bendat and Piersol
// 2010, section 9.2). NaN where the inputs are linearly dependent or carry no power; throws Error
// (kAnalysis) when that is so at every frequency, or when there are not more averages than inputs.
Coherence multiple_coherence(const Spectra& spectra, const std::vector<Index>& inputs,
                             const std::vector<Index>& outputs);

struct FrequencyResponse {
  Vector freq_hz;
  std::vector<Eigen::MatrixXcd> h;  // per frequency, outputs x inputs
  std::vector<Matrix> radius;       // of the circle about h that holds the truth with `confidence`
  double confidence = 0.95;
};

// H1 = S_xx^-1 S_xy, with the same refusals. The radius follows from complex regression: |h -
// h_true|^2 over its estimated variance is F(2, 2 (n - q)), whose quantile is closed: radius^2 =
// (S_xx^-1)_ii S_ee ((1 - confidence)^(-1 / (n - q)) - 1), S_ee the unexplained output density.
FrequencyResponse frequency_response(const Spectra& spectra, const std::vector<Index>& inputs,
                                     const std::vector<Index>& outputs, double confidence = 0.95);

}  // namespace ulna
