// Pictures: that they show what is there, where it is, in its colour; that drawing changes nothing;
// and what is said without OpenGL. Where there is no OpenGL the first are skipped with its words.
#include "plant/engine/renderer.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <thread>

#include "base/error.hpp"
#include "plant/engine/compose.hpp"
#include "plant/exo_plant.hpp"
#include "plant/exo_scenery.hpp"
#include "plant/soft_scenery.hpp"
#include "refusal.hpp"

namespace ulna {
namespace {

using made::expect_refusal;

using engine::OffscreenContext;
using engine::OffscreenKind;

#define SKIP_WITHOUT_OPENGL()     \
  try {                           \
    OffscreenContext::open();     \
  } catch (const Error& error) {  \
    GTEST_SKIP() << error.what(); \
  }                               \
  static_assert(true)

constexpr const char* kBall = R"(<mujoco><worldbody>
  <camera name="above" pos="0 0 3" xyaxes="1 0 0 0 1 0"/>
  <body name="ball"><joint name="slide" type="slide" axis="1 0 0"/>
  <geom type="sphere" size="0.2" mass="1" rgba="1 0 0 1"/></body></worldbody></mujoco>)";

RenderOptions small(int width = 160, int height = 120) {
  RenderOptions options;
  options.width = width;
  options.height = height;
  return options;
}

struct Shot {
  int width, height;
  std::vector<std::uint8_t> rgb;
  std::vector<float> depth;

  std::array<int, 3> at(int x, int y) const {
    const auto place = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                            static_cast<std::size_t>(x));
    return {rgb[place], rgb[place + 1], rgb[place + 2]};
  }
  float depth_at(int x, int y) const {
    return depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(x)];
  }
  int count(const std::function<bool(int, int, int)>& is) const {
    int pixels = 0;
    for (std::size_t i = 0; i < rgb.size(); i += 3) pixels += is(rgb[i], rgb[i + 1], rgb[i + 2]);
    return pixels;
  }
};

Shot shoot(Renderer& renderer, const EngineRun& run, const std::vector<Shape>& shapes = {}) {
  Shot shot{renderer.width(), renderer.height(), {}, {}};
  const auto pixels = static_cast<std::size_t>(shot.width) * static_cast<std::size_t>(shot.height);
  shot.rgb.resize(3 * pixels);
  shot.depth.resize(pixels);
  renderer.draw(run, shapes, shot.rgb.data(), shot.depth.data());
  return shot;
}

bool red(int r, int g, int b) { return r > 90 && r > 2 * g && r > 2 * b; }
bool blue(int r, int g, int b) { return b > 90 && b > 2 * r && b > g + g / 3; }

TEST(Renderer, ShowsABallWhereItIs) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  EngineRun run(model);
  RenderOptions options = small();
  options.camera.look_at = Vector3::Zero();
  options.camera.distance = 2.0;
  options.camera.azimuth = 0.5 * kPi;  // x is to the right
  options.camera.elevation = 0.0;
  options.samples = 1;  // so that a pixel is the ball's or not
  Renderer renderer(model, {}, options);
  const Shot middle = shoot(renderer, run);
  EXPECT_TRUE(red(middle.at(80, 60)[0], middle.at(80, 60)[1], middle.at(80, 60)[2]));
  EXPECT_NEAR(middle.depth_at(80, 60), 1.8, 2e-3);  // facets of the engine's sphere
  EXPECT_TRUE(std::isinf(middle.depth_at(2, 2)));
  EXPECT_GT(middle.at(2, 2)[0], 200);  // a light background
  // Half the angle of view is 11 degrees: the ball's rim is where a tangent of the sphere goes.
  const double rim = 0.2 / std::sqrt(4.0 - 0.04) / std::tan(11 * kDegree) * 60.0;
  const auto solid = std::count_if(middle.depth.begin(), middle.depth.end(),
                                   [](float z) { return !std::isinf(z); });
  EXPECT_NEAR(static_cast<double>(solid), kPi * rim * rim, 0.02 * kPi * rim * rim);

  run.position()[0] = 0.3;
  run.forward();
  const Shot right = shoot(renderer, run);
  const int column = 80 + static_cast<int>(std::lround(0.15 / std::tan(11 * kDegree) * 60.0));
  EXPECT_TRUE(red(right.at(column, 60)[0], right.at(column, 60)[1], right.at(column, 60)[2]));
  EXPECT_FALSE(red(right.at(80, 60)[0], right.at(80, 60)[1], right.at(80, 60)[2]));
}

TEST(Renderer, TopRowIsUp) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  RenderOptions options = small();
  options.camera.look_at = Vector3(0.0, 0.0, -0.4);
  options.camera.distance = 3.0;
  options.camera.elevation = 0.0;
  Renderer renderer(model, {}, options);
  const Shot shot = shoot(renderer, EngineRun(model));
  int above = 0, below = 0;
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const auto p = shot.at(x, y);
      if (red(p[0], p[1], p[2])) (y < 60 ? above : below) += 1;
    }
  }
  EXPECT_GT(above, 100);
  EXPECT_EQ(below, 0);
}

TEST(Renderer, FramesWhatThereIs) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  for (const char* name : {"", "device", "side", "front", "back", "top", "above"}) {
    RenderOptions options = small();
    options.camera.name = name;
    Renderer renderer(model, {}, options);
    const Shot shot = shoot(renderer, EngineRun(model));
    EXPECT_GT(shot.count(red), 200) << name;
    for (int x = 0; x < 160; ++x) EXPECT_TRUE(std::isinf(shot.depth_at(x, 0))) << name;
  }
}

TEST(Renderer, ScalesWithItsSamplesAndSize) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  std::vector<double> shares;
  for (const int samples : {1, 2, 3}) {
    RenderOptions options = small(64 * samples, 80);
    options.samples = samples;
    options.camera.distance = 3.0;
    options.camera.look_at = Vector3::Zero();
    Renderer renderer(model, {}, options);
    EXPECT_EQ(renderer.width(), 64 * samples);
    shares.push_back(shoot(renderer, EngineRun(model)).count(red));
  }
  // The height fixes the scale: a wider picture shows more around.
  EXPECT_NEAR(shares[1], shares[0], 0.08 * shares[0]);
  EXPECT_NEAR(shares[2], shares[0], 0.08 * shares[0]);
}

TEST(Renderer, MusclesTurnFromBlueToRed) {
  SKIP_WITHOUT_OPENGL();
  ExoScene scene;
  scene.coupling = Coupling::kArmOnly;
  const ExoPlant plant(scene);
  ExoLookOptions look;
  look.person = look.skin = false;
  RenderOptions options = small(240, 160);
  options.camera.name = "side";
  Renderer renderer(plant.model(), scenery_of(scene, look), options);
  EngineRun run(plant.model());
  const Shot rest = shoot(renderer, run);
  run.activation().setOnes();
  run.forward();
  const Shot full = shoot(renderer, run);
  EXPECT_GT(rest.count(blue), 300);
  EXPECT_LT(rest.count(red), 20);
  EXPECT_GT(full.count(red), 300);
  EXPECT_LT(full.count(blue), 20);
}

TEST(Renderer, ShowsDeviceAndArmInEveryWayOfHolding) {
  SKIP_WITHOUT_OPENGL();
  for (const Coupling coupling :
       {Coupling::kRigid, Coupling::kApart, Coupling::kExoOnly, Coupling::kArmOnly}) {
    ExoScene scene;
    scene.coupling = coupling;
    const ExoPlant plant(scene);
    Renderer renderer(plant.model(), scenery_of(scene), small());
    EngineRun run(plant.model());
    const Shot straight = shoot(renderer, run);
    run.position()[plant.model().positions() - 1] = 1.5;
    run.forward();
    const Shot bent = shoot(renderer, run);
    int moved = 0;
    for (std::size_t i = 0; i < straight.rgb.size(); ++i) moved += straight.rgb[i] != bent.rgb[i];
    EXPECT_GT(moved, 500) << static_cast<int>(coupling);
    // Neither empty nor full.
    int solid = 0;
    for (const float z : straight.depth) solid += !std::isinf(z);
    EXPECT_GT(solid, 2000) << static_cast<int>(coupling);
    EXPECT_LT(solid, 17000) << static_cast<int>(coupling);
  }
}

TEST(Renderer, DrawingChangesNothing) {
  SKIP_WITHOUT_OPENGL();
  const ExoPlant plant{ExoScene{}};
  EngineRun drawn(plant.model()), plain(plant.model());
  Renderer renderer(plant.model(), scenery_of(plant.scene()), small());
  for (int i = 0; i < 5; ++i) {
    for (EngineRun* run : {&drawn, &plain}) {
      run->control().setConstant(0.3);
      run->step(10);
    }
    shoot(renderer, drawn);
    EXPECT_EQ(drawn.position(), plain.position());
    EXPECT_EQ(drawn.velocity(), plain.velocity());
    EXPECT_EQ(drawn.acceleration(), plain.acceleration());
  }
  EXPECT_EQ(plant.model().count(Part::kGeom), 2);  // what is drawn is not in the model
}

TEST(Renderer, TheSamePictureTwiceAndOnTwoThreads) {
  SKIP_WITHOUT_OPENGL();
  const ExoPlant plant{ExoScene{}};
  const Scenery scenery = scenery_of(plant.scene());
  const auto draw = [&] {
    Renderer renderer(plant.model(), scenery, small());
    return shoot(renderer, EngineRun(plant.model())).rgb;
  };
  const std::vector<std::uint8_t> first = draw();
  std::vector<std::uint8_t> a, b;
  std::thread one([&] { a = draw(); });
  std::thread two([&] { b = draw(); });
  one.join();
  two.join();
  EXPECT_EQ(a, first);
  EXPECT_EQ(b, first);
}

TEST(Renderer, WandersBetweenThreads) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  const EngineRun run(model);
  std::optional<Renderer> renderer;
  std::thread([&] { renderer.emplace(model, Scenery{}, small()); }).join();
  const Shot here = shoot(*renderer, run);
  Shot there;
  std::thread([&] { there = shoot(*renderer, run); }).join();
  std::thread([&] { renderer.reset(); }).join();
  EXPECT_EQ(here.rgb, there.rgb);
}

TEST(Renderer, ArrowsAndTranslucentShapes) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  const EngineRun run(model);
  RenderOptions options = small();
  options.camera.distance = 1.5;
  options.camera.look_at = Vector3::Zero();
  Renderer renderer(model, {}, options);
  const Shot bare = shoot(renderer, run);
  const Matrix point = Vector3(0.3, 0.0, 0.2).transpose();
  const Matrix force = Vector3(0.0, 0.0, 50.0).transpose();
  const auto arrows = force_arrows(point, force, 0.003, {0.0F, 0.0F, 1.0F, 1.0F});
  ASSERT_EQ(arrows.size(), 1U);
  EXPECT_NEAR(arrows[0].size.z(), 0.15, 1e-12);
  EXPECT_GT(shoot(renderer, run, arrows).count(blue), 20);
  EXPECT_TRUE(force_arrows(point, Matrix::Zero(1, 3), 0.003, {}).empty());
  EXPECT_THROW(force_arrows(point, Matrix::Zero(2, 3), 0.003, {}), Error);
  EXPECT_THROW(force_arrows(point, Matrix::Constant(1, 3, kNaN), 0.003, {}), Error);

  // Through a grey veil before everything the background is darker, and still not black.
  Shape veil{.kind = ShapeKind::kSphere, .size = {0.9, 0.0, 0.0}};
  veil.colour = {0.2F, 0.2F, 0.2F, 0.3F};
  const Shot dim = shoot(renderer, run, {veil});
  EXPECT_LT(dim.at(80, 20)[0], bare.at(80, 20)[0] - 20);
  EXPECT_GT(dim.at(80, 20)[0], 90);
}

TEST(Renderer, ArrowsAndRodsEndWhereTheyShould) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  EngineRun run(model);
  run.position()[0] = -5.0;  // out of the picture
  run.forward();
  RenderOptions options = small(400, 100);
  options.samples = 1;
  options.camera.look_at = Vector3::Zero();
  options.camera.distance = 3.0;
  options.camera.azimuth = 0.5 * kPi;
  options.camera.elevation = 0.0;
  Renderer renderer(model, {}, options);
  const double pixels = 50.0 / (3.0 * std::tan(11 * kDegree));  // a metre
  for (const ShapeKind kind : {ShapeKind::kArrow, ShapeKind::kCylinder}) {
    const Shape rod = bar({-0.3, 0.0, 0.0}, {0.5, 0.0, 0.0}, 0.02, {1, 0, 0, 1}, kind);
    const Shot shot = shoot(renderer, run, {rod});
    int first = 400, last = 0;
    for (int x = 0; x < 400; ++x) {
      for (int y = 0; y < 100; ++y) {
        if (std::isinf(shot.depth_at(x, y))) continue;
        first = std::min(first, x);
        last = std::max(last, x);
      }
    }
    EXPECT_NEAR(first, 200 - 0.3 * pixels, 2.0) << static_cast<int>(kind);
    // The point of an arrow is narrower than a pixel over its last five.
    EXPECT_NEAR(last, 200 + 0.5 * pixels, kind == ShapeKind::kArrow ? 6.0 : 2.0);
  }
}

TEST(Renderer, SoftInterfacesShowTheirForces) {
  SKIP_WITHOUT_OPENGL();
  const SoftPlant plant(SoftScene::of(ExoScene{}));
  EngineRun run(plant.model());
  EXPECT_EQ(interface_shapes(plant, run).size(), 2U);  // tissue alone
  Vector start(4);
  start << 0.0, -0.5 * kPi, 0.0, 1.2;
  plant.attach(run, start);
  run.step(3);
  const std::vector<Shape> shapes = interface_shapes(plant, run);
  EXPECT_GT(shapes.size(), 60U);  // straps, pressed places, arrows
  InterfaceLook bare;
  bare.tissue = bare.straps = false;
  EXPECT_EQ(interface_shapes(plant, run, bare).size(), 4U);
  EXPECT_EQ(interface_shapes(plant, run, bare, Matrix::Zero(2, 6)).size(), 0U);
  InterfaceLook tissue = bare;
  tissue.tissue = true;
  tissue.forces = false;
  EXPECT_GT(interface_shapes(plant, run, tissue).size(), 10U);
  EXPECT_EQ(interface_shapes(plant, run, tissue, Matrix::Zero(2, 6)).size(), 2U);
  const std::vector<Shape> given = interface_shapes(plant, run, bare, Matrix::Constant(2, 6, 10.0));
  ASSERT_EQ(given.size(), 4U);
  EXPECT_NEAR(given[0].size.z(), bare.force_scale * 10.0 * std::sqrt(3.0), 1e-9);
  EXPECT_THROW(interface_shapes(plant, run, bare, Matrix::Zero(1, 6)), Error);
  Renderer renderer(plant.model(), scenery_of(plant), small());
  EXPECT_NE(shoot(renderer, run).rgb, shoot(renderer, run, shapes).rgb);
  const std::vector<std::string> both = {"J4", "elbow_flexion"};  // a film has room for either
  EXPECT_EQ(scenery_of(plant).sweep, both);
}

TEST(Renderer, WhatCannotBeSaysWhy) {
  SKIP_WITHOUT_OPENGL();
  const EngineModel model = EngineModel::from_text(kBall);
  const auto refused = [&](const std::string& words, const std::function<void(RenderOptions&)>& f) {
    RenderOptions options = small();
    f(options);
    expect_refusal([&] { Renderer renderer(model, {}, options); }, words);
  };
  refused("between 16 and 7680", [](RenderOptions& o) { o.width = 8; });
  refused("between 16 and 7680", [](RenderOptions& o) { o.height = 100000; });
  refused("between 1 and 4", [](RenderOptions& o) { o.samples = 5; });
  refused("15360", [](RenderOptions& o) { o.width = 7680, o.samples = 3; });
  refused("there is no camera 'left'; the names are: device, side, front, back, top, above",
          [](RenderOptions& o) { o.camera.name = "left"; });
  refused("distance", [](RenderOptions& o) { o.camera.distance = 0.0; });
  refused("elevation", [](RenderOptions& o) { o.camera.elevation = 2.0; });
  refused("finite", [](RenderOptions& o) { o.camera.azimuth = kInfinity; });
  refused("three finite", [](RenderOptions& o) { o.camera.look_at[1] = 0.0; });
  Scenery lost;
  lost.shapes.push_back({"nobody", {}});
  expect_refusal([&] { Renderer renderer(model, lost, small()); }, "there is no body 'nobody'");

  Renderer renderer(model, {}, small());
  const ExoPlant other{ExoScene{}};
  expect_refusal([&] { shoot(renderer, EngineRun(other.model())); }, "another scene");
  Shape bad;
  bad.position[2] = kNaN;
  expect_refusal([&] { shoot(renderer, EngineRun(model), {bad}); }, "shape");
}

TEST(Renderer, WithoutOpenGlNamesThePackages) {
  const engine::OffscreenLibraries none{"libulna_no_egl.so", "libulna_no_osmesa.so"};
  expect_refusal([&] { OffscreenContext::open(OffscreenKind::kAny, none); },
                 "libegl1 and libegl-mesa0", Fault::kUnsupported);
  expect_refusal([&] { OffscreenContext::open(OffscreenKind::kAny, none); }, "libosmesa6",
                 Fault::kUnsupported);
  expect_refusal([&] { OffscreenContext::open(OffscreenKind::kOsmesa, none); }, "libosmesa6",
                 Fault::kUnsupported);
  // A library that is another one.
  expect_refusal(
      [&] {
        OffscreenContext::open(OffscreenKind::kEgl, {"libm.so.6", ""});
      },
      "has no egl", Fault::kUnsupported);
  const EngineModel model = EngineModel::from_text(kBall);
  RenderOptions options = small();
  options.libraries = none;
  expect_refusal([&] { Renderer renderer(model, {}, options); }, "everything else works without it",
                 Fault::kUnsupported);
  EngineRun run(model);
  run.step(10);
  EXPECT_NEAR(run.time(), 10 * model.timestep(), 1e-12);
}

// In a process of its own, because the engine finds OpenGL once for a process. Ends with 0 for a
// picture like that of the other way, 2 where OSMesa is not installed.
int draw_with_osmesa() {
  try {
    const EngineModel model = EngineModel::from_text(kBall);
    RenderOptions options = small();
    options.backend = OffscreenKind::kOsmesa;
    Renderer renderer(model, {}, options);
    const bool named = renderer.backend().rfind("OSMesa", 0) == 0;
    return named && shoot(renderer, EngineRun(model)).count(red) > 500 ? 0 : 1;
  } catch (const Error& error) {
    return error.fault() == Fault::kUnsupported ? 2 : 1;
  }
}

TEST(RendererDeathTest, DrawsWithOsmesa) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_EXIT(
      _exit(draw_with_osmesa()),
      [](int status) {
        const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
        if (code == 2) std::puts("OSMesa is not installed: not tested");
        return code == 0 || code == 2;
      },
      "");
}

TEST(Scenery, ActivationColours) {
  EXPECT_GT(activation_colour(0.0)[2], 0.7F);
  EXPECT_LT(activation_colour(0.0)[0], 0.3F);
  EXPECT_GT(activation_colour(1.0)[0], 0.7F);
  EXPECT_LT(activation_colour(1.0)[2], 0.3F);
  EXPECT_EQ(activation_colour(-1.0), activation_colour(0.0));
  EXPECT_EQ(activation_colour(7.0), activation_colour(1.0));
  EXPECT_EQ(activation_colour(kNaN), activation_colour(0.0));
  for (double a = 0.0; a < 1.0; a += 0.05) {
    EXPECT_GE(activation_colour(a + 0.05)[0], activation_colour(a)[0]);
    EXPECT_LE(activation_colour(a + 0.05)[2], activation_colour(a)[2]);
  }
}

TEST(Scenery, BarsReachFromPointToPoint) {
  const Vector3 a(0.1, -0.2, 0.3), b(-0.3, 0.2, -0.1);
  const Shape rod = bar(a, b, 0.01, {});
  EXPECT_LT((rod.position + rod.size.z() * rod.orientation.col(2) - b).norm(), 1e-12);
  EXPECT_LT((rod.position - rod.size.z() * rod.orientation.col(2) - a).norm(), 1e-12);
  EXPECT_NEAR(rod.orientation.determinant(), 1.0, 1e-12);
  const Shape arrow = bar(a, b, 0.01, {}, ShapeKind::kArrow);
  EXPECT_LT((arrow.position + arrow.size.z() * arrow.orientation.col(2) - b).norm(), 1e-12);
  EXPECT_EQ(bar(a, a, 0.01, {}).kind, ShapeKind::kSphere);
}

// One pixel of what is near, the rest a white wall: the floor's lines are where they should be.
TEST(Compose, FloorHasItsLinesToScale) {
  engine::Rendered rendered{400, 400, std::vector<std::uint8_t>(3 * 160000, 255),
                            std::vector<float>(160000, 0.9999F)};
  engine::View view{.position = {0.05, 0.05, 1.0},
                    .forward = -Vector3::UnitZ(),
                    .up = Vector3::UnitY(),
                    .tangent = 0.2,
                    .near = 0.1,
                    .far = 10.0};
  engine::Backdrop backdrop{.wall = 9.0, .floor = true, .radius = 10.0};
  std::vector<std::uint8_t> rgb(3 * 160000);
  std::vector<float> depth(160000);
  engine::compose(rendered, view, backdrop, 1, rgb.data(), depth.data());
  // Looking straight down from 1 m a pixel is 1 mm; lines of 0.1 m, the first at x = 0.
  std::vector<int> dark;
  for (int x = 1; x < 399; ++x) {
    const auto at = [&](int column) {
      return rgb[3 * (200 * 400 + static_cast<std::size_t>(column))];
    };
    if (at(x) < 215 && at(x) <= at(x - 1) && at(x) < at(x + 1)) dark.push_back(x);
  }
  ASSERT_EQ(dark.size(), 4U);
  for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(dark[k], 50 + 100 * static_cast<int>(k), 2);
  EXPECT_TRUE(std::isinf(depth[0]));
}

}  // namespace
}  // namespace ulna
