// What an assessment with a reduced plant differs from one with the full plant:
// the report that says what the reduction costs.
#pragma once

#include <vector>

#include "base/types.hpp"

namespace ulna {

// Of one assessment of one joint. Not a number: the run gave none.
struct PlantOutcome {
  double k = kNaN;           // estimated stiffness, N m/rad
  double d = kNaN;           // estimated damping, N m s/rad
  double k_true = kNaN;      // of the muscles, same regressors
  double slip = kNaN;        // largest between device and arm since donned, rad
  Vector angle = {};         // of the human joint over the movement, rad
  Vector torque = {};        // of the muscles by the nominal model, N m
  Matrix displacement = {};  // of limbs in their cuffs since donned, three columns each, m
};

// Reduced less full, an entry a sample; rms over those samples that both plants
// have.
struct PlantDifference {
  Vector k, k_error, d;  // k_error: of k - k_true
  Vector slip;           // rad
  // Rms over the movement: rad, N m, distance in m.
  Vector angle, torque, displacement;
  double k_rms = kNaN, k_error_rms = kNaN, d_rms = kNaN, slip_rms = kNaN;
  double angle_rms = kNaN, torque_rms = kNaN, displacement_rms = kNaN;
  Index samples = 0;  // that both have

  // Throws Error (kArgument) for lists of different lengths.
  static PlantDifference between(const std::vector<PlantOutcome>& full,
                                 const std::vector<PlantOutcome>& reduced);
};

}  // namespace ulna
