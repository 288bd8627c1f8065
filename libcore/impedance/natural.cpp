#include "impedance/natural.hpp"

#include <Eigen/LU>

namespace ulna {
namespace {}  // namespace

Vector natural_of(const Matrix& theta, const Vector& position_mean) {
  const Index n = theta.cols();
  Vector out(natural_size(n));
  for (Index term = 0; term < 3; ++term) {
    out.segment(term * n * n, n * n) = theta.middleRows(term * n, n).reshaped();
  }
  const Eigen::FullPivLU<Matrix> stiffness(theta.middleRows(2 * n, n).transpose());
  if (stiffness.isInvertible()) {
    out.tail(n) = position_mean - stiffness.solve(theta.row(3 * n).transpose());
  } else {
    out.tail(n).setConstant(kNaN);
  }
  return out;
}

// x0 - x_mean = u solves K u = -c, so du = -K^-1 (dc + dK u).
Matrix natural_jacobian(const Matrix& theta) {
  const Index n = theta.cols();
  const Index p = theta.rows();
  Matrix jacobian = Matrix::Zero(natural_size(n), p * n);
  for (Index term = 0; term < 3; ++term) {
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) jacobian(term * n * n + i * n + j, i * p + term * n + j) = 1.0;
    }
  }
  const Matrix stiffness = theta.middleRows(2 * n, n).transpose();
  const Eigen::FullPivLU<Matrix> lu(stiffness);
  if (!lu.isInvertible()) {
    jacobian.bottomRows(n).setConstant(kNaN);
    return jacobian;
  }
  const Vector u = -lu.solve(theta.row(3 * n).transpose());
  const Matrix inverse = lu.inverse();
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      jacobian.block(3 * n * n, i * p + 2 * n + j, n, 1) = -inverse.col(i) * u[j];
    }
    jacobian.block(3 * n * n, i * p + 3 * n, n, 1) = -inverse.col(i);
  }
  return jacobian;
}

}  // namespace ulna
