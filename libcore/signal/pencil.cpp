#include "signal/pencil.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

template <class M>
void balance_any(M& a) {
  const Index n = a.rows();
  for (int sweep = 0; sweep < 40; ++sweep) {
    bool changed = false;
    for (Index i = 0; i < n; ++i) {
      const double own = std::abs(a(i, i));
      double column = a.col(i).cwiseAbs().sum() - own;
      const double row = a.row(i).cwiseAbs().sum() - own;
      // An underflow to zero cannot be told from a zero: neither can be balanced.
      if (!(column > 0.0) || !(row > 0.0)) continue;
      const int shift = static_cast<int>(std::lround(0.5 * (std::log2(row) - std::log2(column))));
      if (shift == 0) continue;
      const double f = std::ldexp(1.0, shift);
      if (column * f + row / f > 0.95 * (column + row)) continue;
      a.col(i) *= f;
      a.row(i) /= f;
      changed = true;
    }
    if (!changed) return;
  }
}

// Rows and columns of the pencil to about unit size: neither moves an eigenvalue.
void equilibrate(Matrix& a, Matrix& e, double scale) {
  for (int sweep = 0; sweep < 4; ++sweep) {
    const Matrix size = a.cwiseAbs() + scale * e.cwiseAbs();
    for (Index i = 0; i < a.rows(); ++i) {
      const double row = size.row(i).maxCoeff();
      if (!(row > 0.0)) continue;
      const double f = std::exp2(-std::round(std::log2(row)));
      a.row(i) *= f;
      e.row(i) *= f;
    }
    const Matrix next = a.cwiseAbs() + scale * e.cwiseAbs();
    for (Index i = 0; i < a.cols(); ++i) {
      const double column = next.col(i).maxCoeff();
      if (!(column > 0.0)) continue;
      const double f = std::exp2(-std::round(std::log2(column)));
      a.col(i) *= f;
      e.col(i) *= f;
    }
  }
}

// What is left of K when its eigenvalues at zero are taken out, each Jordan chain link by link.
Matrix without_zero_eigenvalues(Matrix k, double size) {
  while (k.rows() > 0) {
    const Eigen::JacobiSVD<Matrix> svd(k, Eigen::ComputeFullV);
    // Links of a chain are zero to the rounding of the inverse that made K.
    const double limit = 1e-12 * static_cast<double>(k.rows()) * size;
    const Index null = (svd.singularValues().array() <= limit).count();
    if (null == 0) return k;
    const Index rest = k.rows() - null;
    const Matrix keep = svd.matrixV().leftCols(rest);
    k = Matrix(keep.transpose() * k * keep);
  }
  return k;
}

double typical(const Matrix& m) {
  double sum = 0.0;
  Index count = 0;
  for (Index i = 0; i < m.size(); ++i) {
    if (m.data()[i] == 0.0) continue;
    sum += std::log(std::abs(m.data()[i]));
    ++count;
  }
  return count == 0 ? 0.0 : std::exp(sum / static_cast<double>(count));
}

}  // namespace

void balance(Matrix& a) { balance_any(a); }
void balance(Eigen::MatrixXcd& a) { balance_any(a); }

std::vector<Complex> eigenvalues(Matrix a) {
  if (a.rows() == 0) return {};
  balance(a);
  const Eigen::EigenSolver<Matrix> solver(a, false);
  if (solver.info() != Eigen::Success) {
    throw Error(Fault::kAnalysis, "system", "the eigenvalues of the system did not converge");
  }
  // Zero to the rounding of the matrix is zero: poles and zeros at the origin are structure.
  const double zero = 1e-15 * static_cast<double>(a.rows()) * a.norm();
  std::vector<Complex> out;
  for (const Complex value : solver.eigenvalues()) {
    out.push_back(std::abs(value) <= zero ? Complex(0.0) : value);
  }
  return out;
}

std::optional<std::vector<Complex>> finite_eigenvalues(const Matrix& a_given,
                                                       const Matrix& e_given) {
  if (e_given.size() == 0) return eigenvalues(a_given);
  if (a_given.rows() == 0) return std::vector<Complex>{};
  Matrix a = a_given;
  Matrix e = e_given;
  const double e_size = typical(e);
  const double a_size = typical(a);
  const double scale = e_size > 0.0 && a_size > 0.0 ? a_size / e_size : 1.0;
  equilibrate(a, e, scale);
  // A shift that is no eigenvalue; of a few, the one with the best conditioned A - s E.
  Eigen::FullPivLU<Matrix> best;
  double best_condition = -1.0;
  double shift = 0.0;
  for (const double factor : {0.37, -0.61, 1.9, -2.7, 0.083}) {
    const Eigen::FullPivLU<Matrix> lu(a - factor * scale * e);
    const auto pivots = lu.matrixLU().diagonal().cwiseAbs();
    const double condition = lu.maxPivot() > 0.0 ? pivots.minCoeff() / lu.maxPivot() : 0.0;
    if (condition > best_condition) {
      best_condition = condition;
      best = lu;
      shift = factor * scale;
    }
  }
  // A determinant that is zero everywhere leaves a pivot of rounding at each of the five shifts.
  if (best_condition < 1e-14 * static_cast<double>(a.rows())) return std::nullopt;
  const Matrix k = best.solve(scale * e);
  const double size = std::max(k.norm(), 1e-300);
  std::vector<Complex> out;
  for (const Complex mu : eigenvalues(without_zero_eigenvalues(k, size))) {
    if (std::abs(mu) == 0.0) continue;
    const Complex s = shift + scale / mu;
    out.push_back(std::abs(s) <= 1e-13 * std::abs(shift) ? Complex(0.0) : s);
  }
  return out;
}

}  // namespace ulna
