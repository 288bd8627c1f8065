// The full interface as bushings. The arm at rest is followed through the
// movement, and the wrenches of cuff and strap over the displacements that they
// come with become stiffness; where the movement says nothing, the stiffness is
// the one that cuff and strap answer a small move with.
#pragma once

#include "base/token.hpp"
#include "plant/soft/still_arm.hpp"

namespace ulna {

struct ReductionOptions {
  double start = 110.0 * kDegree;  // angle of the device's last joint, the others in the reference
  double end = 3.0 * kDegree;      // the published movement goes to 10, and beyond
                                   // it before it rests
  int poses = 25;                  // between them
  double activation = 0.4;         // of the elbow muscles
  void check() const;              // throws Error (kArgument)
};

struct Reduction {
  std::vector<Bushing> bushings;  // cuff and strap of each interface
  // Of each: what its wrench misses of the full one's change along the
  // movement, relative, rms.
  std::vector<double> misfit;
};

// Throws Error: kArgument for a plant that is reduced, and what donning throws.
Reduction reduce(const SoftPlant& full, const ReductionOptions& options = {},
                 Token* token = nullptr);

}  // namespace ulna
