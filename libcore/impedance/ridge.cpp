#include "impedance/ridge.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

namespace ulna {
namespace {

constexpr Index kFolds = 5;
constexpr Index kPenalties = 27;

}  // namespace

Ridge ridge_fit(const Matrix& columns, const Vector& y, const Matrix& shape, Token* token,
                const Matrix& base, double least) {
  Token part(token);
  const Index rows = columns.rows();
  const Index p = columns.cols();
  std::vector<Matrix> grams;
  std::vector<Vector> rights;
  Vector squares(kFolds);
  Matrix gram = Matrix::Zero(p, p);
  Vector right = Vector::Zero(p);
  for (Index fold = 0; fold < kFolds; ++fold) {
    const Index first = rows * fold / kFolds;
    const Index count = rows * (fold + 1) / kFolds - first;
    step(&part, 0.0);
    const auto some = columns.middleRows(first, count);
    grams.emplace_back(some.transpose() * some);
    rights.emplace_back(some.transpose() * y.segment(first, count));
    squares[fold] = y.segment(first, count).squaredNorm();
    gram += grams.back();
    right += rights.back();
  }
  const auto penalty_at = [&](Index k) {
    return least * std::pow(10.0, 0.5 * static_cast<double>(k));
  };
  const auto penalised = [&](double penalty) {
    Matrix out = penalty * shape;
    if (base.size() > 0) out += base;
    return Matrix(static_cast<double>(rows) * out);
  };
  Matrix missed(kFolds, kPenalties);
  for (Index k = 0; k < kPenalties; ++k) {
    const Matrix more = 0.8 * penalised(penalty_at(k));  // four parts of five
    for (Index fold = 0; fold < kFolds; ++fold) {
      step(&part, 0.0);
      const auto f = static_cast<std::size_t>(fold);
      const Vector theta = (gram - grams[f] + more).ldlt().solve(right - rights[f]);
      const double error = squares[fold] - 2.0 * theta.dot(rights[f]) + theta.dot(grams[f] * theta);
      missed(fold, k) = std::isfinite(error) ? error : kInfinity;
    }
  }
  Index best = 0;
  missed.colwise().sum().minCoeff(&best);
  Index chosen = kPenalties - 1;
  for (; chosen > best; --chosen) {
    const Vector worse = missed.col(chosen) - missed.col(best);
    const double mean = worse.mean();
    const double error = std::sqrt((worse.array() - mean).square().sum() /
                                   static_cast<double>(kFolds * (kFolds - 1)));
    if (mean <= error) break;
  }
  Ridge out;
  out.penalty = penalty_at(chosen);
  out.information = gram + penalised(out.penalty);
  const Eigen::LDLT<Matrix> factor(out.information);
  out.theta = factor.solve(right);
  out.rank = factor.solve(gram).trace();
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
