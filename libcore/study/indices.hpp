// Sensitivity indices of a study's outputs.
//
// Variance-based, of a saltelli design (V the variance of the outputs, A, B, C_i = AB_i; all but
// the parity estimator work on centred outputs, so a large mean costs no digits):
//   Saltelli 2010   S_i = mean(B (C_i - A)) / V           the default first order, centred
//   Jansen 1999     T_i = mean((A - C_i)^2) / (2 V)       the default total order
//   Janon 2014      S_i, T_i from the pairs (B, C_i), (A, C_i) with their common mean and variance
//   Martinez 2011   S_i = corr(B, C_i), T_i = 1 - corr(A, C_i)
//   parity          S_i = (mean(B C_i) - f^2) / (mean(B^2) - f^2), T_i = 1 - (mean(A C_i) - f^2) /
//   ...,
//                   f = mean(B): the uncentred pair of Saltelli 2008 that SAFE computes (its A and
//                   B are our B and A)
//   Saltelli 2002   S_ij = mean(BA_i AB_j - A B) / V - S_i - S_j
// Elementary effects, of radial designs and trajectories, in quantiles: EE_i = (change of the
// output) / (signed change of the quantile); mu, mu* (mean magnitude, Campolongo 2007) and sigma
// (with r - 1). Radial steps that are not guarded also give Jansen's total index. Nothing is
// clipped: an index below zero says how large the error is.
#pragma once

#include <cstdint>
#include <vector>

#include "base/token.hpp"
#include "study/block_estimate.hpp"
#include "study/failures.hpp"
#include "study/sampling.hpp"

namespace ulna {

enum class IndexEstimator { kDefault, kJanon, kMartinez, kParity };

enum class Subset { kPrefix, kRandom };

struct IndexSpec {
  IndexEstimator estimator = IndexEstimator::kDefault;
  OnFailure on_failure = OnFailure::kError;
  IntervalSpec interval;  // its replicates are the design's
  // Analyse so many blocks of each replicate only: the first, or a random choice; 0: all.
  Index blocks = 0;
  Subset subset = Subset::kPrefix;
};

enum class IndexOutcome {
  kGood,
  kConstant,  // the outputs do not vary: variance-based indices are not defined (NaN)
};

struct Indices {
  IndexOutcome outcome = IndexOutcome::kGood;
  Index groups = 0;
  Index blocks = 0;  // that the estimates rest on
  Estimates mean;    // of the outputs, size 1; of A and B, or of the first rows of blocks
  Estimates variance;
  // Variance-based, empty where the design does not give them:
  Estimates first;
  Estimates total;
  Estimates second;       // pairs 01, 02, ..., 12, ...
  Estimates dummy_first;  // of a factor that does nothing, size 1: the noise of the estimator
  Estimates dummy_total;
  // Elementary effects; mu and sigma are NaN for groups of several factors, whose steps have no
  // sign:
  Estimates mu;
  Estimates mu_star;
  Estimates sigma;
  FailureReport failures;
  // Indices of the indicator "this run failed", when some did; empty otherwise. Total only where
  // the steps are independent, first only of a saltelli design.
  Estimates failure_first;
  Estimates failure_total;
};

Indices variance_indices(const Sampling& sampling, const VectorRef& y,
                         const std::vector<std::int32_t>& status, const IndexSpec& spec,
                         Token* token = nullptr);

Indices elementary_effects(const Sampling& sampling, const VectorRef& y,
                           const std::vector<std::int32_t>& status, const IndexSpec& spec,
                           Token* token = nullptr);

}  // namespace ulna
