#include "plant/soft/tissue.hpp"

#include <cmath>

#include "base/error.hpp"

namespace ulna {

TissueOptions TissueOptions::upper_arm() { return {}; }

TissueOptions TissueOptions::forearm() {
  TissueOptions options;
  options.semi_axes = Vector3(0.08, 0.03, 0.03);
  options.counts = {9, 4, 4};
  options.standard = 116;
  return options;
}

void TissueOptions::check() const {
  const auto positive = [](double value, const char* argument, const char* message) {
    require(std::isfinite(value) && value > 0.0, argument, message);
  };
  positive(stiffness, "stiffness", "the tissue's stiffness must be positive");
  positive(element_mass, "element_mass", "the tissue's element mass must be positive");
  require(std::isfinite(viscosity) && viscosity >= 0.0, "viscosity",
          "the tissue's viscosity must be 0 or more");
  require(std::isfinite(neighbour) && neighbour >= 0.0, "neighbour",
          "the tissue's neighbour stiffness must be 0 or more");
  require(std::isfinite(volume) && volume >= 0.0, "volume",
          "the tissue's volume stiffness must be 0 or more");
  require(standard >= 1, "standard", "the standard number of elements must be 1 or more");
}

namespace {

const TissueOptions& checked_tissue(const TissueOptions& options) {
  options.check();
  return options;
}

}  // namespace

Tissue::Tissue(const TissueOptions& options)
    : options_(checked_tissue(options)), mesh_(options.semi_axes, options.counts) {
  const int n = mesh_.size();
  Vector share(n);  // how many standard elements each element stands for
  Vector rate(n);
  const double one = mesh_.surface() / options.standard;
  for (int i = 0; i < n; ++i) {
    share[i] = mesh_.area(i) / one;
    rate[i] = mesh_.volume_rate(i) / one;
  }
  // Springs between neighbours on a square grid are a membrane whose tension is their stiffness.
  Matrix shape = options.neighbour * mesh_.laplacian();
  shape.diagonal() += share;
  damping_ = options.viscosity * shape;
  stiffness_ = options.stiffness * (shape + options.volume * rate * rate.transpose());
  mass_ = options.element_mass * share;
}

double Tissue::energy(const Vector& displacement, const Vector& rate) const {
  return 0.5 * displacement.dot(stiffness_ * displacement) +
         0.5 * rate.dot(mass_.cwiseProduct(rate));
}

TissueStep::TissueStep(const Tissue& tissue, double timestep) : timestep_(timestep) {
  require(std::isfinite(timestep) && timestep > 0.0, "timestep_s",
          "the time step must be positive");
  Matrix system = tissue.damping() + timestep * tissue.stiffness();
  system.diagonal() += tissue.mass() / timestep;
  compliance_ = system.llt().solve(Matrix::Identity(tissue.size(), tissue.size()));
  of_displacement_ = -compliance_ * tissue.stiffness();
  of_rate_ = compliance_ * (tissue.mass() / timestep).asDiagonal();
}

Vector TissueStep::free_rate(const Vector& displacement, const Vector& rate) const {
  Vector free = of_rate_ * rate;
  free.noalias() += of_displacement_ * displacement;
  return free;
}

}  // namespace ulna
