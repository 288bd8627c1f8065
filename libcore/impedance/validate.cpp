#include "impedance/validate.hpp"

#include "base/pool.hpp"
#include "base/random.hpp"
#include "impedance/split.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr std::uint64_t kVafStream = 1u << 21;

}  // namespace

void validate(const Design& design, const std::vector<Span>& spans, const Matrix& theta,
              double rate_hz, std::uint64_t seed, int threads, Vector& vaf, Matrix* interval) {
  const Index n = design.axes();
  const Index q = design.instruments();
  const Index p = design.regressors();
  vaf = Vector::Constant(n, kNaN);
  if (interval != nullptr) *interval = Matrix::Constant(2, n, kNaN);
  if (row_count(spans) < 10) return;

  const std::vector<Span> blocks = cut(spans, static_cast<Index>(rate_hz));
  // Per block: rows, then per axis the sums of e, e^2, f, f^2.
  Matrix sums(static_cast<Index>(blocks.size()), 1 + 4 * n);
  parallel_for(sums.rows(), threads, [&](std::ptrdiff_t index) {
    const auto b = static_cast<std::size_t>(index);
    const Index count = blocks[b].end - blocks[b].begin;
    Matrix rows(count, design.columns());
    design.fill(blocks[b].trial, blocks[b].begin, count, rows);
    const Matrix error = rows.rightCols(n) - rows.middleCols(q, p) * theta;
    // The variance is that of the force as measured, payload included.
    const Matrix force = rows.rightCols(n) + design.payload_kg() * rows.middleCols(q, n);
    auto row = sums.row(index);
    row[0] = static_cast<double>(count);
    for (Index i = 0; i < n; ++i) {
      row[1 + 4 * i] = error.col(i).sum();
      row[2 + 4 * i] = error.col(i).squaredNorm();
      row[3 + 4 * i] = force.col(i).sum();
      row[4 + 4 * i] = force.col(i).squaredNorm();
    }
  });
  const auto vaf_of = [&](const Eigen::RowVectorXd& total, Index i) {
    const auto variance = [&](Index first) {
      return total[first + 1] - total[first] * total[first] / total[0];
    };
    const double force = variance(3 + 4 * i);
    return force > 0.0 ? 100.0 * (1.0 - variance(1 + 4 * i) / force) : kNaN;
  };
  const Eigen::RowVectorXd total = sums.colwise().sum();
  for (Index i = 0; i < n; ++i) vaf[i] = vaf_of(total, i);
  if (interval == nullptr || blocks.size() < 5) return;
  constexpr Index kReplicates = 500;
  std::vector<std::vector<double>> replicates(static_cast<std::size_t>(n));
  for (Index r = 0; r < kReplicates; ++r) {
    Random random(seed, kVafStream + static_cast<std::uint64_t>(r));
    Eigen::RowVectorXd drawn = Eigen::RowVectorXd::Zero(sums.cols());
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      drawn += sums.row(random.below(static_cast<std::int64_t>(blocks.size())));
    }
    for (Index i = 0; i < n; ++i)
      replicates[static_cast<std::size_t>(i)].push_back(vaf_of(drawn, i));
  }
  for (Index i = 0; i < n; ++i) {
    (*interval)(0, i) = sample_quantile(replicates[static_cast<std::size_t>(i)], 0.025);
    (*interval)(1, i) = sample_quantile(replicates[static_cast<std::size_t>(i)], 0.975);
  }
}

}  // namespace ulna
