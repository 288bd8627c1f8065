#include "impedance/scores.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/random.hpp"

namespace ulna {
namespace {

constexpr Index kLeastBlocks = 6;
constexpr std::uint64_t kSignStream = 1u << 22;

}  // namespace

Matrix bartlett_sum(const Matrix& scores, const Runs& runs, Index lag) {
  // Bartlett weights are the autocorrelation of a box: the sum over lags is the Gram matrix of the
  // moving sums over lag + 1 rows, over lag + 1.
  const Index p = scores.cols();
  Matrix out = Matrix::Zero(p, p);
  for (Index run = 0; run < runs.count(); ++run) {
    const Index first = runs.begin[static_cast<std::size_t>(run)];
    const Index last = runs.begin[static_cast<std::size_t>(run) + 1];
    const Index window = std::clamp<Index>(lag + 1, 1, std::max<Index>(1, last - first));
    Matrix moving(last - first + window - 1, p);
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(p);
    for (Index i = 0; i < moving.rows(); ++i) {
      if (first + i < last) sum += scores.row(first + i);
      if (i >= window) sum -= scores.row(first + i - window);
      moving.row(i) = sum;
    }
    out.noalias() += moving.transpose() * moving / static_cast<double>(window);
  }
  return out;
}

Index lag_rows(const Runs& runs, double seconds, double rate_hz) {
  Index longest = 1;
  for (std::size_t run = 0; run + 1 < runs.begin.size(); ++run) {
    longest = std::max(longest, runs.begin[run + 1] - runs.begin[run]);
  }
  return std::min(static_cast<Index>(std::lround(seconds * rate_hz)), longest / 2);
}

std::vector<std::pair<Index, Index>> score_blocks(const Runs& runs, Index length) {
  std::vector<std::pair<Index, Index>> out;
  for (Index run = 0; run < runs.count(); ++run) {
    const Index first = runs.begin[static_cast<std::size_t>(run)];
    const Index rows = runs.begin[static_cast<std::size_t>(run) + 1] - first;
    const Index pieces = std::max<Index>(1, rows / std::max<Index>(1, length));
    for (Index i = 0; i < pieces; ++i) {
      out.emplace_back(first + rows * i / pieces, first + rows * (i + 1) / pieces);
    }
  }
  return out;
}

ScoreTest score_test(const std::vector<Matrix>& candidates, Index draws, std::uint64_t seed,
                     Token* token) {
  ScoreTest out;
  out.p_value = std::numeric_limits<double>::quiet_NaN();
  if (candidates.empty()) return out;
  out.blocks = candidates.front().rows();
  // Each set in coordinates where S'S is the identity: the statistic is then a squared length.
  std::vector<Matrix> white;
  white.reserve(candidates.size());
  for (const Matrix& set : candidates) {
    const Vector norms = set.colwise().norm().transpose().cwiseMax(1e-300);
    const Matrix unit = set * norms.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(unit.transpose() * unit);
    const Vector& values = solver.eigenvalues();
    const double least = 1e-10 * values.maxCoeff();
    Vector scale(values.size());
    for (Index i = 0; i < values.size(); ++i) {
      scale[i] = values[i] > least && values[i] > 0.0 ? 1.0 / std::sqrt(values[i]) : 0.0;
    }
    white.emplace_back(unit * solver.eigenvectors() * scale.asDiagonal());
  }
  const auto largest = [&](const Vector& signs, Index* best) {
    double most = -1.0;
    for (std::size_t i = 0; i < white.size(); ++i) {
      const double value = (white[i].transpose() * signs).squaredNorm();
      if (value <= most) continue;
      most = value;
      if (best != nullptr) *best = static_cast<Index>(i);
    }
    return most;
  };
  out.statistic = largest(Vector::Ones(out.blocks), &out.best);
  if (out.blocks < kLeastBlocks) return out;
  Index beyond = 0;
  Vector signs(out.blocks);
  for (Index draw = 0; draw < draws; ++draw) {
    Random random(seed, kSignStream + static_cast<std::uint64_t>(draw));
    for (Index b = 0; b < out.blocks; ++b) signs[b] = (random.bits() & 1u) != 0 ? 1.0 : -1.0;
    if (largest(signs, nullptr) >= out.statistic * (1.0 - 1e-12)) ++beyond;
    if (draw % 256 == 0) step(token, 0.9);
  }
  out.p_value = static_cast<double>(1 + beyond) / static_cast<double>(1 + draws);
  return out;
}

}  // namespace ulna
