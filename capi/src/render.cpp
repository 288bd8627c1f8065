#include <ulna/render.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "plant/exo_scenery.hpp"
#include "plant/soft_scenery.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

constexpr Index kShapeValues = 12;

engine::OffscreenKind backend_of(int32_t value) {
  return kind_of<engine::OffscreenKind>(value, 3, "backend");
}

RenderCamera camera_of(const ulna_render_options& o) {
  RenderCamera camera;
  if (o.camera != nullptr) camera.name = o.camera;
  if (o.direction != nullptr) {
    const Vector v = entries_of(o.direction, "direction");
    require(v.size() == 2 && v.allFinite(), "direction",
            "direction must have two finite numbers, azimuth and elevation");
    camera.azimuth = v[0];
    camera.elevation = v[1];
  }
  if (o.look_at != nullptr) {
    const Vector v = entries_of(o.look_at, "look_at");
    require(v.size() == 3 && v.allFinite(), "look_at", "look_at must have three finite numbers");
    camera.look_at = v;
  }
  if (o.distance_m != 0.0) camera.distance = o.distance_m;
  require(!std::isnan(o.distance_m), "distance_m", "distance_m must be a number");
  camera.whole_range = flag(o.whole_range, "whole_range");
  return camera;
}

RenderOptions options_of(const ulna_render_options& o) {
  RenderOptions r;
  if (o.width != 0) r.width = o.width;
  if (o.height != 0) r.height = o.height;
  if (o.samples != 0) r.samples = o.samples;
  r.backend = backend_of(o.backend);
  r.grid = !flag(o.no_grid, "no_grid");
  r.camera = camera_of(o);
  return r;
}

Scenery scenery_for(const ulna_plant& plant, const ulna_render_options& o) {
  ExoLookOptions look;
  look.person = !flag(o.no_person, "no_person");
  look.skin = !flag(o.no_skin, "no_skin");
  if (plant.soft) return scenery_of(*plant.soft, look);
  const ExoScene* described = plant.plant.described();
  return described == nullptr ? Scenery{} : scenery_of(*described, look);
}

std::unique_ptr<ulna_renderer> renderer_of(const ulna_plant& plant, const ulna_render_options& o) {
  require(std::isfinite(o.force_scale_m_n), "force_scale_m_n", "force_scale_m_n must be finite");
  auto made = std::make_unique<ulna_renderer>(
      ulna_renderer{Renderer(plant.plant.model(), scenery_for(plant, o), options_of(o)),
                    plant.soft,
                    {},
                    flag(o.no_interfaces, "no_interfaces"),
                    {}});
  made->look.forces = o.force_scale_m_n >= 0.0;
  if (o.force_scale_m_n > 0.0) made->look.force_scale = o.force_scale_m_n;
  return made;
}

Shape shape_of(const Vector& v) {
  constexpr ShapeKind kKinds[] = {ShapeKind::kSphere, ShapeKind::kCapsule, ShapeKind::kCylinder,
                                  ShapeKind::kArrow};
  require(v[0] >= 0.0 && v[0] <= 3.0 && v[0] == std::floor(v[0]), "shapes",
          "the kind of a shape must be 0, 1, 2 or 3");
  const Colour colour = {static_cast<float>(v[8]), static_cast<float>(v[9]),
                         static_cast<float>(v[10]), static_cast<float>(v[11])};
  require((v.tail<4>().array() >= 0.0).all() && (v.tail<4>().array() <= 1.0).all(), "shapes",
          "red, green, blue and opacity of a shape must be between 0 and 1");
  require(v[7] > 0.0, "shapes", "the radius of a shape must be positive");
  const ShapeKind kind = kKinds[static_cast<int>(v[0])];
  const Vector3 from = v.segment<3>(1);
  const Vector3 to = kind == ShapeKind::kSphere ? from : Vector3(v.segment<3>(4));
  return bar(from, to, v[7], colour, kind);
}

std::vector<Shape> shapes_of(const ulna_renderer& renderer, const ulna_run& run,
                             const ulna_view* shapes, const ulna_view* forces) {
  std::vector<Shape> all;
  if (renderer.soft && !renderer.plain) {
    const Matrix given = forces == nullptr ? Matrix() : rows_of(forces, "forces", 6);
    all = interface_shapes(*renderer.soft, run.run, renderer.look, given);
  } else {
    require(forces == nullptr, "forces", "there are no soft interfaces that forces could be of");
  }
  if (shapes == nullptr) return all;
  const Matrix rows = rows_of(shapes, "shapes", kShapeValues);
  for (Index i = 0; i < rows.rows(); ++i) {
    const Vector row = rows.row(i).transpose();
    all.push_back(shape_of(row));
  }
  return all;
}

vision::PictureView picture_of(const char* rgb, int32_t width, int32_t height) {
  return {reinterpret_cast<const std::uint8_t*>(&deref(rgb, "rgb")), width, height};
}

}  // namespace

ulna_status ulna_render_available(int32_t backend, int32_t* out_available, char* out_text,
                                  int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    deref(out_available, "out_available");
    int32_t available = 1;
    std::string words;
    try {
      words = engine::OffscreenContext::open(backend_of(backend))->words();
    } catch (const Error& error) {
      if (error.fault() != Fault::kUnsupported) throw;
      available = 0;
      words = error.what();
    }
    write_text(words, out_text, capacity, out_size);
    *out_available = available;
  });
}

ulna_status ulna_renderer_new(const ulna_plant* plant, const ulna_render_options* options,
                              ulna_renderer** out_renderer) {
  return guarded([&] {
    deref(out_renderer, "out_renderer");
    const ulna_plant& own = deref(plant, "plant");
    *out_renderer = renderer_of(own, read_options(options, "options")).release();
  });
}

void ulna_renderer_free(ulna_renderer* renderer) { delete renderer; }

ulna_status ulna_renderer_size(const ulna_renderer* renderer, int32_t* out_width,
                               int32_t* out_height) {
  return guarded([&] {
    const Renderer& own = deref(renderer, "renderer").renderer;
    deref(out_width, "out_width") = own.width();
    deref(out_height, "out_height") = own.height();
  });
}

ulna_status ulna_renderer_text(const ulna_renderer* renderer, char* out_text, int64_t capacity,
                               int64_t* out_size) {
  return guarded([&] {
    write_text(deref(renderer, "renderer").renderer.backend(), out_text, capacity, out_size);
  });
}

ulna_status ulna_renderer_draw(ulna_renderer* renderer, const ulna_run* run,
                               const ulna_view* shapes, const ulna_view* forces, char* out_rgb,
                               int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    ulna_renderer& own = deref(renderer, "renderer");
    const auto pixels = static_cast<std::size_t>(own.renderer.width()) *
                        static_cast<std::size_t>(own.renderer.height());
    deref(out_size, "out_size") = static_cast<int64_t>(3 * pixels);
    if (out_rgb == nullptr && capacity == 0) return;
    if (capacity < *out_size) {
      throw Error(Fault::kBuffer, "capacity", "out_rgb must have room for three bytes a pixel");
    }
    const ulna_run& drawn = deref(run, "run");
    own.depth.resize(pixels);
    own.renderer.draw(drawn.run, shapes_of(own, drawn, shapes, forces),
                      reinterpret_cast<std::uint8_t*>(&deref(out_rgb, "out_rgb")),
                      own.depth.data());
  });
}

ulna_status ulna_renderer_depth(const ulna_renderer* renderer, double* out, int64_t capacity,
                                int64_t* out_count) {
  return guarded([&] {
    const std::vector<float>& depth = deref(renderer, "renderer").depth;
    require(!depth.empty(), "renderer", "the renderer has drawn nothing yet");
    const std::vector<double> values(depth.begin(), depth.end());
    write_array(values.data(), static_cast<int64_t>(values.size()), out, capacity, out_count);
  });
}

ulna_status ulna_image_write_png(const char* path, const char* rgb, int32_t width, int32_t height) {
  return guarded([&] { vision::write_png(text_of(path, "path"), picture_of(rgb, width, height)); });
}

ulna_status ulna_video_new(const char* path, int32_t width, int32_t height, double rate_hz,
                           ulna_video** out_video) {
  return guarded([&] {
    deref(out_video, "out_video");
    *out_video = new ulna_video{vision::VideoWriter(text_of(path, "path"), width, height, rate_hz)};
  });
}

ulna_status ulna_video_add(ulna_video* video, const char* rgb, int32_t width, int32_t height) {
  return guarded([&] { deref(video, "video").writer.add(picture_of(rgb, width, height)); });
}

ulna_status ulna_video_close(ulna_video* video) {
  return guarded([&] { deref(video, "video").writer.close(); });
}

void ulna_video_free(ulna_video* video) { delete video; }
