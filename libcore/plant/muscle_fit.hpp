// Force scales and operating ranges of elbow muscles from measured maximum isometric torque, at a
// passive torque that stays physiological.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "plant/isometric.hpp"

namespace ulna {

// A measured curve and the root-mean-square error that is good enough for each direction.
struct TorqueTarget {
  TorqueReference reference;
  double flexion_error = 0.0;    // N m
  double extension_error = 0.0;  // N m
};

struct MuscleFitOptions {
  std::vector<TorqueTarget> targets;  // empty: Amis 12 and 12, Buchanan 6 and 8 N m
  TorquePeak flexion_peak{78.0, 85.0 * kPi / 180.0};
  TorquePeak extension_peak{-51.0, 67.5 * kPi / 180.0};
  double passive_limit = 2.0;  // N m, either way
  JointRange passive_range{30.0 * kPi / 180.0, 110.0 * kPi / 180.0};
  int evaluations = 60000;  // of the curves, at most, in each of four rounds
};

// Torque of a group of muscles over the table's angles.
struct TorqueCurves {
  Vector flexion;    // flexors at full excitation, with the passive torque of all muscles, N m
  Vector extension;  // extensors likewise
  Vector passive;    // no excitation
};

struct MuscleFit {
  std::vector<Muscle> muscles;  // with the forces and ranges found
  double flexor_scale = 1.0;    // of the forces given
  double extensor_scale = 1.0;
  TorqueCurves curves;
  double objective = 0.0;
  int evaluations = 0;
};

// The table of an arm's elbow muscles over 0 to 125 degrees in steps of one, the shoulder in its
// reference: what the published test and the fit use. The scene must be of the arm alone.
MuscleTable elbow_table(const ExoScene& scene, Token* token = nullptr);

// The curves of muscles with lengths and moments of a table, whose lengths are normalised by their
// extremes over the table (the plant's rule, where the table spans the elbow's range).
TorqueCurves torque_curves(const MuscleTable& table, const std::vector<Muscle>& muscles);

// Finds one force scale for flexors, one for extensors, and a range for each muscle that bring the
// errors below their targets (the worst counts most), the peaks to theirs and the passive torque
// below its limit, close to the ranges given where nothing is lost. Subplex (NLopt), deterministic.
// Throws Error (kArgument) for muscles that are not those of the table, kCancelled.
MuscleFit fit_muscles(const MuscleTable& table, const std::vector<Muscle>& muscles,
                      const MuscleFitOptions& options = {}, Token* token = nullptr);

}  // namespace ulna
