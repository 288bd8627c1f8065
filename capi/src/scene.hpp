// A scene from the options of the interface.
#pragma once

#include <ulna/exo.h>

#include "plant/exo_scene.hpp"

namespace ulna::capi {

// Throws Error (kArgument) for what cannot be.
ExoScene scene_of(const ulna_scene_options* options);

// Angles of the device's joints in which its scene is written, rad.
Vector device_reference(const ExoScene& scene);

}  // namespace ulna::capi
