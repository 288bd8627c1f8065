// What a finished picture has beyond what the engine draws: a light background, a floor that fades
// into it with lines to scale, outlines and smooth edges.
#pragma once

#include <cstdint>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna::engine {

// A camera in the world. Its axes have length 1 and are orthogonal.
struct View {
  Vector3 position;
  Vector3 forward;
  Vector3 up;
  double tangent = 0.25;  // of half the vertical angle
  double near = 0.05;     // m
  double far = 50.0;

  Vector3 right() const;
};

struct Backdrop {
  // The engine drew a white wall at this distance along the view (m), and nothing beyond: the
  // background takes its place and shows through what is translucent before it. 0: no wall, the
  // picture stays as it was drawn.
  double wall = 0.0;
  bool floor = false;
  bool grid = true;
  bool outline = true;               // thin dark lines around what is well in front
  double floor_height = 0.0;         // m
  Vector3 centre = Vector3::Zero();  // around which the floor is seen
  double radius = 1.0;               // to which it is, m
};

// What OpenGL gives: bottom row first.
struct Rendered {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;  // height x width x 3
  std::vector<float> depth;       // height x width, 0 (near) to 1 (far)
};

// Averages samples x samples pixels into one, top row first. depth (may be NULL): distance along
// the view of the nearest, m, infinite for the background; the floor counts as background.
void compose(const Rendered& rendered, const View& view, const Backdrop& backdrop, int samples,
             std::uint8_t* rgb, float* depth);

}  // namespace ulna::engine
