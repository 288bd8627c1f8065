// The bodies of a compiled model as links of a whole body.
#pragma once

#include "plant/body/body_tree.hpp"
#include "plant/engine/model.hpp"

namespace ulna {

// The one tree of bodies of a model. A body of several joints becomes massless links "<body>_f1",
// "<body>_f2" and itself; a ball becomes hinges "<joint>_rotx", "_roty", "_rotz"; a root without a
// free joint is a base like any other. Link frames lie at the joint that carries them. Throws Error
// (kFormat) that names slides, several trees, and models without bodies.
BodyTree body_links(const EngineModel& model);

}  // namespace ulna
