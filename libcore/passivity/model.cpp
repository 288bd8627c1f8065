#include "passivity/model.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "impedance/ellipse.hpp"

namespace ulna {
namespace {

double smallest_symmetric_eigenvalue(const Matrix& matrix) {
  const Matrix symmetric = 0.5 * (matrix + matrix.transpose());
  return Eigen::SelfAdjointEigenSolver<Matrix>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()[0];
}

Answer sign_answer(double eigenvalue, const Matrix& matrix, double tolerance) {
  const double size = matrix.norm();
  if (size == 0.0) return Answer::kPassive;
  if (eigenvalue > tolerance * size) return Answer::kPassive;
  return eigenvalue < -tolerance * size ? Answer::kNotPassive : Answer::kUndecided;
}

}  // namespace

ModelMargins model_passivity(const Matrix& m, const Matrix& b, const Matrix& k,
                             double antisymmetry_threshold, double tolerance) {
  const Index n = m.rows();
  for (const auto* matrix : {&m, &b, &k}) {
    require(n >= 1 && matrix->rows() == n && matrix->cols() == n, "M",
            "M, B and K must be square and of one size");
    require(matrix->allFinite(), "M", "M, B and K must hold finite numbers");
  }
  require(antisymmetry_threshold >= 0.0, "antisymmetry_threshold",
          "the antisymmetry threshold must not be negative");
  ModelMargins out;
  out.m_min = smallest_symmetric_eigenvalue(m);
  out.b_min = smallest_symmetric_eigenvalue(b);
  out.k_min = smallest_symmetric_eigenvalue(k);
  out.antisymmetry_m = antisymmetry_of(m);
  out.antisymmetry_k = antisymmetry_of(k);
  out.m_symmetric = out.antisymmetry_m <= antisymmetry_threshold;
  out.k_symmetric = out.antisymmetry_k <= antisymmetry_threshold;
  // Rounding leaves an exactly singular matrix with antisymmetry 0 / 0: no antisymmetric part is
  // none.
  if ((m - m.transpose()).isZero(0.0)) out.m_symmetric = true;
  if ((k - k.transpose()).isZero(0.0)) out.k_symmetric = true;

  const Answer answers[] = {sign_answer(out.m_min, m, tolerance),
                            sign_answer(out.b_min, b, tolerance),
                            sign_answer(out.k_min, k, tolerance),
                            out.m_symmetric ? Answer::kPassive : Answer::kNotPassive,
                            out.k_symmetric ? Answer::kPassive : Answer::kNotPassive};
  const auto any = [&](Answer answer) {
    return std::find(std::begin(answers), std::end(answers), answer) != std::end(answers);
  };
  out.answer = any(Answer::kNotPassive)  ? Answer::kNotPassive
               : any(Answer::kUndecided) ? Answer::kUndecided
                                         : Answer::kPassive;
  const bool storage = answers[0] != Answer::kNotPassive && answers[2] != Answer::kNotPassive &&
                       out.m_symmetric && out.k_symmetric;
  out.excess = storage ? out.b_min : -kInfinity;
  return out;
}

}  // namespace ulna
