#include "impedance/separable.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

namespace ulna {
namespace {

constexpr double kStep = 1e-3;                            // of the scale, for differences
constexpr double kSmallStep = 1e-7;                       // of the scale: nothing moves any more
constexpr double kSmallGain = 1e-13, kCoarseGain = 1e-6;  // of the cost
constexpr double kLargestDamping = 1e12;

// From the residual already at hand, inwards at the upper bound.
Matrix forward_jacobian(const BoxProblem& problem, const Vector& at, const Vector& residual) {
  Matrix out = Matrix::Zero(residual.size(), at.size());
  for (Index k = 0; k < at.size(); ++k) {
    Vector moved = at;
    moved[k] += kStep * problem.scale[k];
    if (moved[k] > problem.high[k])
      moved[k] = std::max(problem.low[k], at[k] - kStep * problem.scale[k]);
    if (moved[k] == at[k]) continue;
    out.col(k) = (problem.residual(moved) - residual) / (moved[k] - at[k]);
  }
  return out;
}

}  // namespace

Matrix residual_jacobian(const BoxProblem& problem, const Vector& at) {
  Matrix out;
  for (Index k = 0; k < at.size(); ++k) {
    Vector up = at;
    Vector down = at;
    up[k] = std::min(problem.high[k], at[k] + kStep * problem.scale[k]);
    down[k] = std::max(problem.low[k], at[k] - kStep * problem.scale[k]);
    const double width = up[k] - down[k];
    if (width <= 0.0 && out.size() > 0) {
      out.col(k).setZero();
      continue;
    }
    const Vector difference = problem.residual(up) - problem.residual(down);
    if (out.size() == 0) out.resize(difference.size(), at.size());
    out.col(k) = width > 0.0 ? Vector(difference / width) : Vector::Zero(difference.size());
  }
  return out;
}

BoxSolution minimise_in_box(const BoxProblem& problem, const Vector& start, Effort effort,
                            int iterations) {
  const double gain = effort == Effort::kFine ? kSmallGain : kCoarseGain;
  BoxSolution out;
  out.parameters = start.cwiseMax(problem.low).cwiseMin(problem.high);
  Vector residual = problem.residual(out.parameters);
  out.cost = residual.squaredNorm();
  double damping = 1e-3;
  const Index n = start.size();
  for (int iteration = 0; iteration < iterations && n > 0; ++iteration) {
    const Matrix jacobian =
        (effort == Effort::kFine ? residual_jacobian(problem, out.parameters)
                                 : forward_jacobian(problem, out.parameters, residual)) *
        problem.scale.asDiagonal();
    const Vector gradient = jacobian.transpose() * residual;
    Matrix hessian = jacobian.transpose() * jacobian;
    std::vector<bool> held(static_cast<std::size_t>(n), false);
    for (Index k = 0; k < n; ++k) {
      const bool at_low = out.parameters[k] <= problem.low[k] && gradient[k] > 0.0;
      const bool at_high = out.parameters[k] >= problem.high[k] && gradient[k] < 0.0;
      held[static_cast<std::size_t>(k)] = at_low || at_high;
    }
    bool moved = false;
    while (damping < kLargestDamping) {
      Matrix damped = hessian;
      Vector right = -gradient;
      for (Index k = 0; k < n; ++k) {
        damped(k, k) += damping * std::max(hessian(k, k), 1e-300);
        if (!held[static_cast<std::size_t>(k)]) continue;
        damped.row(k).setZero();
        damped.col(k).setZero();
        damped(k, k) = 1.0;
        right[k] = 0.0;
      }
      const Vector change = damped.ldlt().solve(right);
      Vector next = out.parameters + problem.scale.cwiseProduct(change);
      next = next.cwiseMax(problem.low).cwiseMin(problem.high);
      const double size = (next - out.parameters).cwiseQuotient(problem.scale).norm();
      if (!(size > kSmallStep)) {
        out.converged = true;
        return out;
      }
      const Vector trial = problem.residual(next);
      ++out.evaluations;
      const double cost = trial.squaredNorm();
      if (std::isfinite(cost) && cost < out.cost) {
        const bool done = out.cost - cost < gain * out.cost;
        out.parameters = next;
        residual = trial;
        out.cost = cost;
        damping = std::max(1e-9, damping * 0.1);
        moved = true;
        if (done) {
          out.converged = true;
          return out;
        }
        break;
      }
      damping *= 10.0;
    }
    if (!moved) {  // no shorter step helps: the minimum to rounding
      out.converged = true;
      return out;
    }
  }
  out.converged = n == 0;
  return out;
}

}  // namespace ulna
