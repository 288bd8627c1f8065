// Soft tissue: elements on an ellipsoid that slide along their radius, held by
// springs and dampers to the centre, to their neighbours, and by their common
// volume. All stiffness is true (N/m) and spread over the surface, so that
// neither the number of elements nor their mass changes it. Elements do not
// touch each other.
#pragma once

#include <Eigen/Cholesky>

#include "plant/soft/tissue_mesh.hpp"

namespace ulna {

struct TissueOptions {
  Vector3 semi_axes = Vector3(0.08, 0.04, 0.04);  // first along the limb, m
  std::array<int, 3> counts = {9, 5, 5};
  double stiffness = 537.5;     // of an element to the centre, N/m, where there are
                                // `standard` ones
  double viscosity = 10.0;      // of such an element, N s/m
  int standard = 162;           // number of elements that stiffness and viscosity are quoted for
  double neighbour = 0.7;       // stiffness of the surface, of `stiffness`
  double volume = 0.003;        // stiffness of the volume, of `stiffness`
  double element_mass = 0.003;  // of one of the standard elements, kg: inertia of sliding only

  static TissueOptions upper_arm();
  static TissueOptions forearm();
  // The same tissue around a longer or shorter piece of the limb, with the same
  // modulus when it is compressed across the limb.
  TissueOptions of_half_length(double half_length) const;
  double foundation() const;  // stiffness to the centre for each area of the surface, N/m^3
  void check() const;         // throws Error (kArgument)
};

class Tissue {
 public:
  explicit Tissue(const TissueOptions& options);

  const TissueOptions& options() const { return options_; }
  const TissueMesh& mesh() const { return mesh_; }
  int size() const { return mesh_.size(); }

  // Forces of the springs for radial displacements (outward, m) are
  // -stiffness() s, of the dampers -damping() ds/dt.
  const Matrix& stiffness() const { return stiffness_; }  // N/m
  const Matrix& damping() const { return damping_; }      // N s/m
  const Vector& mass() const { return mass_; }            // kg

  double energy(const Vector& displacement, const Vector& rate) const;  // J

 private:
  TissueOptions options_;
  TissueMesh mesh_;
  Matrix stiffness_;
  Matrix damping_;
  Vector mass_;
};

// One time step of a tissue by the implicit Euler rule, with contacts left
// open: rate after = free rate + compliance x forces on the elements.
class TissueStep {
 public:
  TissueStep(const Tissue& tissue, double timestep);

  double timestep() const { return timestep_; }
  const Matrix& compliance() const { return compliance_; }  // m/(s N)
  Vector free_rate(const Vector& displacement, const Vector& rate) const;

 private:
  double timestep_;
  Matrix compliance_;
  Matrix of_displacement_;
  Matrix of_rate_;
};

}  // namespace ulna
