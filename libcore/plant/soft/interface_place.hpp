// Where an interface is in the engine's model: between which bodies, and how
// they stand.
#pragma once

#include "plant/engine/run.hpp"
#include "plant/soft/soft_interface.hpp"

namespace ulna {

struct InterfacePlace {
  Index link;
  Index bone;
  Vector3 cuff_position;     // in the link, m
  Matrix3 cuff_orientation;  // columns: cuff axes in the link
  Vector3 centre;            // of the tissue in the bone, m

  // Throws Error (kArgument) where the model has no such bodies.
  InterfacePlace(const SoftInterfaceOptions& options, const EngineModel& model);

  LimbPose pose(const EngineRun& run) const;
  // Twist of the limb against the link for the rates of all degrees of freedom,
  // cuff frame.
  Matrix jacobian(const EngineRun& run) const;

 private:
  Vector3 centre_in_world(const EngineRun& run) const;
};

}  // namespace ulna
