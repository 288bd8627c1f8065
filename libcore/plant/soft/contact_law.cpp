#include "plant/soft/contact_law.hpp"

#include <Eigen/Cholesky>
#include <utility>

namespace ulna {

void ContactProblem::resize(Index contacts, Index outer) {
  stiffness.resize(contacts);
  penetration.resize(contacts);
  approach.resize(contacts, outer);
  mobility.resize(contacts, contacts);
  active.resize(static_cast<std::size_t>(contacts));
}

void ContactLaw::begin() {
  force_ = Vector::Zero(problem_.penetration.size());
  factor();
}

void ContactLaw::factor() {
  chosen_.clear();
  for (std::size_t i = 0; i < problem_.active.size(); ++i) {
    if (problem_.active[i] != 0) chosen_.push_back(static_cast<Index>(i));
  }
  const auto n = static_cast<Index>(chosen_.size());
  const Index outer = problem_.approach.cols();
  const Eigen::Map<const Matrix> mobility = std::as_const(problem_).mobility.view();
  system_.resize(n, n);
  Eigen::Map<Matrix> system = system_.view();
  Matrix right(n, outer + 1);
  // The factorisation reads the lower triangle and takes its place.
  for (Index b = 0; b < n; ++b) {
    const Index j = chosen_[static_cast<std::size_t>(b)];
    for (Index a = b; a < n; ++a) {
      system(a, b) = problem_.timestep * mobility(chosen_[static_cast<std::size_t>(a)], j);
    }
    system(b, b) += 1.0 / problem_.stiffness[j];
    right.row(b).head(outer) = problem_.approach.row(j);
    right(b, outer) = problem_.penetration[j];
  }
  if (n > 0) {
    Eigen::Ref<Matrix> place(system);
    Eigen::LLT<Eigen::Ref<Matrix>>(place).solveInPlace(right);
  }
  inverse_approach_ = right.leftCols(outer);
  inverse_penetration_ = right.col(outer);
}

void ContactLaw::condense(Vector& bias, Matrix& resistance, Index contacts) const {
  for (std::size_t a = 0; a < chosen_.size(); ++a) {
    if (contacts >= 0 && chosen_[a] >= contacts) break;
    const auto row = problem_.approach.row(chosen_[a]);
    const auto k = static_cast<Index>(a);
    bias.noalias() -= inverse_penetration_[k] * row.transpose();
    resistance.noalias() += problem_.timestep * row.transpose() * inverse_approach_.row(k);
  }
}

bool ContactLaw::settle(const Vector& velocity) {
  const double dt = problem_.timestep;
  const Vector active_force = inverse_penetration_ + dt * (inverse_approach_ * velocity);
  force_.setZero();
  for (std::size_t a = 0; a < chosen_.size(); ++a) {
    force_[chosen_[a]] = active_force[static_cast<Index>(a)];
  }
  const Eigen::Map<const Matrix> mobility = std::as_const(problem_).mobility.view();
  std::vector<char>& active = problem_.active;
  Vector after = problem_.penetration + dt * (problem_.approach * velocity);
  for (std::size_t a = 0; a < chosen_.size(); ++a) {
    after.noalias() -= dt * force_[chosen_[a]] * mobility.col(chosen_[a]);
  }
  bool changed = false;
  for (std::size_t i = 0; i < active.size(); ++i) {
    const auto k = static_cast<Index>(i);
    const bool pushes = active[i] != 0 ? force_[k] > 0.0 : after[k] > 0.0;
    if (pushes == (active[i] != 0)) continue;
    active[i] = pushes ? 1 : 0;
    changed = true;
  }
  if (changed) factor();
  return changed;
}

}  // namespace ulna
