#include "ident/semidefinite.hpp"

#include <nlopt.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>

#include "base/error.hpp"

namespace ulna {
namespace {

Index triangle(Index size) { return size * (size + 1) / 2; }

Matrix lower_of(const Vector& values, Index first, Index size) {
  Matrix lower = Matrix::Zero(size, size);
  for (Index j = 0, k = first; j < size; ++j) {
    for (Index i = j; i < size; ++i) lower(i, j) = values[k++];
  }
  return lower;
}

Matrix symmetric_of(const Vector& values, const Cone& cone) {
  return lower_of(values, cone.first, cone.size).selfadjointView<Eigen::Lower>();
}

void put_lower(const Matrix& matrix, Index first, Vector& values) {
  for (Index j = 0, k = first; j < matrix.cols(); ++j) {
    for (Index i = j; i < matrix.rows(); ++i) values[k++] = matrix(i, j);
  }
}

struct Problem {
  const Matrix* h;
  const Vector* g;
  const std::vector<Cone>* cones;
  Vector unit;    // size of one step of each variable
  double offset;  // makes the value at the free minimum zero, so that relative tolerances mean
                  // something
  double scale;

  // The cones' entries of z hold the factor L; the others are the parameters themselves.
  Vector eta(const Vector& z) const {
    Vector values = z;
    for (const Cone& cone : *cones) {
      const Matrix lower = lower_of(z, cone.first, cone.size);
      put_lower(lower * lower.transpose(), cone.first, values);
    }
    return values;
  }

  double value_and_gradient(const Vector& y, double* gradient) const {
    const Vector z = y.cwiseProduct(unit);
    const Vector x = eta(z);
    const Vector slope = *h * x - *g;
    if (gradient != nullptr) {
      Vector dz = slope;
      for (const Cone& cone : *cones) {
        // d f / d L = 2 G L, where an off-diagonal parameter stands for two equal entries of S.
        Matrix full = lower_of(slope, cone.first, cone.size);
        const Matrix strict = full.triangularView<Eigen::StrictlyLower>();
        full = 0.5 * (strict + strict.transpose()) + Matrix(full.diagonal().asDiagonal());
        put_lower(2.0 * full * lower_of(z, cone.first, cone.size), cone.first, dz);
      }
      Eigen::Map<Vector>(gradient, dz.size()) = dz.cwiseProduct(unit) / scale;
    }
    return (0.5 * x.dot(*h * x) - g->dot(x) - offset) / scale;
  }
};

double evaluate(unsigned count, const double* y, double* gradient, void* data) {
  const auto* problem = static_cast<const Problem*>(data);
  return problem->value_and_gradient(Eigen::Map<const Vector>(y, static_cast<Index>(count)),
                                     gradient);
}

}  // namespace

SemidefiniteFit fit_semidefinite(const Matrix& h, const Vector& g, const std::vector<Cone>& cones) {
  SemidefiniteFit out;
  out.eta = h.ldlt().solve(g);
  Vector start = out.eta;
  Vector unit = out.eta.cwiseAbs().cwiseMax(1e-12);
  for (const Cone& cone : cones) {
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(symmetric_of(out.eta, cone));
    const double size = eigen.eigenvalues().cwiseAbs().maxCoeff();
    out.active = out.active || eigen.eigenvalues()[0] < 0.0;
    // Start from the projection, moved off the boundary where the factor's gradient would vanish.
    const Vector inside = eigen.eigenvalues().cwiseMax(1e-3 * std::max(size, 1e-12));
    const Matrix projected =
        eigen.eigenvectors() * inside.asDiagonal() * eigen.eigenvectors().transpose();
    put_lower(projected.llt().matrixL(), cone.first, start);
    unit.segment(cone.first, triangle(cone.size)).setConstant(std::sqrt(std::max(size, 1e-12)));
  }
  if (!out.active) return out;

  Problem problem{&h, &g, &cones, unit, 0.0, 1.0};
  problem.offset = -0.5 * g.dot(out.eta);
  problem.scale = std::max(problem.value_and_gradient(start.cwiseQuotient(unit), nullptr), 1e-300);

  const auto count = static_cast<unsigned>(g.size());
  const std::unique_ptr<nlopt_opt_s, decltype(&nlopt_destroy)> optimiser(
      nlopt_create(NLOPT_LD_SLSQP, count), &nlopt_destroy);
  if (!optimiser) throw Error(Fault::kMemory, "", "not enough memory for the constrained fit");
  nlopt_set_min_objective(optimiser.get(), evaluate, &problem);
  nlopt_set_ftol_rel(optimiser.get(), 1e-15);
  nlopt_set_xtol_rel(optimiser.get(), 1e-10);
  nlopt_set_maxeval(optimiser.get(), 5000);
  Vector y = start.cwiseQuotient(unit);
  double value = 0.0;
  const nlopt_result result = nlopt_optimize(optimiser.get(), y.data(), &value);
  // Round-off: no step improves any more, which at these tolerances is the minimum.
  out.converged =
      (result > 0 && result != NLOPT_MAXEVAL_REACHED) || result == NLOPT_ROUNDOFF_LIMITED;
  out.eta = problem.eta(y.cwiseProduct(unit));
  return out;
}

}  // namespace ulna
