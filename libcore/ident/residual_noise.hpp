// The correlation of what a model leaves over, and what it does to the errors of its parameters.
#pragma once

#include <vector>

#include "base/types.hpp"

namespace ulna {

// e[k] = sum_l ar[l] e[k-1-l] + white noise.
struct ResidualNoise {
  Vector ar;                // empty: white
  double variance = 0.0;    // of the residuals
  double innovation = 0.0;  // of the white noise behind them
};

// Yule-Walker models of order 0 to most_order, the one with the least Bayesian criterion; runs are
// never joined. The zero of the residuals is their mean.
ResidualNoise residual_noise(const std::vector<Vector>& residuals, Index most_order);

// Sum over k, l of psi_k cov(e_k, e_l) psi_l': the covariance of the score psi e (Ljung 1999,
// (9.42)). psi: parameters x rows of one run.
Matrix score_covariance(const Matrix& psi, const ResidualNoise& noise);

}  // namespace ulna
