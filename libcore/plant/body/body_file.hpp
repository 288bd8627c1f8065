// Bodies as files of other programs: URDF (ROS) and MJCF (MuJoCo). What is written is read back
// with the same numbers.
#pragma once

#include <string>

#include "plant/body/body_tree.hpp"

namespace ulna {

// The body as URDF. Massless links have no <inertial>; an extension element that only MuJoCo reads
// lets it take them with masses of 1e-12 kg.
std::string to_urdf(const BodyTree& body, const std::string& name);

// Reads URDF: links, revolute, continuous and fixed joints. Throws Error (kFormat) with the name of
// the joint or link for text that is no URDF, joints of other types, links that are missing, have
// two parents or hang on nothing, and (kArgument) for masses and inertias that no body has.
BodyTree from_urdf(const std::string& text);

// The body as MJCF; links without mass between hinges at one point become joints of one body.
// `free_base`: the base floats, else it is fixed to the world.
std::string to_mjcf(const BodyTree& body, const std::string& name, bool free_base = true);

// Reads MJCF through the engine: one tree of bodies on free, hinge and ball joints (a ball becomes
// three hinges x, y, z). Throws Error: kFormat with the engine's reason, and for slides, for
// several trees and for a scene without bodies.
BodyTree from_mjcf(const std::string& text);

// URDF or MJCF, told apart by the first element. Throws Error (kFormat).
BodyTree body_from_text(const std::string& text);

// Reads a URDF or MJCF file, told apart by its first element. Throws Error: kFile, kFormat.
BodyTree read_body(const std::string& path);

}  // namespace ulna
