// Pictures of a run without a window: the engine's shapes, scenery, muscles coloured by activation.
// A renderer belongs to one thread at a time. Drawing changes neither model nor run.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "plant/engine/offscreen.hpp"
#include "plant/engine/run.hpp"
#include "plant/engine/scenery.hpp"

namespace ulna {

struct RenderCamera {
  // "": oblique, from the front and the arm's inside, where the muscles are seen; "device": from
  // the device's side; "side", "front", "back", "top"; or the name of a camera of the model, which
  // has its own place.
  std::string name;
  // What is not a number follows from the name and from what is to be seen.
  double azimuth = kNaN;    // rad, of the direction of view about z: 0 looks forward, along x
  double elevation = kNaN;  // rad, of the direction of view: negative looks down
  double distance = kNaN;   // from the point looked at, m
  Vector3 look_at = Vector3::Constant(kNaN);
  // What is to be seen is the first picture; or also that with the scenery's swept joints anywhere
  // in their ranges, for films.
  bool whole_range = false;
};

struct RenderOptions {
  int width = 1280;  // pixels
  int height = 960;
  int samples = 2;   // along each side of a pixel, 1 ... 4
  bool grid = true;  // lines of 0.1 m on the floor
  RenderCamera camera;
  engine::OffscreenKind backend = engine::OffscreenKind::kAny;
  engine::OffscreenLibraries libraries;
};

class Renderer {
 public:
  // Throws Error: kArgument for options that cannot be, kUnsupported without OpenGL.
  Renderer(const EngineModel& model, const Scenery& scenery, const RenderOptions& options = {});
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  int width() const;
  int height() const;
  const std::string& backend() const;  // "EGL, llvmpipe ..."

  // Draws a run of the model at its present state, with further shapes in the world. rgb: height x
  // width x 3 bytes, top row first. depth (may be NULL): height x width, distance along the
  // direction of view in m, infinite where nothing is. The default camera's place follows from the
  // first picture and stays. Throws Error: kArgument for a run of another model, kInternal.
  void draw(const EngineRun& run, const std::vector<Shape>& shapes, std::uint8_t* rgb,
            float* depth = nullptr);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ulna
