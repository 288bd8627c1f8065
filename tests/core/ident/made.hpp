// Prepared signals that are random tables, and the dense matrices that a test compares with.
#pragma once

#include <utility>
#include <vector>

#include "base/random.hpp"
#include "ident/design.hpp"
#include "ident/prepare.hpp"

namespace ulna {

// Trials of the given rows; a slow autoregression, so that neighbouring rows are correlated. The
// force follows the motion with random parameters and noise; the reference is correlated with the
// motion.
inline Prepared made_prepared(const std::vector<Index>& rows, Index n, Index m,
                              std::uint64_t seed) {
  Random random(seed);
  Matrix law(3 * n, n);
  for (double& x : law.reshaped()) x = random.normal();
  Prepared out;
  out.roles.position.resize(static_cast<std::size_t>(n));
  out.roles.force.resize(static_cast<std::size_t>(n));
  out.roles.reference.resize(static_cast<std::size_t>(m));
  out.report.rate_hz = 100.0;
  Index begin = 0;
  for (const Index count : rows) {
    Matrix table(count, 4 * n + 3 * m);
    Eigen::RowVectorXd state = Eigen::RowVectorXd::Zero(table.cols());
    for (Index i = 0; i < count; ++i) {
      for (double& s : state) s = 0.8 * s + random.normal();
      table.row(i) = state;
    }
    for (Index k = 0; k < std::min(m, n); ++k) {  // instruments that say something
      table.col(k) += 2.0 * table.col(4 * n + k);
      table.col(n + k) += 2.0 * table.col(4 * n + m + k);
      table.col(2 * n + k) += 2.0 * table.col(4 * n + 2 * m + k);
    }
    table.leftCols(n).array() += 3.0;  // positions are not centred
    table.middleCols(3 * n, n) += table.leftCols(3 * n) * law;
    out.trials.emplace_back(begin, n, m, std::move(table));
    begin += count;
  }
  return out;
}

inline Matrix dense(const Design& design, const std::vector<Span>& spans) {
  Matrix out(row_count(spans), design.columns());
  Index at = 0;
  for (const Span& span : spans) {
    const Index count = span.end - span.begin;
    design.fill(span.trial, span.begin, count, out.middleRows(at, count));
    at += count;
  }
  return out;
}

}  // namespace ulna
