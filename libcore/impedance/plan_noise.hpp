// Second moments of regressions whose signals are filtered noise with a known spectrum.
#pragma once

#include <complex>
#include <functional>
#include <vector>

#include "base/types.hpp"

namespace ulna {

// Joint two-sided spectrum of the noise in the regressors [a v x 1] (3 n + 1) and the residuals
// (n), at frequencies k * step_hz, k = 0 ...; zero above the last.
struct NoiseSpectra {
  double step_hz = 0.0;
  std::vector<Eigen::MatrixXcd> density;  // (p + n) square, Hermitian
};

// Transforms of real columns at the frequencies of the spectra (and no others): the DTFT of
// sequences sampled at rate_hz, padded so that products of two of them are exact correlations.
class Transforms {
 public:
  // columns: rows x w; the spectra's step is rate_hz / length().
  Transforms(const Matrix& columns, double rate_hz, Index bins);
  static Index length_for(Index rows);

  // sum over f of conj(X_a) X_b S(f), both signs of f, times rate / length: the covariance of
  // sum_t x_a(t) e_i(t) and sum_t x_b(t) e_j(t). pick(k) gives S at bin k, m x m. Entry
  // (i w + a, j w + b).
  Matrix covariance(const std::function<Eigen::MatrixXcd(Index)>& pick, Index m) const;

  const Eigen::MatrixXcd& values() const noexcept { return values_; }  // bins x w
  // Of bin k in a sum over both signs of f.
  double weight(Index k) const noexcept { return k == 0 ? weight_ : 2.0 * weight_; }

 private:
  Eigen::MatrixXcd values_;
  double weight_ = 0.0;
};

// Integral over both signs of f of the real part of a Hermitian matrix given at k * step_hz.
Matrix integral(const NoiseSpectra& spectra);

}  // namespace ulna
