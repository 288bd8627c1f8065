// The engine's models and runs: physics known in closed form, numbers changed in the compiled
// model, faults that must not end the process, one model for several threads.
#include "plant/engine/model.hpp"

#include <gtest/gtest.h>
#include <mujoco/mjdata.h>
#include <unistd.h>

#include <atomic>
#include <clocale>
#include <cmath>
#include <fstream>
#include <limits>
#include <thread>

#include "base/error.hpp"
#include "plant/engine/mjcf.hpp"
#include "plant/engine/run.hpp"
#include "refusal.hpp"

namespace ulna {
namespace {

using made::expect_refusal;
using made::refusal_of;
using made::says;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Numbers {
  double timestep = 1e-3;
  double mass = 1.5;
  std::vector<double> com = {0.01, 0.02, -0.3};
  std::vector<double> inertia = {0.03, 0.025, 0.01, 0.001, -0.002, 0.003};
  std::vector<double> fore = {0.0, 0.01, -0.6};  // second body in the first
  std::vector<double> site = {0.02, 0.0, -0.2};  // on the second body
  std::vector<double> length = {0.2, 0.5};
  std::vector<double> muscle = {300.0, 0.7, 1.1};
  std::vector<double> reference = {-500.0, -30.0};
  double damping = 0.0;
  double friction = 0.0;
};

Eigen::Map<const Vector> as(const std::vector<double>& v) {
  return {v.data(), static_cast<Index>(v.size())};
}

Eigen::Matrix3d full(const std::vector<double>& m) {
  Eigen::Matrix3d inertia;
  inertia << m[0], m[3], m[4], m[3], m[1], m[5], m[4], m[5], m[2];
  return inertia;
}

void joint(MjcfElement body, const std::string& name, const Numbers& n) {
  body.named("joint", name)
      .set("axis", {0, 1, 0})
      .set("damping", n.damping)
      .set("frictionloss", n.friction);
}

// Two links, a muscle from the world to the second, and a constraint between the joints.
std::string two_links(const Numbers& n = {}) {
  MjcfDocument document("two links");
  MjcfElement root = document.root();
  root.child("compiler").set("angle", "radian");
  root.child("option").set("timestep", n.timestep);
  MjcfElement world = root.child("worldbody");
  world.named("site", "origin").set("pos", {0.1, 0.0, 0.0});
  MjcfElement first = world.named("body", "first");
  first.inertial(n.mass, as(n.com), full(n.inertia));
  joint(first, "shoulder", n);
  MjcfElement second = first.named("body", "second").set("pos", as(n.fore));
  second.child("inertial")
      .set("pos", {0, 0, -0.2})
      .set("mass", 0.7)
      .set("diaginertia", {0.02, 0.02, 0.001});
  joint(second, "elbow", n);
  second.named("site", "insertion").set("pos", as(n.site));
  MjcfElement path = root.child("tendon").named("spatial", "biceps");
  path.child("site").set("site", "origin");
  path.child("site").set("site", "insertion");
  root.child("actuator")
      .named("muscle", "biceps")
      .set("tendon", "biceps")
      .set("force", n.muscle[0])
      .set("range", {n.muscle[1], n.muscle[2]})
      .set("lengthrange", as(n.length));
  root.child("equality")
      .named("joint", "coupling")
      .set("joint1", "shoulder")
      .set("joint2", "elbow")
      .set("active", "false")
      .set("solref", as(n.reference));
  return document.text();
}

double energy_of(EngineRun& run) { return run.potential_energy() + run.kinetic_energy(); }

// Semi-implicit Euler keeps the energy up to an error of first order that does not grow: half the
// step, half the error.
TEST(Engine, PendulumKeepsItsEnergy) {
  double before = 0.0;
  for (const double timestep : {1e-3, 0.5e-3}) {
    // A muscle that is never long enough to resist.
    EngineRun run(EngineModel::from_text(two_links({.timestep = timestep, .length = {1.5, 3.0}})));
    run.position() << 1.0, 0.5;
    run.forward();
    const double start = energy_of(run);
    double worst = 0.0;
    for (int i = 0; i < 200; ++i) {
      run.step(static_cast<Index>(std::lround(0.01 / timestep)));
      run.forward();
      worst = std::max(worst, std::fabs(energy_of(run) - start));
    }
    EXPECT_LT(worst, 0.05 * 1.5 * 9.81 * 0.6) << timestep;  // of the height it falls through
    EXPECT_GT(worst, 1e-5);                                 // it does move
    if (before > 0.0) {
      EXPECT_NEAR(before / worst, 2.0, 0.3);
    }
    before = worst;
  }
}

// Smallest model with a period in closed form: small swings of a rod about its end.
TEST(Engine, PendulumHasItsPeriod) {
  MjcfDocument document("rod");
  document.root().child("option").set("timestep", 1e-4);
  MjcfElement body = document.root().child("worldbody").named("body", "rod");
  body.child("inertial")
      .set("pos", {0, 0, -0.5})
      .set("mass", 2.0)
      .set("diaginertia", {0.2, 0.2, 0.01});
  body.named("joint", "pivot").set("axis", {0, 1, 0});
  EngineRun run(EngineModel::from_text(document.text()));
  run.position()[0] = 1e-3;
  double crossed = 0.0;  // the first time the angle is zero: a quarter of the period
  while (run.position()[0] > 0.0) {
    run.step();
    crossed = run.time();
  }
  const double inertia = 0.2 + 2.0 * 0.25;
  const double period = 2.0 * kPi * std::sqrt(inertia / (2.0 * 9.81 * 0.5));
  EXPECT_NEAR(4.0 * crossed, period, 4.0 * 2e-4);  // the step's resolution
}

TEST(Engine, ChangedModelEqualsARecompiledOne) {
  const EngineModel model = EngineModel::from_text(two_links());
  const Numbers n = {.mass = 2.1,
                     .com = {0.0, 0.01, -0.25},
                     .inertia = {0.05, 0.04, 0.02, -0.002, 0.001, 0.004},
                     .fore = {0.01, 0.0, -0.55},
                     .site = {0.03, 0.01, -0.15},
                     .length = {0.25, 0.6},
                     .muscle = {410.0, 0.8, 1.2},
                     .reference = {-900.0, -50.0},
                     .damping = 0.3,
                     .friction = 0.1};
  std::vector<double> inertia = n.com;
  inertia.insert(inertia.end(), n.inertia.begin(), n.inertia.end());
  const EngineModel changed = model.changed({
      {ModelQuantity::kMass, "first", {n.mass}},
      {ModelQuantity::kInertia, "first", inertia},
      {ModelQuantity::kBodyPosition, "second", n.fore},
      {ModelQuantity::kSitePosition, "insertion", n.site},
      {ModelQuantity::kLengthRange, "biceps", n.length},
      {ModelQuantity::kMuscle, "biceps", n.muscle},
      {ModelQuantity::kReference, "coupling", n.reference},
      {ModelQuantity::kJointDamping, "shoulder", {n.damping}},
      {ModelQuantity::kJointDamping, "elbow", {n.damping}},
      {ModelQuantity::kJointFriction, "shoulder", {n.friction}},
      {ModelQuantity::kJointFriction, "elbow", {n.friction}},
  });
  const EngineModel recompiled = EngineModel::from_text(two_links(n));
  for (const ArrayDifference& d : changed.differences(recompiled)) {
    // The compiler reads the same decimals and derives by the same functions; what is left is the
    // order of operations in the principal axes.
    EXPECT_LT(d.difference, 1e-14) << d.array;
  }
  // The test can fail: unchanged, the models differ in many arrays.
  EXPECT_GT(model.differences(recompiled).size(), 10U);
  EXPECT_TRUE(model.differences(EngineModel::from_text(two_links())).empty());
}

TEST(Engine, ChangesThatVanishKeepTheFramesRight) {
  // A site and a centre of mass moved to and from the body's origin: the compiler keeps notes about
  // frames that coincide.
  const Numbers at_origin = {
      .com = {0, 0, 0}, .inertia = {0.03, 0.025, 0.01, 0, 0, 0}, .site = {0, 0, 0}};
  const EngineModel away = EngineModel::from_text(two_links());
  const EngineModel origin = EngineModel::from_text(two_links(at_origin));
  const auto inertia = [](const Numbers& n) {
    std::vector<double> all = n.com;
    all.insert(all.end(), n.inertia.begin(), n.inertia.end());
    return all;
  };
  const auto move = [&](const EngineModel& from, const Numbers& to) {
    return from.changed({{ModelQuantity::kInertia, "first", inertia(to)},
                         {ModelQuantity::kSitePosition, "insertion", to.site}});
  };
  for (const ArrayDifference& d : move(away, at_origin).differences(origin)) {
    EXPECT_LT(d.difference, 1e-14) << d.array;
  }
  for (const ArrayDifference& d : move(origin, {}).differences(away)) {
    EXPECT_LT(d.difference, 1e-14) << d.array;
  }
}

TEST(Engine, ValuesAreWhatAChangeWrites) {
  const EngineModel model = EngineModel::from_text(two_links());
  for (const ModelQuantity quantity :
       {ModelQuantity::kMass, ModelQuantity::kInertia, ModelQuantity::kBodyPosition}) {
    const auto values = model.values(quantity, "second");
    for (const ArrayDifference& d :
         model.changed({{quantity, "second", values}}).differences(model)) {
      EXPECT_LT(d.difference, 1e-14) << d.array;
    }
  }
  EXPECT_EQ(model.values(ModelQuantity::kMuscle, "biceps"), (std::vector<double>{300.0, 0.7, 1.1}));
  EXPECT_EQ(model.values(ModelQuantity::kReference, "coupling"),
            (std::vector<double>{-500.0, -30.0}));
}

TEST(Engine, ImpossibleChangesNameThePart) {
  const EngineModel m = EngineModel::from_text(two_links());
  const auto refused = [&](ModelQuantity q, const std::string& name, std::vector<double> values,
                           const std::string& words) {
    expect_refusal([&] { m.changed({{q, name, std::move(values)}}); }, words);
  };
  refused(ModelQuantity::kMass, "first", {-1.0}, "the mass of body 'first' must be positive");
  refused(ModelQuantity::kMass, "first", {kNan}, "not finite");
  refused(ModelQuantity::kMass, "first", {1.0, 2.0}, "takes 1 numbers, not 2");
  refused(ModelQuantity::kMass, "third", {1.0},
          "there is no body 'third'; the names are: world, first");
  refused(ModelQuantity::kMass, "world", {1.0}, "it is the world");
  refused(ModelQuantity::kInertia, "first", {0, 0, 0, 1, 1, 3, 0, 0, 0}, "triangle inequality");
  refused(ModelQuantity::kInertia, "first", {0, 0, 0, 1, 1, 1, 2, 0, 0}, "not positive");
  refused(ModelQuantity::kLengthRange, "biceps", {0.3, 0.2}, "the shorter first");
  refused(ModelQuantity::kMuscle, "biceps", {-1.0, 0.7, 1.0}, "positive peak force");
  refused(ModelQuantity::kJointFriction, "elbow", {-1.0}, "must not be negative");
}

TEST(Engine, ScenesThatDoNotCompileSaySoInOneSentence) {
  expect_refusal([] { EngineModel::from_text("<mujoco><wordbody/></mujoco>"); },
                 "the scene cannot be compiled: ", Fault::kFormat);
  expect_refusal([] { EngineModel::from_text("no text of a scene"); },
                 "the scene cannot be compiled: ", Fault::kFormat);
  expect_refusal([] { EngineModel::from_text(""); }, "empty");
  expect_refusal([] { EngineModel::from_file("/nowhere/scene.xml"); }, "/nowhere/scene.xml",
                 Fault::kFile);
  expect_refusal([] { EngineModel::from_text(two_links({.mass = -1.0})); }, "mass", Fault::kFormat);
  expect_refusal([] { EngineModel::from_text(two_links(), {.contacts = -1}); }, "contacts");
}

TEST(Engine, InputsThatAreNotFiniteAreRefusedAndLeaveTheRunUsable) {
  EngineRun run(EngineModel::from_text(two_links()));
  run.control()[0] = kNan;
  expect_refusal([&] { run.step(); }, "control of actuator 'biceps'", Fault::kData);
  run.control()[0] = 0.5;
  run.velocity()[1] = kNan;
  expect_refusal([&] { run.step(); }, "velocity of joint 'elbow'", Fault::kData);
  run.velocity()[1] = 0.0;
  EXPECT_FALSE(run.faulted());
  run.step();
  expect_refusal([&] { run.inverse(Vector::Zero(3)); }, "acceleration");
  expect_refusal([&] { run.step(-1); }, "steps");
}

// The engine would set the state back to the reference and go on; the run says so and ends.
TEST(Engine, DivergenceEndsTheRun) {
  EngineRun run(EngineModel::from_text(two_links()));
  run.applied()[0] = 1e14;
  expect_refusal([&] { run.step(100); }, "joint 'shoulder' diverged at", Fault::kAnalysis);
  EXPECT_TRUE(run.faulted());
  expect_refusal([&] { run.step(); }, "can only be freed");
  expect_refusal([&] { run.reset(); }, "diverged");
}

TEST(Engine, MusclesThatWouldPushEndTheRun) {
  EngineRun run(EngineModel::from_text(two_links({.length = {3.0, 4.0}, .muscle = {300, 0.6, 1}})));
  run.activation()[0] = 1.0;
  expect_refusal([&] { run.forward(); }, "muscle 'biceps' became shorter", Fault::kUnsupported);
  EXPECT_TRUE(run.faulted());
}

// Spheres in a row on a floor; closer than 0.2 m they touch.
std::string pile(int count, double spacing = 0.01) {
  MjcfDocument document("pile");
  document.root().child("size").set("njmax", 3000).set("nconmax", 700);
  MjcfElement world = document.root().child("worldbody");
  world.named("geom", "floor").set("type", "plane").set("size", {1, 1, 0.1});
  for (int i = 0; i < count; ++i) {
    MjcfElement ball =
        world.named("body", "ball" + std::to_string(i)).set("pos", {spacing * i, 0, 0.09});
    ball.child("freejoint");
    ball.child("geom").set("type", "sphere").set("size", 0.1);
  }
  return document.text();
}

TEST(Engine, MoreContactsThanThereIsRoomForEndTheRun) {
  // The constructor already computes the contacts of the reference configuration.
  const EngineModel small = EngineModel::from_text(pile(8), {.contacts = 3});
  expect_refusal([&] { EngineRun run(small); }, "room for (3)", Fault::kUnsupported);
  // The sizes that a scene's text asks for do not count: they come from the model.
  EngineRun run(EngineModel::from_text(pile(8), {.contacts = 100}));
  EXPECT_GT(run.contacts(), 30);
  run.step(10);
}

TEST(Engine, TheEnginesFatalErrorsAreContained) {
  // A step after the stack was made too small is the engine's own fatal error.
  const EngineModel model = EngineModel::from_text(pile(8), {.contacts = 100});
  EngineRun run(model);
  run.step();
  const_cast<mjData*>(run.raw())->nstack = 10;
  const Error error = refusal_of([&] { run.step(); });
  EXPECT_EQ(error.fault(), Fault::kMemory) << error.what();
  EXPECT_TRUE(says(error, "the engine gave up at")) << error.what();
  EXPECT_TRUE(run.faulted());
  expect_refusal([&] { run.forward(); }, "can only be freed");
  EngineRun another(model);  // nothing but that run was lost
  another.step(5);
}

// Two threads, one model: the bits of one thread alone.
TEST(Engine, ThreadsShareAModelAndGetTheSameBits) {
  const EngineModel model = EngineModel::from_text(pile(6), {.contacts = 100});
  const auto simulate = [&model](Vector& end) {
    EngineRun run(model);
    run.step(60);
    end = run.position();
  };
  Vector alone;
  simulate(alone);
  for (int repeat = 0; repeat < 3; ++repeat) {
    Vector a;
    Vector b;
    std::thread first(simulate, std::ref(a));
    std::thread second(simulate, std::ref(b));
    first.join();
    second.join();
    EXPECT_TRUE(a == alone && b == alone);
  }
}

TEST(Engine, ThreadsCompileAtOnce) {
  std::vector<std::thread> threads;
  std::atomic<int> made{0};
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&made] {
      for (int k = 0; k < 5; ++k) made += EngineModel::from_text(two_links()).velocities() == 2;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(made.load(), 20);
}

TEST(Engine, NumbersAreReadWithAPointWhateverTheLocale) {
  const char* former = std::setlocale(LC_ALL, nullptr);
  const std::string kept = former;
  if (std::setlocale(LC_ALL, "de_DE.UTF-8") == nullptr) GTEST_SKIP() << "no such locale here";
  const double timestep = EngineModel::from_text(two_links({.timestep = 0.0125})).timestep();
  std::setlocale(LC_ALL, kept.c_str());
  EXPECT_EQ(timestep, 0.0125);
}

double resident_megabytes() {
  std::ifstream file("/proc/self/statm");
  double size = 0.0;
  double resident = 0.0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// A scene with as many rows of constraints as the soft interface needs (about 1500) stays below
// 60 MB a run; the engine's own sizes for the published scene take 1.8 GB.
TEST(Engine, RunsAreSmall) {
  const EngineModel model = EngineModel::from_text(pile(60, 0.3), {.contacts = 300});
  EXPECT_GE(model.constraint_rows(), 1500);
  const double before = resident_megabytes();
  std::vector<std::unique_ptr<EngineRun>> runs;
  constexpr int kRuns = 4;
  for (int i = 0; i < kRuns; ++i) {
    runs.push_back(std::make_unique<EngineRun>(model));
    runs.back()->step(5);
  }
  const double each = (resident_megabytes() - before) / kRuns;
  RecordProperty("megabytes", std::to_string(each));
  EXPECT_LT(each, 60.0);
}

TEST(Engine, InverseAndForwardDynamicsAgree) {
  EngineRun run(EngineModel::from_text(two_links({.damping = 0.2})));
  run.position() << 0.7, -0.4;
  run.velocity() << 1.1, -2.0;
  run.applied() << 0.3, -0.2;
  run.forward();
  const Vector acceleration = run.acceleration();
  const Vector driving = run.applied() + run.actuator_torque();  // a muscle pulls when long
  EXPECT_LT((run.inverse(acceleration) - driving).norm(), 1e-12);
  // And by its parts: M a + c = passive + applied.
  const Vector left = run.inertia() * acceleration + Vector(run.bias());
  EXPECT_LT((left - run.passive() - driving).norm(), 1e-12);
}

}  // namespace
}  // namespace ulna
