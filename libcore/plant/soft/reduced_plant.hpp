// The full interface as bushings: its cuff and its strap are held in a state that a run of the full
// plant came to, the limb is moved a little along and about each axis, and what cuff and strap
// answer becomes stiffness and damping.
#pragma once

#include "base/token.hpp"
#include "plant/soft/soft_plant.hpp"

namespace ulna {

struct ReductionOptions {
  double elbow = 60.0 * kDegree;  // angle of the device's last joint, the others in the reference
  double activation = 0.4;        // of the elbow muscles
  double settling = 2.0;          // s
  double shift = 0.003;           // amplitude along each axis, m
  double turn = 2.0 * kDegree;    // amplitude about each axis, rad
  double ramp = 0.5;              // how long a move takes, s
  double hold = 0.5;              // how long it is held before the answer is read, s
  void check() const;             // throws Error (kArgument)
};

struct Reduction {
  std::vector<Bushing> bushings;  // cuff and strap of each interface
  std::vector<double> asymmetry;  // of each stiffness before it was made symmetric, relative
  std::vector<double> linearity;  // of each: difference of stiffness in both directions, relative
};

// Throws Error: kUnsupported for a plant that is reduced, and what its runs throw.
Reduction reduce(const SoftPlant& full, const ReductionOptions& options = {},
                 Token* token = nullptr);

// Bushings of one interface in its present state at a pose.
Reduction probe(const InterfaceRun& interface, const LimbPose& pose, int index,
                const std::string& name, double timestep, const ReductionOptions& options);

}  // namespace ulna
