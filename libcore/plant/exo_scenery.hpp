// How an exoskeleton and an arm look: solid parts on the bodies of a scene, made from the same
// description. None of them is known to the engine, so that nothing of the motion depends on them.
#pragma once

#include <optional>
#include <vector>

#include "plant/engine/scenery.hpp"
#include "plant/exo_scene.hpp"
#include "plant/soft/cuff.hpp"

namespace ulna {

struct ExoLookOptions {
  bool person = true;  // a still figure without limbs whose arm it is, on a stool
  bool skin = true;    // a translucent cover of the arm's segments
  bool floor = true;
  std::optional<std::vector<Cuff>> cuffs;  // without: the published ones on the published device
};

// Drives on the joints, bars between them, cuffs, straps; bones, hand and skin; figure and floor.
Scenery scenery_of(const ExoScene& scene, const ExoLookOptions& options = {});

}  // namespace ulna
