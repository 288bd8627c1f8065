// Compression of a tissue between two flat plates, the way its stiffness is
// stated: the same elements as around the arm, a force that rises in steps and
// waits until everything has settled.
#pragma once

#include "base/token.hpp"
#include "plant/soft/tissue.hpp"

namespace ulna {

struct CompressionOptions {
  double largest_strain = 0.45;
  double first_force = 0.5;     // N
  double force_factor = 1.15;   // from one step of the ramp to the next
  double plate_mass = 0.4;      // kg
  double pad_stiffness = 1e8;   // of the contact, N/m for each m^2
  double settled_speed = 1e-7;  // of the plates, m/s
  double timestep = 0.02;       // s
  void check() const;           // throws Error (kArgument)
};

struct CompressionResult {
  double width = 0.0;  // between the plates before, m
  double area = 0.0;   // length times width of the tissue, m^2
  Vector force;        // on each plate, N
  Vector strain;       // of the width
  Vector stress;       // Pa
  Vector modulus;      // stress / strain, Pa
  Vector energy;       // largest rise of energy less work of the plates within a step
                       // of the ramp, J

  double modulus_at(double strain) const;  // between the points, Pa; throws Error outside them
};

// Plates on both sides of the tissue's third axis. Throws Error: kArgument,
// kAnalysis when it does not settle, kCancelled.
CompressionResult compress(const Tissue& tissue, const CompressionOptions& options = {},
                           Token* token = nullptr);

}  // namespace ulna
