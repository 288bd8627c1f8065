#include "stats/anova.hpp"

#include <cmath>
#include <string>

#include "base/error.hpp"
#include "stats/beta.hpp"

namespace ulna {
namespace {

// levels x (levels - 1), orthonormal and orthogonal to the constant (Helmert).
Matrix helmert_contrasts(Index levels) {
  Matrix c = Matrix::Zero(levels, levels - 1);
  for (Index k = 0; k + 1 < levels; ++k) {
    const auto before = static_cast<double>(k + 1);
    const double scale = 1.0 / std::sqrt(before * (before + 1.0));
    c.col(k).head(k + 1).setConstant(scale);
    c(k + 1, k) = -before * scale;
  }
  return c;
}

Matrix averaging_column(Index levels) {
  return Matrix::Constant(levels, 1, 1.0 / std::sqrt(static_cast<double>(levels)));
}

// Cells x d: the Kronecker product of both factors' parts, the second runs fastest.
Matrix effect_contrasts(Index levels_first, Index levels_second, AnovaEffectKind kind) {
  const bool first = kind != AnovaEffectKind::kSecond;
  const bool second = kind != AnovaEffectKind::kFirst;
  const Matrix a = first ? helmert_contrasts(levels_first) : averaging_column(levels_first);
  const Matrix b = second ? helmert_contrasts(levels_second) : averaging_column(levels_second);
  Matrix c(a.rows() * b.rows(), a.cols() * b.cols());
  for (Index i = 0; i < a.rows(); ++i) {
    for (Index j = 0; j < a.cols(); ++j) {
      c.block(i * b.rows(), j * b.cols(), b.rows(), b.cols()) = a(i, j) * b;
    }
  }
  return c;
}

void check_cells(MatrixRef values, Index levels_first, Index levels_second, AnovaEffectKind kind) {
  require(values.rows() >= 2, "values",
          "the values have " + std::to_string(values.rows()) +
              " rows, an analysis of variance needs at least 2 subjects");
  require(levels_first >= 2, "levels_first", "the first factor needs at least 2 levels");
  require(levels_second >= 1, "levels_second",
          "the second factor needs at least 2 levels, or 1 where there is none");
  require(levels_second >= 2 || kind == AnovaEffectKind::kFirst, "effect",
          "with one factor there is only its own effect");
  require(levels_first <= values.cols() && levels_second <= values.cols() &&
              values.cols() == levels_first * levels_second,
          "values",
          "the values have " + std::to_string(values.cols()) + " columns, but the factors have " +
              std::to_string(levels_first) + " and " + std::to_string(levels_second) +
              " levels: give one column a combination");
  for (Index i = 0; i < values.rows(); ++i) {
    for (Index j = 0; j < values.cols(); ++j) {
      if (std::isfinite(values(i, j))) continue;
      const std::string where = "subject " + std::to_string(i) + ", column " + std::to_string(j);
      throw Error(Fault::kData, "values",
                  "the value of " + where +
                      " is no finite number: leave the subject out, every cell is needed",
                  where);
    }
  }
}

}  // namespace

AnovaEffect repeated_anova(MatrixRef values, Index levels_first, Index levels_second,
                           AnovaEffectKind kind) {
  check_cells(values, levels_first, levels_second, kind);
  const Matrix scores = values * effect_contrasts(levels_first, levels_second, kind);
  const auto n = static_cast<double>(scores.rows());
  const auto d = static_cast<double>(scores.cols());
  const Eigen::RowVectorXd mean = scores.colwise().mean();
  const Matrix spread = scores.rowwise() - mean;
  AnovaEffect out;
  out.sum_of_squares = n * mean.squaredNorm();
  out.error_sum_of_squares = spread.squaredNorm();
  out.dof = d;
  out.error_dof = d * (n - 1.0);
  // Below what rounding of the values leaves in their differences, there is no error to test
  // against.
  const double rounding = 1e-14 * values.norm();
  if (out.error_sum_of_squares <= rounding * rounding) {
    throw Error(Fault::kAnalysis, "values",
                "the subjects do not differ in this effect, so there is no variance to test it "
                "against: check that the rows are different subjects");
  }
  out.f = (out.sum_of_squares / out.dof) / (out.error_sum_of_squares / out.error_dof);
  const Matrix covariance = spread.transpose() * spread;  // times n - 1, which cancels below
  const double trace = covariance.trace();
  out.epsilon = trace * trace / (d * covariance.squaredNorm());
  out.p = f_tail(out.f, out.dof, out.error_dof);
  out.p_corrected = f_tail(out.f, out.epsilon * out.dof, out.epsilon * out.error_dof);
  out.partial_eta_squared = out.sum_of_squares / (out.sum_of_squares + out.error_sum_of_squares);
  return out;
}

double f_tail(double f, double dof, double error_dof) {
  require(dof > 0.0 && error_dof > 0.0 && std::isfinite(dof) && std::isfinite(error_dof), "dof",
          "degrees of freedom must be positive and finite");
  if (std::isnan(f)) return kNaN;
  if (f <= 0.0) return 1.0;
  if (std::isinf(f)) return 0.0;
  // Of both forms the one whose argument is not the rounded complement of a small number.
  const double a = 0.5 * dof;
  const double b = 0.5 * error_dof;
  const double share = dof * f / (error_dof + dof * f);
  if (share < (a + 1.0) / (a + b + 2.0)) return 1.0 - beta_regularised(a, b, share);
  return beta_regularised(b, a, error_dof / (error_dof + dof * f));
}

}  // namespace ulna
