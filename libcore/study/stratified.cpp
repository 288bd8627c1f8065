#include "study/stratified.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>

namespace ulna {
namespace {

constexpr Index kStrataDegree = 6;
constexpr Index kBlocksPerTerm = 10;
constexpr Index kHeldNumbers = Index{1} << 25;  // held: 256 MiB
constexpr Index kStrataChunk = 1024;

// Orthonormal Legendre polynomials of degrees 1 ... degree of each coordinate, coordinate after
// coordinate.
void fill_strata_basis(const PointRows& at, Index degree, Matrix& out) {
  out.resize(at.rows(), at.cols() * degree);
  for (Index i = 0; i < at.rows(); ++i) {
    for (Index k = 0; k < at.cols(); ++k) {
      const double t = 2.0 * at(i, k) - 1.0;
      double before = 1.0;
      double now = t;
      for (Index d = 1; d <= degree; ++d) {
        const auto n = static_cast<double>(d);
        out(i, k * degree + d - 1) = now * std::sqrt(2.0 * n + 1.0);
        const double next = ((2.0 * n + 1.0) * t * now - n * before) / (n + 1.0);
        before = now;
        now = next;
      }
    }
  }
}

}  // namespace

BlockFeatures without_strata(const BlockFeatures& blocks, const Vector& mean, Token* token) {
  if (blocks.coordinates == 0) return blocks;
  const Index n = blocks.blocks;
  const Index degree = std::min(kStrataDegree, n / (kBlocksPerTerm * blocks.coordinates));
  if (degree < 1 || blocks.features > kHeldNumbers / n) return blocks;
  const Index terms = blocks.coordinates * degree;

  auto held = std::make_shared<Matrix>(n, blocks.features);
  Matrix normal = Matrix::Zero(terms, terms);
  Matrix right = Matrix::Zero(terms, blocks.features);
  PointRows at;
  Matrix basis;
  const auto basis_of = [&](Index begin, Index rows) {
    step(token, 0.0);
    at.resize(rows, blocks.coordinates);
    blocks.fill_coordinates(begin, at);
    fill_strata_basis(at, degree, basis);
  };
  for (Index begin = 0; begin < n; begin += kStrataChunk) {
    const Index rows = std::min(kStrataChunk, n - begin);
    auto part = held->middleRows(begin, rows);
    blocks.fill(begin, part);
    part.rowwise() -= mean.transpose();
    basis_of(begin, rows);
    normal.noalias() += basis.transpose() * basis;
    right.noalias() += basis.transpose() * part;
  }
  const Matrix fit = normal.ldlt().solve(right);
  // As many degrees of freedom as terms are gone from the residuals.
  const double widen = std::sqrt(static_cast<double>(n) / static_cast<double>(n - terms));
  for (Index begin = 0; begin < n; begin += kStrataChunk) {
    const Index rows = std::min(kStrataChunk, n - begin);
    auto part = held->middleRows(begin, rows);
    basis_of(begin, rows);
    part.noalias() -= basis * fit;
    part *= widen;
    part.rowwise() += mean.transpose();
  }
  BlockFeatures out = blocks;
  out.coordinates = 0;
  out.fill = [held](Index first, Eigen::Ref<Matrix> to) {
    to = held->middleRows(first, to.rows());
  };
  return out;
}

}  // namespace ulna
