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

namespace {

// Of an ellipsoid, within 1.1 % (Thomsen's formula): exact enough for a ratio
// of two alike.
double ellipsoid_surface(const Vector3& axes) {
  constexpr double kPower = 1.6075;
  const double a = std::pow(axes.x(), kPower), b = std::pow(axes.y(), kPower),
               c = std::pow(axes.z(), kPower);
  return 4.0 * kPi * std::pow((a * b + a * c + b * c) / 3.0, 1.0 / kPower);
}

// Elements slide along rays from the centre, which meet the surface of a long
// ellipsoid at a slant: pressed across the limb it is stiffer by the mean of 1
// / cos^2 of that slant over what is pressed, about 1 + <x^2> / <z^2>. Factor and
// power are those of compressions to strains of 0.3: with them upper arms of 0.08
// to 0.12 m and forearms of 0.08 to 0.14 m have the same modulus within 10 %.
double slant_stiffening(const Vector3& axes) {
  const double slender = 2.0 * axes.x() / (axes.y() + axes.z());
  return 1.0 + 0.1306 * std::pow(slender, 2.2);
}

}  // namespace

TissueOptions TissueOptions::of_half_length(double half_length) const {
  TissueOptions other = *this;
  other.semi_axes.x() = half_length;
  const double larger = ellipsoid_surface(other.semi_axes) / ellipsoid_surface(semi_axes);
  const double straight = slant_stiffening(semi_axes) / slant_stiffening(other.semi_axes);
  other.standard = static_cast<int>(std::lround(standard * larger * straight));
  other.volume = volume / larger;  // a pressure comes of the volume's relative change
  return other;
}

double TissueOptions::foundation() const {
  return stiffness * standard / ellipsoid_surface(semi_axes);
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
  // Springs between neighbours on a square grid are a membrane whose tension is
  // their stiffness.
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
