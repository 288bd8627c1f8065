// Rows of the regression of (3.2) of Dyck 2013, -F = M a + B v + K (x - x_mean) + c, drawn from
// prepared signals block by block, so that no table of the whole record is ever stored.
#pragma once

#include <utility>
#include <vector>

#include "base/types.hpp"
#include "ident/prepare.hpp"

namespace ulna {

// Prepared rows [begin, end) of one trial.
struct Span {
  int trial = 0;
  Index begin = 0;
  Index end = 0;
};

// Columns of a block: instruments [r'' r' r 1], regressors [a v x 1], outputs y = -F - payload a.
// Instruments are absent (q = 0) without at least as many references as axes.
class Design {
 public:
  // Positions and references are centred on their mean over `spans`, which conditions the constant.
  Design(const Prepared& prepared, double payload_kg, const std::vector<Span>& spans);

  Index axes() const noexcept { return n_; }
  Index instruments() const noexcept { return q_; }
  Index regressors() const noexcept { return 3 * n_ + 1; }
  Index columns() const noexcept { return q_ + regressors() + n_; }
  double payload_kg() const noexcept { return payload_kg_; }
  const Vector& position_mean() const noexcept { return position_mean_; }

  // out: count x columns().
  void fill(int trial, Index row, Index count, Eigen::Ref<Matrix> out) const;

 private:
  const Prepared* prepared_;
  double payload_kg_;
  Index n_;
  Index m_;
  Index q_;
  Vector position_mean_;
  Vector reference_mean_;
};

Index row_count(const std::vector<Span>& spans);

}  // namespace ulna
