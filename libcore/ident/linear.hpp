// Least squares and two-stage least squares (instrumental variables) of several outputs on the same
// regressors, from one triangular factor of [instruments | regressors | outputs].
#pragma once

#include <string>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "ident/design.hpp"

namespace ulna {

enum class Estimator { kLeastSquares, kInstrumental };

// What a regression needs to know of its data: R of a QR factorisation of [Z | Phi | Y], of widths
// q, p and n. Factors of parts are merged by factorising their stack, so trials combine exactly.
struct Factor {
  Index q = 0;
  Index p = 0;
  Index n = 0;
  Index rows = 0;
  Matrix r;  // (q + p + n) square, upper triangular
};

Factor factorise(const Design& design, const std::vector<Span>& spans, Token* token = nullptr);
Factor merge(const std::vector<const Factor*>& parts);
// From a Gram matrix of the same columns (bootstrap: sums of blocks' Gram matrices).
Factor factor_of_gram(const Matrix& gram, Index q, Index p, Index n, Index rows);

// Parameters theta (p x n, one column an output) = unvec(T eta), T (p n) x k. The identity leaves
// every parameter free.
struct Fit {
  Estimator estimator = Estimator::kLeastSquares;
  Matrix theta;            // p x n
  Matrix transform;        // T
  Matrix information;      // T' (I (x) A) T, k x k
  Matrix weights;          // IV: q x p, projects instruments on regressors; least squares: empty
  double condition = 0.0;  // of the regressors in unit columns
  Vector weakest;  // unit direction of k parameters (in unit columns) the data determine least
};

// Throws nothing for a rank-deficient problem, instruments that are copies of each other included:
// `condition` is then infinite and theta means nothing.
Fit solve(const Factor& factor, const Matrix& transform, Estimator estimator);

// Newey-West covariance of the parameters of several fits to the same spans, stacked: vec(theta_1),
// vec(theta_2), ... (Newey and West 1987, Bartlett weights 1 - |l| / (lag + 1)). Spans of one trial
// that touch count as one run; correlation never reaches across runs. With a stride, scores are
// first summed over that many rows and the weights count sums: the same to rounding when the
// signals hold nothing near rate / (2 stride).
Matrix newey_west(const Design& design, const std::vector<Span>& spans,
                  const std::vector<const Fit*>& fits, Index lag, Index stride = 1,
                  Token* token = nullptr, int threads = 1);

// Parameters refitted to `count` resamples of blocks drawn with replacement; rows: replicates,
// columns: vec(theta). Block b of replicate i is a function of (seed, i, b) alone.
Matrix block_bootstrap(const Design& design, const std::vector<Span>& blocks,
                       const Matrix& transform, Estimator estimator, Index count,
                       std::uint64_t seed, int threads, Token* token = nullptr);

}  // namespace ulna
