#include "plant/soft/contact_law.hpp"

#include <Eigen/Cholesky>

namespace ulna {

ContactLaw::ContactLaw(ContactProblem problem, std::vector<char> active)
    : problem_(std::move(problem)), active_(std::move(active)) {
  force_ = Vector::Zero(problem_.penetration.size());
  factor();
}

void ContactLaw::factor() {
  chosen_.clear();
  for (std::size_t i = 0; i < active_.size(); ++i) {
    if (active_[i] != 0) chosen_.push_back(static_cast<Index>(i));
  }
  const auto n = static_cast<Index>(chosen_.size());
  const Index outer = problem_.approach.cols();
  Matrix system(n, n);
  Matrix right(n, outer + 1);
  for (Index a = 0; a < n; ++a) {
    const Index i = chosen_[static_cast<std::size_t>(a)];
    for (Index b = 0; b < n; ++b) {
      system(a, b) = problem_.timestep * problem_.mobility(i, chosen_[static_cast<std::size_t>(b)]);
    }
    system(a, a) += 1.0 / problem_.stiffness[i];
    right.row(a).head(outer) = problem_.approach.row(i);
    right(a, outer) = problem_.penetration[i];
  }
  if (n > 0) system.llt().solveInPlace(right);
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
  Vector after = problem_.penetration + dt * (problem_.approach * velocity);
  for (std::size_t a = 0; a < chosen_.size(); ++a) {
    after.noalias() -= dt * force_[chosen_[a]] * problem_.mobility.col(chosen_[a]);
  }
  bool changed = false;
  for (std::size_t i = 0; i < active_.size(); ++i) {
    const auto k = static_cast<Index>(i);
    const bool pushes = active_[i] != 0 ? force_[k] > 0.0 : after[k] > 0.0;
    if (pushes == (active_[i] != 0)) continue;
    active_[i] = pushes ? 1 : 0;
    changed = true;
  }
  if (changed) factor();
  return changed;
}

}  // namespace ulna
