// Covariance and tests from the scores of a fit, a row each: for models that ident/linear.hpp does
// not cover, whose regressors are made from signals and their own parameters.
#pragma once

#include <cstdint>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"

namespace ulna {

// Rows of several runs one after the other; run i holds [begin[i], begin[i + 1]).
struct Runs {
  std::vector<Index> begin{0};

  Index count() const noexcept { return static_cast<Index>(begin.size()) - 1; }
  Index rows() const noexcept { return begin.back(); }
  void add(Index length) { begin.push_back(begin.back() + length); }
};

// Sum over lags of the scores' covariance with Bartlett weights 1 - |l| / (lag + 1) (Newey and West
// 1987); correlation never reaches across runs. Divide by information on both sides.
Matrix bartlett_sum(const Matrix& scores, const Runs& runs, Index lag);

// Rows of a lag, at most half the longest run.
Index lag_rows(const Runs& runs, double seconds, double rate_hz);

// Rows [first, second) of about `length` rows within runs, of nearly equal length.
std::vector<std::pair<Index, Index>> score_blocks(const Runs& runs, Index length);

// Are columns missing from a model, where it is not known which of several sets? candidates: per
// set, blocks x k sums of (candidate column, less its projection on the model's) times residual.
// The statistic is the largest s' (S'S)^-1 s, s the sum of a set's rows S; its distribution when
// nothing is missing comes from flipping the signs of whole blocks (Rademacher multipliers, the
// same for all sets). NaN p with fewer than 6 blocks.
struct ScoreTest {
  double statistic = 0.0;
  double p_value = 1.0;
  Index best = 0;  // the set
  Index blocks = 0;
};
ScoreTest score_test(const std::vector<Matrix>& candidates, Index draws, std::uint64_t seed,
                     Token* token = nullptr);

}  // namespace ulna
