#include "plant/engine/renderer.hpp"

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>

#include "base/error.hpp"
#include "plant/engine/compose.hpp"
#include "plant/engine/trap.hpp"

namespace ulna {
namespace engine {

// Of members of the renderer, so not in the namespace without a name.
struct ViewDirection {
  const char* name;
  double azimuth, elevation;  // degrees
};

struct Framing {
  Vector3 look_at;
  double distance;
};

}  // namespace engine

namespace {

using engine::Backdrop;
using engine::Framing;
using engine::OffscreenContext;
using engine::View;
using engine::ViewDirection;

constexpr double kTangent = 0.19438030913771848;  // of half the vertical angle: 11 degrees
constexpr int kMuscleSteps = 36;                  // pieces along a muscle
constexpr double kTendonRadius = 0.0022;          // m
const Colour kTendon = {0.93F, 0.90F, 0.82F, 1.0F};

// Of drawing, in which the engine gives up by its error handler.
template <class Call>
void drawing(Call call) {
  std::string reason;
  if (engine::contained(call, reason)) return;
  if (reason.find("gladLoadGL") != std::string::npos) {
    throw Error(Fault::kUnsupported, "backend",
                "the engine cannot draw with OSMesa, because this process has loaded another "
                "OpenGL library: draw in a process of its own");
  }
  throw Error(Fault::kInternal, "", "the engine gave up drawing: " + reason);
}

int engine_type(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kSphere:
      return mjGEOM_SPHERE;
    case ShapeKind::kEllipsoid:
      return mjGEOM_ELLIPSOID;
    case ShapeKind::kCapsule:
      return mjGEOM_CAPSULE;
    case ShapeKind::kCylinder:
      return mjGEOM_CYLINDER;
    case ShapeKind::kBox:
      return mjGEOM_BOX;
    case ShapeKind::kArrow:
      return mjGEOM_ARROW;
  }
  return mjGEOM_SPHERE;
}

// With all three numbers, as the engine's shapes have them.
Vector3 whole_size(const Shape& shape) {
  const Vector3& size = shape.size;
  if (shape.kind == ShapeKind::kSphere) return Vector3::Constant(size.x());
  if (shape.kind == ShapeKind::kEllipsoid || shape.kind == ShapeKind::kBox) return size;
  return {size.x(), size.x(), size.z()};
}

mjvGeom geom_of(const Shape& shape, const Vector3& position, const Matrix3& orientation) {
  mjvGeom geom;
  const Vector3 size = whole_size(shape);
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> axes = orientation;
  mjv_initGeom(&geom, engine_type(shape.kind), nullptr, position.data(), axes.data(),
               shape.colour.data());
  for (int i = 0; i < 3; ++i) geom.size[i] = static_cast<float>(size[i]);
  if (shape.kind == ShapeKind::kArrow) geom.size[2] *= 2.0F;  // the engine draws half of it
  geom.category = mjCAT_DECOR;
  geom.specular = shape.shine;
  geom.shininess = 0.2F + 0.6F * shape.shine;
  geom.reflectance = 0.0F;
  geom.transparent = shape.colour[3] < 0.999F ? 1 : 0;
  return geom;
}

// Corners of the box around a shape.
void add_corners(const Shape& shape, const Vector3& position, const Matrix3& orientation,
                 std::vector<Vector3>& points) {
  Vector3 half = whole_size(shape);
  if (shape.kind == ShapeKind::kCapsule) half.z() += half.x();
  const bool arrow = shape.kind == ShapeKind::kArrow;
  for (int corner = 0; corner < 8; ++corner) {
    Vector3 at((corner & 1) != 0 ? half.x() : -half.x(), (corner & 2) != 0 ? half.y() : -half.y(),
               (corner & 4) != 0 ? half.z() : -half.z());
    if (arrow && at.z() < 0.0) at.z() = 0.0;
    points.push_back(position + orientation * at);
  }
}

// Along the curve through points, and how far it is.
class Path {
 public:
  explicit Path(std::vector<Vector3> points) : points_(std::move(points)), at_{0.0} {
    for (std::size_t i = 1; i < points_.size(); ++i) {
      at_.push_back(at_.back() + (points_[i] - points_[i - 1]).norm());
    }
  }
  double length() const { return at_.back(); }
  Vector3 operator()(double share) const {
    const double s = share * length();
    std::size_t i = 1;
    while (i + 1 < at_.size() && at_[i] < s) ++i;
    const double whole = at_[i] - at_[i - 1];
    const double part = whole > 0.0 ? std::clamp((s - at_[i - 1]) / whole, 0.0, 1.0) : 0.0;
    return points_[i - 1] + part * (points_[i] - points_[i - 1]);
  }

 private:
  std::vector<Vector3> points_;
  std::vector<double> at_;
};

Vector3 vector_of(const mjtNum* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

// Between the two points where a path touches a sphere or cylinder: along its surface.
void add_arc(const mjModel* m, const mjData* d, int geom, const Vector3& from, const Vector3& to,
             std::vector<Vector3>& points) {
  constexpr int kPieces = 6;
  const Vector3 centre = vector_of(d->geom_xpos + 3 * geom);
  const mjtNum* axes = d->geom_xmat + 9 * geom;
  const bool sphere = m->geom_type[geom] == mjGEOM_SPHERE;
  const Vector3 axis = sphere ? Vector3(Vector3::Zero()) : Vector3(axes[2], axes[5], axes[8]);
  const auto split = [&](const Vector3& p, double& along) {
    along = axis.dot(p - centre);
    return Vector3(p - centre - along * axis);
  };
  double z0 = 0.0, z1 = 0.0;
  const Vector3 a = split(from, z0);
  const Vector3 b = split(to, z1);
  for (int k = 1; k < kPieces; ++k) {
    const double t = static_cast<double>(k) / kPieces;
    Vector3 way = (1.0 - t) * a + t * b;
    if (way.norm() < 1e-9) continue;
    way *= a.norm() / way.norm();
    points.push_back(centre + way + ((1.0 - t) * z0 + t * z1) * axis);
  }
}

std::vector<Vector3> tendon_path(const mjModel* m, const mjData* d, int tendon) {
  std::vector<Vector3> points;
  const int first = d->ten_wrapadr[tendon];
  for (int j = first; j < first + d->ten_wrapnum[tendon]; ++j) {
    if (d->wrap_obj[j] == -2) continue;  // a pulley has no place
    const Vector3 at = vector_of(d->wrap_xpos + 3 * j);
    const int geom = d->wrap_obj[j];
    if (geom >= 0 && j > first && d->wrap_obj[j - 1] == geom && !points.empty()) {
      add_arc(m, d, geom, Vector3(points.back()), at, points);
    }
    points.push_back(at);
  }
  return points;
}

// A belly between two tendons, thicker when it is shorter.
void add_muscle(const mjModel* m, const mjData* d, int actuator, double pressure,
                std::vector<Shape>& shapes) {
  const std::vector<Vector3> points = tendon_path(m, d, m->actuator_trnid[2 * actuator]);
  if (points.size() < 2) return;
  const Path path(points);
  const mjtNum* range = m->actuator_lengthrange + 2 * actuator;
  const double usual = 0.5 * (range[0] + range[1]);
  const double force = std::max(1.0, m->actuator_gainprm[mjNGAIN * actuator + 2]);
  const double stretch = std::clamp(usual / std::max(path.length(), 1e-3), 0.5, 2.0);
  const double belly =
      std::min(std::sqrt(force / (pressure * kPi) * stretch), 0.25 * path.length());
  const int state = actuator - (m->nu - m->na);
  const Colour red = activation_colour(state >= 0 ? d->act[state] : d->ctrl[actuator]);
  Vector3 before = path(0.0);
  for (int k = 0; k < kMuscleSteps; ++k) {
    const double middle = (k + 0.5) / kMuscleSteps;
    const Vector3 after = path((k + 1.0) / kMuscleSteps);
    // Bare tendon at the outer eighths.
    const double inside = std::clamp((middle - 0.12) / 0.76, 0.0, 1.0);
    const double bulge = std::pow(std::sin(kPi * inside), 0.8);
    const auto share = static_cast<float>(std::clamp(4.0 * bulge, 0.0, 1.0));
    Colour colour{0.0F, 0.0F, 0.0F, 1.0F};
    for (std::size_t c = 0; c < 3; ++c) colour[c] = kTendon[c] + share * (red[c] - kTendon[c]);
    shapes.push_back(bar(before, after, kTendonRadius + (belly - kTendonRadius) * bulge, colour));
    shapes.back().framed = false;
    before = after;
  }
}

void check_options(const RenderOptions& o, const Scenery& s) {
  require(o.width >= 16 && o.width <= 7680 && o.height >= 16 && o.height <= 7680, "size",
          "a picture must have between 16 and 7680 pixels along each side");
  require(o.samples >= 1 && o.samples <= 4, "samples", "samples must be between 1 and 4");
  require(o.samples * std::max(o.width, o.height) <= 15360, "samples",
          "samples times the longer side of a picture must be at most 15360");
  const RenderCamera& c = o.camera;
  for (const double number :
       {c.azimuth, c.elevation, c.look_at.x(), c.look_at.y(), c.look_at.z()}) {
    require(!std::isinf(number), "camera", "the camera's place must be finite");
  }
  require(c.look_at.array().isNaN().all() || c.look_at.allFinite(), "camera",
          "the point that the camera looks at must have three finite numbers");
  require(std::isnan(c.distance) || (c.distance >= 0.01 && c.distance <= 1000.0), "camera",
          "the camera's distance must be between 0.01 and 1000 m");
  require(std::isnan(c.elevation) || std::fabs(c.elevation) <= 0.5 * kPi + 1e-9, "camera",
          "the camera's elevation must be at most a right angle either way");
  require(std::isfinite(s.muscle_pressure) && s.muscle_pressure > 0.0, "muscle_pressure",
          "muscle_pressure must be positive");
}

constexpr ViewDirection kDirections[] = {{"", 228.0, -22.0},    {"device", 124.0, -22.0},
                                         {"side", 90.0, -4.0},  {"front", 180.0, -4.0},
                                         {"back", 25.0, -22.0}, {"top", 90.0, -89.9}};

View view_along(double azimuth, double elevation) {
  View view{.position = Vector3::Zero(),
            .forward = {std::cos(elevation) * std::cos(azimuth),
                        std::cos(elevation) * std::sin(azimuth), std::sin(elevation)},
            .up = {-std::sin(elevation) * std::cos(azimuth),
                   -std::sin(elevation) * std::sin(azimuth), std::cos(elevation)},
            .tangent = kTangent};
  return view;
}

// The nearest place from which all points are in the picture, with a margin.
Framing framing_of(const std::vector<Vector3>& points, const View& view, double aspect) {
  constexpr double kMargin = 1.06;
  if (points.empty()) return {Vector3::Zero(), 2.0};
  const Vector3 right = view.right();
  Vector3 centre = Vector3::Zero();
  for (const Vector3& p : points) centre += p / static_cast<double>(points.size());
  double distance = 0.0;
  // The middle of what is seen depends on the distance, by perspective.
  for (int round = 0; round < 20; ++round) {
    distance = 0.02;
    for (const Vector3& p : points) {
      const Vector3 a = p - centre;
      const double x = kMargin * std::fabs(right.dot(a)) / (view.tangent * aspect);
      const double y = kMargin * std::fabs(view.up.dot(a)) / view.tangent;
      distance = std::max(distance, std::max(x, y) - view.forward.dot(a));
    }
    double low[2] = {kInfinity, kInfinity}, high[2] = {-kInfinity, -kInfinity};
    for (const Vector3& p : points) {
      const Vector3 a = p - centre;
      const double z = std::max(distance + view.forward.dot(a), 1e-3);
      const double at[2] = {right.dot(a) / z, view.up.dot(a) / z};
      for (int i = 0; i < 2; ++i) {
        low[i] = std::min(low[i], at[i]);
        high[i] = std::max(high[i], at[i]);
      }
    }
    centre += 0.5 * distance * ((low[0] + high[0]) * right + (low[1] + high[1]) * view.up);
  }
  return {centre, distance};
}

}  // namespace

class Renderer::Impl {
 public:
  Impl(const EngineModel& model, Scenery scenery, const RenderOptions& options)
      : model_(model), scenery_(std::move(scenery)), options_(options) {
    check_options(options_, scenery_);
    for (const BodyShape& shape : scenery_.shapes) {
      bodies_.push_back(shape.body.empty() ? 0 : model_.at(Part::kBody, shape.body));
    }
    find_camera();
    context_ = OffscreenContext::open(options_.backend, options_.libraries);
    mjr_defaultContext(&drawn_);
    mjv_defaultScene(&scene_);
    make();
  }

  ~Impl() {
    mjv_freeScene(&scene_);
    try {
      const OffscreenContext::Use use(*context_);
      std::string reason;
      mjrContext* drawn = &drawn_;
      auto free = [drawn] { mjr_freeContext(drawn); };
      engine::contained(free, reason);
    } catch (const Error&) {
      // Another thread has the context: what it holds goes with the context.
    }
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  const RenderOptions& options() const { return options_; }
  const std::string& backend() const { return context_->words(); }

  void draw(const EngineRun& run, const std::vector<Shape>& shapes, std::uint8_t* rgb,
            float* depth) {
    check_run(run);
    for (const Shape& shape : shapes) {
      require(shape.position.allFinite() && shape.orientation.allFinite() &&
                  shape.size.allFinite() && (shape.size.array() >= 0.0).all(),
              "shapes", "a shape has a place or a size that is not finite");
    }
    const std::vector<Shape> muscles = muscles_of(run);
    fill_scene(run, muscles, shapes);
    const View view = view_of(run);
    set_camera(view);
    set_lights(run);
    const double wall = has_sky() ? 0.0 : 0.9 * view.far;
    if (wall > 0.0) add_wall(view, wall);
    const engine::Rendered rendered = rendered_scene();
    const Backdrop backdrop{.wall = wall,
                            .floor = scenery_.floor,
                            .grid = options_.grid,
                            .floor_height = scenery_.floor_height,
                            .centre = focus_,
                            .radius = 1.7};
    engine::compose(rendered, view, backdrop, options_.samples, rgb, depth);
  }

 private:
  const mjModel* raw() const { return model_.raw(); }

  void find_camera() {
    const std::string& name = options_.camera.name;
    for (const ViewDirection& d : kDirections) {
      if (name == d.name) {
        direction_ = d;
        return;
      }
    }
    own_camera_ = mj_name2id(raw(), mjOBJ_CAMERA, name.c_str());
    if (own_camera_ >= 0) return;
    std::string names = "device, side, front, back, top";
    for (int i = 0; i < raw()->ncam; ++i) {
      const char* text = mj_id2name(raw(), mjOBJ_CAMERA, i);
      if (text != nullptr) names += std::string(", ") + text;
    }
    throw Error(Fault::kArgument, "camera",
                "there is no camera '" + name + "'; the names are: " + names);
  }

  bool has_sky() const {
    if (!scenery_.engine_shapes) return false;
    for (int i = 0; i < raw()->ntex; ++i) {
      if (raw()->tex_type[i] == mjTEXTURE_SKYBOX) return true;
    }
    return false;
  }

  // The engine copies textures and meshes of a model to the graphics card, with the sizes that the
  // model asks for: ours go into a copy. OpenGL's functions are looked up for the whole process.
  void make() {
    static std::mutex lookup;
    const std::lock_guard lock(lookup);
    const OffscreenContext::Use use(*context_);
    std::unique_ptr<mjModel, void (*)(mjModel*)> copy(mj_copyModel(nullptr, raw()), mj_deleteModel);
    if (copy == nullptr)
      throw Error(Fault::kMemory, "", "there is not enough memory for a picture");
    copy->vis.global.offwidth = options_.samples * options_.width;
    copy->vis.global.offheight = options_.samples * options_.height;
    copy->vis.quality.offsamples = 0;
    copy->vis.quality.shadowsize = 0;
    copy->vis.quality.numslices = 30;
    copy->vis.quality.numstacks = 18;
    const mjModel* m = copy.get();
    mjrContext* drawn = &drawn_;
    drawing([m, drawn] {
      mjr_makeContext(m, drawn, mjFONTSCALE_100);
      mjr_setBuffer(mjFB_OFFSCREEN, drawn);
    });
    if (drawn_.currentBuffer != mjFB_OFFSCREEN || drawn_.offWidth < copy->vis.global.offwidth) {
      throw Error(Fault::kUnsupported, "size",
                  "OpenGL has no buffer for a picture of this size: ask for a smaller one or for "
                  "fewer samples");
    }
  }

  void check_run(const EngineRun& run) const {
    const mjModel* other = run.model().raw();
    const mjModel* m = raw();
    require(other->nbody == m->nbody && other->ngeom == m->ngeom && other->nq == m->nq &&
                other->nu == m->nu && other->ntendon == m->ntendon && other->ncam == m->ncam &&
                other->nmesh == m->nmesh,
            "run", "the run is of another scene than the renderer");
    require(!run.faulted(), "run", "the run ended with a fault and can only be freed");
  }

  std::vector<Shape> muscles_of(const EngineRun& run) const {
    std::vector<Shape> shapes;
    const mjModel* m = run.model().raw();
    for (int i = 0; scenery_.muscles && i < m->nu; ++i) {
      if (m->actuator_gaintype[i] != mjGAIN_MUSCLE || m->actuator_trntype[i] != mjTRN_TENDON) {
        continue;
      }
      add_muscle(m, run.raw(), i, scenery_.muscle_pressure, shapes);
    }
    return shapes;
  }

  void make_room(std::size_t geoms) {
    if (static_cast<std::size_t>(scene_.maxgeom) >= geoms) return;
    const auto room = static_cast<int>(geoms + geoms / 4 + 100);
    mjvScene* scene = &scene_;
    const mjModel* m = raw();
    drawing([scene, m, room] {
      mjv_freeScene(scene);
      mjv_defaultScene(scene);
      mjv_makeScene(m, scene, room);
    });
  }

  void fill_scene(const EngineRun& run, const std::vector<Shape>& muscles,
                  const std::vector<Shape>& shapes) {
    const mjModel* m = run.model().raw();
    // The engine draws each geom once; sites and tendons are turned off.
    make_room(static_cast<std::size_t>(m->ngeom) + 100 + scenery_.shapes.size() + muscles.size() +
              shapes.size());
    mjvOption look;
    mjv_defaultOption(&look);
    look.flags[mjVIS_TENDON] = scenery_.muscles ? 0 : 1;
    std::fill_n(look.sitegroup, mjNGROUP, static_cast<mjtByte>(0));
    if (!scenery_.engine_shapes) std::fill_n(look.geomgroup, mjNGROUP, static_cast<mjtByte>(0));
    mjvCamera camera;
    mjv_defaultCamera(&camera);
    mjvScene* scene = &scene_;
    // Drawing writes nothing into the data but its stack, which it leaves as it was.
    auto* d = const_cast<mjData*>(run.raw());
    drawing([m, d, &look, &camera, scene] {
      mjv_updateScene(m, d, &look, nullptr, &camera, mjCAT_ALL, scene);
    });
    for (std::size_t i = 0; i < scenery_.shapes.size(); ++i) {
      const Shape& shape = scenery_.shapes[i].shape;
      const Matrix3 axes = run.body_orientation(bodies_[i]);
      add(geom_of(shape, run.body_position(bodies_[i]) + axes * shape.position,
                  axes * shape.orientation));
    }
    for (const Shape& s : muscles) add(geom_of(s, s.position, s.orientation));
    for (const Shape& s : shapes) add(geom_of(s, s.position, s.orientation));
  }

  // White, behind everything that can be seen.
  void add_wall(const View& view, double distance) {
    const double half = 1.5 * distance * view.tangent *
                        std::max(1.0, static_cast<double>(options_.width) / options_.height);
    Shape wall{.kind = ShapeKind::kBox, .size = {half, half, 0.001 * distance}};
    wall.colour = {1.0F, 1.0F, 1.0F, 1.0F};
    wall.shine = 0.0F;
    mjvGeom geom =
        geom_of(wall, view.position + distance * view.forward, axes_along(view.forward, view.up));
    geom.emission = 1.0F;
    add(geom);
  }

  void add(const mjvGeom& geom) {
    if (scene_.ngeom < scene_.maxgeom) scene_.geoms[scene_.ngeom++] = geom;
  }

  // What the default camera must show: shapes on their bodies in every pose of the swept joints.
  std::vector<Vector3> framed_points(const EngineRun& run) const {
    std::vector<Vector3> points;
    EngineRun posed(model_);
    const mjModel* m = raw();
    auto* d = const_cast<mjData*>(posed.raw());
    const auto see = [&] {
      drawing([m, d] { mj_kinematics(m, d); });
      add_points(posed, points);
    };
    const auto start = [&] { mju_copy(d->qpos, run.raw()->qpos, m->nq); };
    start();
    see();
    if (!options_.camera.whole_range) return points;
    constexpr int kPoses = 6;
    for (const std::string& joint : scenery_.sweep) {
      const Index j = model_.at(Part::kJoint, joint);
      const Matrix range = model_.joint_range();
      start();
      for (int k = 0; k <= kPoses; ++k) {
        posed.position()[model_.position_of(joint)] =
            range(j, 0) + (range(j, 1) - range(j, 0)) * k / kPoses;
        see();
      }
    }
    return points;
  }

  void add_points(const EngineRun& run, std::vector<Vector3>& points) const {
    for (std::size_t i = 0; i < scenery_.shapes.size(); ++i) {
      const Shape& shape = scenery_.shapes[i].shape;
      if (!shape.framed) continue;
      const Matrix3 axes = run.body_orientation(bodies_[i]);
      add_corners(shape, run.body_position(bodies_[i]) + axes * shape.position,
                  axes * shape.orientation, points);
    }
    for (int i = 0; scenery_.engine_shapes && i < raw()->ngeom; ++i) {
      const double radius = raw()->geom_rbound[i];  // 0 for planes, which have no end
      const Vector3 at = vector_of(run.raw()->geom_xpos + 3 * i);
      if (radius > 0.0) add_corners({.size = {radius, 0, 0}}, at, Matrix3::Identity(), points);
    }
  }

  View view_of(const EngineRun& run) {
    if (own_camera_ >= 0) return model_view(run);
    const RenderCamera& c = options_.camera;
    const double azimuth = std::isnan(c.azimuth) ? direction_.azimuth * kDegree : c.azimuth;
    const double elevation = std::isnan(c.elevation) ? direction_.elevation * kDegree : c.elevation;
    View view = view_along(azimuth, elevation);
    const double aspect = static_cast<double>(options_.width) / options_.height;
    if (!framing_) {
      const bool given = c.look_at.allFinite() && !std::isnan(c.distance);
      framing_ =
          given ? Framing{c.look_at, c.distance} : framing_of(framed_points(run), view, aspect);
      if (c.look_at.allFinite()) framing_->look_at = c.look_at;
      if (!std::isnan(c.distance)) framing_->distance = c.distance;
      focus_ = framing_->look_at;
    }
    view.position = framing_->look_at - framing_->distance * view.forward;
    view.near = 0.05 * framing_->distance;
    view.far = 20.0 * framing_->distance;
    return view;
  }

  View model_view(const EngineRun& run) const {
    const mjModel* m = raw();
    const mjtNum* axes = run.raw()->cam_xmat + 9 * own_camera_;
    View view{.position = vector_of(run.raw()->cam_xpos + 3 * own_camera_),
              .forward = -Vector3(axes[2], axes[5], axes[8]),
              .up = Vector3(axes[1], axes[4], axes[7]),
              .tangent = std::tan(0.5 * kDegree * m->cam_fovy[own_camera_])};
    view.near = static_cast<double>(m->vis.map.znear) * m->stat.extent;
    view.far = static_cast<double>(m->vis.map.zfar) * m->stat.extent;
    return view;
  }

  // Left and right eye are averaged.
  void set_camera(const View& view) {
    for (mjvGLCamera& camera : scene_.camera) {
      for (int i = 0; i < 3; ++i) {
        camera.pos[i] = static_cast<float>(view.position[i]);
        camera.forward[i] = static_cast<float>(view.forward[i]);
        camera.up[i] = static_cast<float>(view.up[i]);
      }
      camera.frustum_center = 0.0F;
      camera.frustum_top = static_cast<float>(view.tangent * view.near);
      camera.frustum_bottom = -camera.frustum_top;
      camera.frustum_near = static_cast<float>(view.near);
      camera.frustum_far = static_cast<float>(view.far);
    }
  }

  // A model's own lights, else one over the right shoulder of the viewer and weaker ones from the
  // left and from behind, which part what is near from what is far. No shadows: on round shapes
  // the engine's are full of stripes.
  void set_lights(const EngineRun& run) {
    scene_.flags[mjRND_SHADOW] = 0;
    scene_.flags[mjRND_REFLECTION] = 0;
    if (scenery_.engine_shapes && run.model().raw()->nlight > 0) return;
    const mjvGLCamera& c = scene_.camera[0];
    const Vector3 forward(c.forward[0], c.forward[1], 0.0);
    const Vector3 ahead = forward.norm() > 0.01 ? forward.normalized() : Vector3(Vector3::UnitY());
    const Vector3 right = ahead.cross(Vector3::UnitZ());
    const Vector3 down = -Vector3::UnitZ();
    scene_.nlight = 3;
    set_light(scene_.lights[0], Vector3(0.6 * ahead - 0.45 * right + down), 0.60F, 0.30F);
    set_light(scene_.lights[1], Vector3(0.7 * ahead + 0.9 * right + 0.1 * down), 0.20F, 0.0F);
    set_light(scene_.lights[2], Vector3(-0.9 * ahead + 0.3 * right + 0.4 * down), 0.22F, 0.15F);
    std::fill_n(scene_.lights[0].ambient, 3, 0.33F);
  }

  void set_light(mjvLight& light, const Vector3& direction, float diffuse, float specular) const {
    light = mjvLight{};
    const Vector3 unit = direction.normalized();
    const Vector3 at = focus_ - 3.0 * unit;
    for (int i = 0; i < 3; ++i) {
      light.pos[i] = static_cast<float>(at[i]);
      light.dir[i] = static_cast<float>(unit[i]);
      light.diffuse[i] = diffuse;
      light.specular[i] = specular;
    }
    light.attenuation[0] = 1.0F;
    light.cutoff = 180.0F;
    light.directional = 1;
  }

  engine::Rendered rendered_scene() {
    engine::Rendered rendered;
    rendered.width = options_.samples * options_.width;
    rendered.height = options_.samples * options_.height;
    const auto pixels =
        static_cast<std::size_t>(rendered.width) * static_cast<std::size_t>(rendered.height);
    rendered.rgb.resize(3 * pixels);
    rendered.depth.resize(pixels);
    const mjrRect all{0, 0, rendered.width, rendered.height};
    std::uint8_t* rgb = rendered.rgb.data();
    float* depth = rendered.depth.data();
    mjvScene* scene = &scene_;
    mjrContext* drawn = &drawn_;
    const OffscreenContext::Use use(*context_);
    drawing([=] {
      mjr_setBuffer(mjFB_OFFSCREEN, drawn);
      mjr_render(all, scene, drawn);
      mjr_readPixels(rgb, depth, all, drawn);
    });
    return rendered;
  }

  EngineModel model_;
  Scenery scenery_;
  RenderOptions options_;
  std::vector<Index> bodies_;  // of each shape of the scenery
  ViewDirection direction_{"", 0.0, 0.0};
  int own_camera_ = -1;
  std::optional<Framing> framing_;
  Vector3 focus_ = Vector3::Zero();
  std::unique_ptr<OffscreenContext> context_;
  mjvScene scene_;
  mjrContext drawn_;
};

Renderer::Renderer(const EngineModel& model, const Scenery& scenery, const RenderOptions& options)
    : impl_(std::make_unique<Impl>(model, scenery, options)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

int Renderer::width() const { return impl_->options().width; }
int Renderer::height() const { return impl_->options().height; }
const std::string& Renderer::backend() const { return impl_->backend(); }

void Renderer::draw(const EngineRun& run, const std::vector<Shape>& shapes, std::uint8_t* rgb,
                    float* depth) {
  impl_->draw(run, shapes, rgb, depth);
}

}  // namespace ulna
