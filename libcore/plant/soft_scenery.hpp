// What soft interfaces look like in a run: tissue by its elements, coloured by pressure, straps,
// and the forces on the limb.
#pragma once

#include "plant/exo_scenery.hpp"
#include "plant/soft/soft_plant.hpp"

namespace ulna {

struct InterfaceLook {
  bool tissue = true;
  bool straps = true;
  bool forces = true;
  double force_scale = 0.0015;     // of arrows, m/N
  double full_pressure = 20000.0;  // at which the colour is darkest, Pa
};

// Shapes in the world for a run of plant.model(). forces: interfaces x 6, force of the cuff and of
// the strap on the limb in the cuff's frame (N), as a record holds them, without pressures; empty:
// those of the run's own interfaces, where it has any. Throws Error (kArgument) for forces of
// another shape.
std::vector<Shape> interface_shapes(const SoftPlant& plant, const EngineRun& run,
                                    const InterfaceLook& look = {},
                                    const Matrix& forces = Matrix());

// The device with its cuffs as they are adjusted, and the arm.
Scenery scenery_of(const SoftPlant& plant, ExoLookOptions options = {});

}  // namespace ulna
