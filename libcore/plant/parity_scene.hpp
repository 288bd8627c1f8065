// The published simulation as a scene of the engine: every element written out and named.
#pragma once

#include <string>

#include "plant/exo_scene.hpp"
#include "plant/parity_options.hpp"

namespace ulna {

// Device and arm of the options, apart: masses of tissue and straps are in their elements.
ExoScene parity_bodies(const ParityOptions& options);

// Where the middles of the tissues are in humerus and ulna, m; their size does not follow the
// arm's.
struct ParityCentres {
  Vector3 upper, fore;
};
ParityCentres parity_centres(const ArmDescription& arm);

// In the engine's language. Joints and motors are named as in mjcf_of(); elements, their slides,
// spheres and constraints as in parity_interface.hpp: "<element>", "<element>_slide",
// "<element>_centre", "<element>~<neighbour>", "<shell>_volume", "<thread>".
std::string parity_mjcf(const ParityOptions& options);

// Room for the constraints of a run: the published one reserved 12000 rows and 1.8 GB.
inline constexpr Index kParityContacts = 2000;
inline constexpr Index kParityRows = 7500;

}  // namespace ulna
