#include "plant/soft/compression.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "plant/soft/contact_law.hpp"

namespace ulna {
namespace {

constexpr int kLongest = 20000;  // time steps of one step of the ramp

class CompressionRig {
 public:
  CompressionRig(const Tissue& tissue, const CompressionOptions& options)
      : tissue_(tissue),
        options_(options),
        step_(tissue, options.timestep),
        displacement_(Vector::Zero(tissue.size())),
        rate_(Vector::Zero(tissue.size())),
        height_(tissue.mesh().semi_axes().z()) {}

  double height() const { return height_; }  // of each plate over the centre, m
  double rise() const { return rise_; }

  // Moves on until the plates stand under `force`.
  void settle(double force) {
    rise_ = -kInfinity;
    speed_ = 0.0;
    for (int i = 0; i < kLongest; ++i) {
      const double before = energy();
      const double height = height_;
      advance(force);
      const double work = 2.0 * force * (height - height_);
      rise_ = std::max(rise_, energy() - before - work);
      if (std::fabs(speed_) < options_.settled_speed) return;
    }
    throw Error(Fault::kAnalysis, "settled_speed",
                "the tissue did not settle under " + std::to_string(force) + " N");
  }

 private:
  struct Touch {
    int element;
    double slope;  // of its direction on the plates' axis
    double depth;
  };

  std::vector<Touch> touches() const {
    std::vector<Touch> found;
    for (int i = 0; i < tissue_.size(); ++i) {
      const double slope = std::fabs(tissue_.mesh().direction(i).z());
      const double depth = slope * (tissue_.mesh().radius(i) + displacement_[i]) - height_;
      if (slope > 1e-6 && depth > -0.02) found.push_back({i, slope, depth});
    }
    return found;
  }

  // Two plates of one speed outwards; both are pushed in by the force.
  void advance(double force) {
    const double dt = options_.timestep;
    const std::vector<Touch> found = touches();
    const Vector free = step_.free_rate(displacement_, rate_);
    const auto n = static_cast<Index>(found.size());
    ContactProblem& problem = law_.problem();
    problem.timestep = dt;
    problem.resize(n, 1);
    problem.approach.setConstant(-1.0);
    Eigen::Map<Matrix> mobility = problem.mobility.view();
    for (Index a = 0; a < n; ++a) {
      const Touch& t = found[static_cast<std::size_t>(a)];
      problem.stiffness[a] = options_.pad_stiffness * tissue_.mesh().area(t.element);
      problem.penetration[a] = t.depth + dt * t.slope * free[t.element];
      problem.active[static_cast<std::size_t>(a)] = t.depth > 0.0 ? 1 : 0;
      for (Index b = 0; b < n; ++b) {
        const Touch& u = found[static_cast<std::size_t>(b)];
        mobility(a, b) = t.slope * u.slope * step_.compliance()(t.element, u.element);
      }
    }
    law_.begin();
    const double mass = 2.0 * options_.plate_mass / dt;
    Vector speed(1);
    for (int i = 0; i < 50; ++i) {
      Vector bias = Vector::Zero(1);
      Matrix resistance = Matrix::Zero(1, 1);
      law_.condense(bias, resistance);
      speed[0] = (mass * speed_ - 2.0 * force + bias[0]) / (mass + resistance(0, 0));
      if (!law_.settle(speed)) break;
    }
    rate_ = free;
    for (Index a = 0; a < n; ++a) {
      const Touch& t = found[static_cast<std::size_t>(a)];
      rate_.noalias() -= law_.force()[a] * t.slope * step_.compliance().col(t.element);
    }
    displacement_ += dt * rate_;
    speed_ = speed[0];
    height_ += dt * speed_;
  }

  double energy() const {
    double energy = tissue_.energy(displacement_, rate_) + options_.plate_mass * speed_ * speed_;
    for (const Touch& t : touches()) {
      const double k = options_.pad_stiffness * tissue_.mesh().area(t.element);
      energy += 0.5 * k * std::pow(std::max(t.depth, 0.0), 2);
    }
    return energy;
  }

  const Tissue& tissue_;
  CompressionOptions options_;
  TissueStep step_;
  ContactLaw law_;
  Vector displacement_;
  Vector rate_;
  double height_;
  double speed_ = 0.0;
  double rise_ = 0.0;
};

Vector vector_of(const std::vector<double>& values) {
  return Eigen::Map<const Vector>(values.data(), static_cast<Index>(values.size()));
}

}  // namespace

void CompressionOptions::check() const {
  require(largest_strain > 0.0 && largest_strain < 0.9, "largest_strain",
          "the largest strain must be above 0 and below 0.9");
  require(std::isfinite(first_force) && first_force > 0.0, "first_force",
          "the first force must be positive");
  require(force_factor > 1.001 && force_factor <= 10.0, "force_factor",
          "the force must rise by a factor between 1.001 and 10");
  require(std::isfinite(plate_mass) && plate_mass > 0.0, "plate_mass",
          "the plates must have a positive mass");
  require(std::isfinite(pad_stiffness) && pad_stiffness > 0.0, "pad_stiffness",
          "the contact's stiffness must be positive");
  require(std::isfinite(settled_speed) && settled_speed > 0.0, "settled_speed",
          "the speed at which the tissue counts as settled must be positive");
  require(timestep > 0.0 && timestep <= 1.0, "timestep_s",
          "the time step must be between 0 and 1 s");
}

double CompressionResult::modulus_at(double at) const {
  for (Index i = 1; i < strain.size(); ++i) {
    if (strain[i - 1] > at || strain[i] < at) continue;
    const double share = (at - strain[i - 1]) / (strain[i] - strain[i - 1]);
    return (1.0 - share) * modulus[i - 1] + share * modulus[i];
  }
  throw Error(Fault::kArgument, "strain", "the tissue was not compressed to that strain");
}

CompressionResult compress(const Tissue& tissue, const CompressionOptions& options, Token* token) {
  options.check();
  CompressionRig rig(tissue, options);
  const Vector3& half = tissue.mesh().semi_axes();
  CompressionResult result;
  result.width = 2.0 * half.z();
  result.area = 2.0 * half.x() * 2.0 * half.y();
  std::vector<double> force, strain, rise;
  double load = options.first_force;
  while (strain.empty() || strain.back() < options.largest_strain) {
    rig.settle(load);
    force.push_back(load);
    strain.push_back(1.0 - rig.height() / half.z());
    rise.push_back(rig.rise());
    step(token, std::min(1.0, strain.back() / options.largest_strain));
    load *= options.force_factor;
    if (rig.height() > 0.0) continue;
    throw Error(Fault::kAnalysis, "force_factor",
                "the plates met before the largest strain: let the force rise "
                "in smaller steps");
  }
  result.force = vector_of(force);
  result.strain = vector_of(strain);
  result.energy = vector_of(rise);
  result.stress = result.force / result.area;
  result.modulus = result.stress.cwiseQuotient(result.strain);
  return result;
}

}  // namespace ulna
