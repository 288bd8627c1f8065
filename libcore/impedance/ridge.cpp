#include "impedance/ridge.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace ulna {
namespace {

constexpr Index kFolds = 5;

}  // namespace

Ridge ridge_fit(const Matrix& columns, const Vector& y, const Matrix& shape, double fixed) {
  const Index rows = columns.rows();
  const Index p = columns.cols();
  std::vector<Matrix> grams;
  std::vector<Vector> rights;
  std::vector<double> squares;
  Matrix gram = Matrix::Zero(p, p);
  Vector right = Vector::Zero(p);
  for (Index fold = 0; fold < kFolds; ++fold) {
    const Index first = rows * fold / kFolds;
    const Index count = rows * (fold + 1) / kFolds - first;
    const auto part = columns.middleRows(first, count);
    grams.emplace_back(part.transpose() * part);
    rights.emplace_back(part.transpose() * y.segment(first, count));
    squares.push_back(y.segment(first, count).squaredNorm());
    gram += grams.back();
    right += rights.back();
  }
  Ridge out;
  out.penalty = fixed;
  if (fixed < 0.0) {
    double best = std::numeric_limits<double>::infinity();
    for (int half = -20; half <= 2; ++half) {
      const double penalty = std::pow(10.0, 0.5 * half);
      double missed = 0.0;
      for (std::size_t fold = 0; fold < grams.size(); ++fold) {
        const Matrix others =
            gram - grams[fold] + 0.8 * penalty * static_cast<double>(rows) * shape;
        const Vector theta = others.ldlt().solve(right - rights[fold]);
        missed += squares[fold] - 2.0 * theta.dot(rights[fold]) + theta.dot(grams[fold] * theta);
      }
      if (std::isfinite(missed) && missed < best) {
        best = missed;
        out.penalty = penalty;
      }
    }
  }
  out.information = gram + out.penalty * static_cast<double>(rows) * shape;
  out.theta = out.information.ldlt().solve(right);
  return out;
}

Matrix ridge_shape(const Matrix& columns) {
  const Vector mean_square =
      (columns.colwise().squaredNorm().transpose() / static_cast<double>(columns.rows()));
  return mean_square.asDiagonal();
}

Matrix roughness(Index p) {
  Matrix out = Matrix::Zero(p, p);
  for (Index i = -1; i < p - 1; ++i) {
    Vector row = Vector::Zero(p);
    if (i >= 0) row[i] += 1.0;
    row[i + 1] -= 2.0;
    if (i + 2 < p) row[i + 2] += 1.0;
    out += row * row.transpose();
  }
  return out;
}

}  // namespace ulna
