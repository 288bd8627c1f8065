// The exoskeleton and the arm: the published device's inertia, the nominal model against the
// engine, descriptions that cannot be, muscle curves and the isometric torque.
#include "plant/exo_plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "plant/arm_muscles.hpp"
#include "plant/isometric.hpp"
#include "plant/muscle_curves.hpp"
#include "plant/muscle_fit.hpp"
#include "refusal.hpp"

namespace ulna {
namespace {

using made::expect_refusal;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegree = kPi / 180.0;

ExoScene scene_of(Coupling coupling) {
  ExoScene scene;
  scene.coupling = coupling;
  return scene;
}

// A smooth spread of numbers between -1 and 1 for poses and motions.
Vector spread(Index size, int seed) {
  Vector v(size);
  for (Index i = 0; i < size; ++i) v[i] = std::sin(1.7 * static_cast<double>(i) + 2.3 * seed + 0.4);
  return v;
}

// Facts of the published simulation, three digits; its straps of 1.2 kg are part of them.
TEST(Exo, HasThePublishedInertiaInItsReference) {
  ExoScene scene = scene_of(Coupling::kExoOnly);
  scene.exo.use_published_straps();
  const ExoPlant plant(scene);
  EXPECT_NEAR(plant.model().reference()[1], -90 * kDegree, 1e-12);
  const Matrix inertia = EngineRun(plant.model()).inertia();
  const double published[] = {0.401, 0.403, 0.084, 0.0231};
  for (Index j = 0; j < 4; ++j) EXPECT_NEAR(inertia(j, j), published[j], 5.1e-4) << j;
  EXPECT_NEAR(inertia(3, 3), 0.0231, 5e-5);
}

// 0.106 kg m^2 about the elbow for the published arm at scale 1; the fingers are lumped here.
TEST(Exo, ForearmHasThePublishedInertiaAboutTheElbow) {
  const ExoPlant plant(scene_of(Coupling::kArmOnly));
  const Index elbow = plant.model().velocity_of("elbow_flexion");
  EXPECT_NEAR(EngineRun(plant.model()).inertia()(elbow, elbow), 0.106, 1e-3);
}

TEST(Exo, ArmHasThePublishedMasses) {
  const ArmDescription arm = ArmDescription::cylinders();
  EXPECT_NEAR(arm.humerus.mass + arm.upper_tissue.mass, 2.25, 1e-12);
  EXPECT_NEAR(arm.ulna.mass + arm.radius.mass + arm.fore_tissue.mass, 1.313, 1e-12);
  const ArmDescription person = ArmDescription::person(1.75, 70.0);
  EXPECT_NEAR((person.upper_scale * person.elbow).norm(), 0.172 * 1.75, 1e-12);
  EXPECT_NEAR(person.humerus.mass, 2.1, 1e-12);
  EXPECT_NEAR(person.ulna.mass + person.radius.mass, 1.225, 1e-12);
}

// Our recursion and the engine's, over poses and motions, for all ways of holding the arm.
TEST(Exo, NominalModelEqualsTheEngine) {
  for (const Coupling coupling :
       {Coupling::kRigid, Coupling::kApart, Coupling::kExoOnly, Coupling::kArmOnly}) {
    ExoScene scene = scene_of(coupling);
    scene.arm.muscles.clear();
    scene.arm.pronation = true;
    scene.arm.wrist = true;
    for (ExoLink& link : scene.exo.links) link.friction = 0.0;
    const ExoPlant plant(scene);
    EngineRun run(plant.model());
    const Index n = plant.model().velocities();
    ASSERT_EQ(plant.nominal().joints(), n);
    for (int seed = 0; seed < 20; ++seed) {
      const Matrix range = plant.model().joint_range();
      const Vector middle = 0.5 * (range.col(0) + range.col(1));
      const Vector half = 0.49 * (range.col(1) - range.col(0));
      const Vector angle = middle + half.cwiseProduct(spread(n, seed));
      const Vector rate = 3.0 * spread(n, seed + 100);
      const Vector acceleration = 20.0 * spread(n, seed + 200);
      run.position() = angle;
      run.velocity() = rate;
      const Vector engine = run.inverse(acceleration);
      const Vector nominal = plant.inverse_dynamics(angle, rate, acceleration, true);
      EXPECT_LT((engine - nominal).cwiseAbs().maxCoeff(), 1e-10);
      run.forward();
      EXPECT_LT((run.inertia() - plant.nominal().inertia(angle)).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

// Friction on and off differ by what the friction terms say, in the engine as in the nominal model.
TEST(Exo, FrictionExplainsTheDifferenceInTorque) {
  ExoScene rough = scene_of(Coupling::kRigid);
  rough.arm.muscles.clear();
  ExoScene smooth = rough;
  for (ExoLink& link : smooth.exo.links) link.friction = link.damping = 0.0;
  const ExoPlant with(rough);
  const ExoPlant without(smooth);
  EngineRun a(with.model());
  EngineRun b(without.model());
  Vector angle(4);
  angle << -0.5, -1.0, -0.3, 1.2;
  for (const double rate : {0.4, -1.3}) {
    for (EngineRun* run : {&a, &b}) {
      run->position() = angle;
      run->velocity().setConstant(rate);
    }
    const Vector acceleration = Vector::Constant(4, 0.7);
    const Vector difference = a.inverse(acceleration) - b.inverse(acceleration);
    Vector expected = Vector::Constant(4, rate);  // 1 N m s/rad
    expected[3] += std::copysign(2.787, rate);
    EXPECT_LT((difference - expected).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT((with.friction_torque(Vector::Constant(4, rate)) - expected).norm(), 1e-12);
  }
  EXPECT_EQ(with.friction_torque(Vector::Zero(4)).norm(), 0.0);  // Coulomb friction at rest
}

// A held arm and the device fall as one: a free arm at the same joints adds nothing else.
TEST(Exo, EnergyOfAFrictionlessDeviceStays) {
  ExoScene scene = scene_of(Coupling::kRigid);
  scene.arm.muscles.clear();
  scene.solver.timestep = 1e-4;
  for (ExoLink& link : scene.exo.links) {
    link.friction = link.damping = 0.0;
    link.lower = -10.0;  // no limits in the way
    link.upper = 10.0;
  }
  EngineRun run(ExoPlant(scene).model());
  run.position() << -0.4, -1.2, -0.2, 0.6;
  run.forward();
  const double start = run.potential_energy() + run.kinetic_energy();
  double fallen = 0.0;
  for (int i = 0; i < 20; ++i) {
    run.step(250);
    run.forward();
    fallen = std::max(fallen, run.kinetic_energy());
    // First order in the step: 1e-4 of what moves.
    EXPECT_NEAR(run.potential_energy() + run.kinetic_energy(), start, 2e-3 * (1.0 + fallen));
  }
  EXPECT_GT(fallen, 5.0);
}

TEST(Exo, DescriptionsThatCannotBeSayWhy) {
  const auto exo = [](auto spoil, const std::string& words) {
    ExoScene scene;
    spoil(scene.exo);
    expect_refusal([&] { ExoPlant plant(scene); }, words);
  };
  exo([](ExoDescription& e) { e.links[2].joint = ""; }, "link 'Link3' has no joint");
  exo([](ExoDescription& e) { e.links[1].mass = -3.0; }, "body 'Link2' must have a positive mass");
  exo([](ExoDescription& e) { e.links[0].centre[1] = kNan; }, "body 'Link1' holds a number");
  exo([](ExoDescription& e) { e.links[0].inertia[0] = 10.0; }, "triangle inequality");
  exo([](ExoDescription& e) { e.links[3].axis *= 2.0; }, "axis whose length is not 1");
  exo([](ExoDescription& e) { e.links[3].orientation(0, 0) = 0.5; }, "no rotation");
  exo([](ExoDescription& e) { e.links[3].lower = 4.0; }, "joint 'J4' must have a range");
  exo([](ExoDescription& e) { e.links[3].friction = -1.0; }, "joint 'J4' must have a friction");
  exo([](ExoDescription& e) { e.links[1].name = "Link1"; }, "two bodies have the name 'Link1'");
  exo([](ExoDescription& e) { e.links[3].joint = "J1"; }, "two joints have the name 'J1'");
  exo([](ExoDescription& e) { e.links.clear(); }, "no links");
  exo([](ExoDescription& e) { e.fore_link = "Link9"; }, "link 'Link9', which is not there");
  exo([](ExoDescription& e) { e.straps[0].mass = 0.0; }, "strap 'upper_strap' must have");
  const auto arm = [](auto spoil, const std::string& words) {
    ExoScene scene;
    spoil(scene.arm);
    expect_refusal([&] { ExoPlant plant(scene); }, words);
  };
  arm([](ArmDescription& a) { a.ulna.mass = 0.0; }, "the ulna must have a positive mass");
  arm([](ArmDescription& a) { a.muscles[0].force = kNan; }, "'triceps_long' must have a positive");
  arm([](ArmDescription& a) { a.muscles[0].range[0] = 0.4; }, "lengths of 0.5 or more");
  arm([](ArmDescription& a) { a.muscles[0].points.resize(1); }, "two points or more");
  arm([](ArmDescription& a) { a.muscles[0].wrap = "knee"; }, "goes around 'knee'");
  arm([](ArmDescription& a) { a.fore_scale = 0.0; }, "scale must be between");
  expect_refusal([] { ArmDescription::person(175.0, 70.0); }, "height must be between");
  expect_refusal([] { ArmDescription::person(1.75, -1.0); }, "mass must be between");
  ExoScene slow;
  slow.solver.timestep = 0.0;
  expect_refusal([&] { ExoPlant plant(slow); }, "time step");
}

// A device's joint keeps what its link says of it, or is refused for its name.
TEST(Exo, JointsOfTheDeviceHaveNamesOfTheirOwn) {
  for (const char* name : {"elbow_flexion", "wrist_flexion", "shoulder_rotation"}) {
    for (const Coupling coupling : {Coupling::kRigid, Coupling::kApart}) {
      ExoScene scene = scene_of(coupling);
      scene.exo.links[3].joint = name;
      expect_refusal([&] { ExoPlant plant(scene); },
                     "joint '" + std::string(name) + "' of the device has the name of a joint of");
    }
    ExoScene alone = scene_of(Coupling::kExoOnly);
    alone.exo.links[3].joint = name;
    const ExoPlant plant(alone);
    const Index joint = plant.model().velocity_of(name);
    EXPECT_EQ(plant.model().joint_damping()[joint], 1.0);
    EXPECT_EQ(plant.model().joint_friction()[joint], 2.787);
  }
}

// Arms of any length are stretched onto the published device, or one that is made for them.
TEST(Exo, RigidArmsAreHeldAtTheirElbow) {
  for (const double factor : {0.5, 0.9, 1.1, 1.8}) {
    ExoScene scene;
    scene.arm = ArmDescription::cylinders(factor);
    EXPECT_NO_THROW(ExoPlant{scene}) << factor;
    scene.exo.links[2].position *= factor;
    EXPECT_NO_THROW(ExoPlant{scene}) << factor;
  }
  ExoScene tall;
  tall.arm = ArmDescription::person(2.2, 100.0);
  EXPECT_NO_THROW(ExoPlant{tall});
  for (const Vector3& off : {Vector3(0, 0.3, 0), Vector3(0, 0, 0.09), Vector3(0.09, 0, 0)}) {
    ExoScene scene;
    scene.exo.links[3].position = off;
    expect_refusal([&] { ExoPlant plant(scene); }, "joint 'J4' of the device is");
    scene.coupling = Coupling::kApart;
    EXPECT_NO_THROW(ExoPlant{scene});
  }
}

TEST(Exo, StartsThatCannotBeReachedAreRefused) {
  const ExoPlant plant(scene_of(Coupling::kRigid));
  Vector start = plant.model().reference();
  plant.check_start(start);
  start[3] = 140 * kDegree;
  expect_refusal([&] { plant.check_start(start); },
                 "joint 'J4' is 140 degrees, outside its range of 0 to 125");
  start[3] = kNan;
  expect_refusal([&] { plant.check_start(start); }, "joint 'J4' is not finite");
  expect_refusal([&] { plant.check_start(Vector::Zero(3)); }, "3 numbers, 4 are expected");
  EXPECT_THROW(ExoPlant(plant.changed({{ModelQuantity::kMass, "Link1", {7.0}}})).nominal(), Error);
}

struct Isometric {
  std::vector<Muscle> muscles;
  MuscleTable table;
};

Isometric isometric(const std::vector<Muscle>& muscles, double upper_scale = 0.0) {
  ExoScene scene = scene_of(Coupling::kArmOnly);
  scene.arm.muscles = muscles;
  if (upper_scale > 0.0) scene.arm.upper_scale = upper_scale;
  const ExoPlant plant(scene);
  std::vector<std::string> names;
  for (const Muscle& m : muscles) names.push_back(m.name);
  const Vector angle = Vector::LinSpaced(126, 0.0, 125.0 * kDegree);
  return {muscles, muscle_table(plant.model(), "elbow_flexion", names, angle, Vector())};
}

TEST(Exo, MomentArmsAreTheSlopesOfThePaths) {
  for (const auto& muscles : {published_elbow_muscles(), fitted_elbow_muscles()}) {
    const MuscleTable t = isometric(muscles).table;
    for (Index k = 0; k < t.length.cols(); ++k) {
      for (Index i = 1; i + 1 < t.angle.size(); ++i) {
        const double slope =
            (t.length(i + 1, k) - t.length(i - 1, k)) / (t.angle[i + 1] - t.angle[i - 1]);
        // Second differences over a degree: where a path meets its cylinder the slope has a corner.
        EXPECT_NEAR(t.moment(i, k), -slope, 6e-4) << muscles[static_cast<std::size_t>(k)].name;
      }
    }
  }
}

// Lengths of the published lines with the elbow straight, from the published fits of their length
// ranges, which hold to a millimetre or two.
TEST(Exo, PublishedLinesHaveThePublishedLengths) {
  const MuscleTable t = isometric(published_elbow_muscles()).table;
  const double s = 0.86267;
  const double biceps_short = 0.289242 * s + 0.053333 - 0.036683;
  const double brachialis = 0.119760 * s + 0.034662 + 0.000016;
  EXPECT_NEAR(t.length.col(4).maxCoeff(), biceps_short, 2e-3);
  EXPECT_NEAR(t.length.col(6).maxCoeff(), brachialis, 2e-3);
}

TEST(Exo, OurMuscleCurvesAreTheEngines) {
  const Isometric test = isometric(fitted_elbow_muscles());
  const TorqueCurves ours = torque_curves(test.table, test.muscles);
  const MuscleTable& t = test.table;
  const Vector passive = t.passive.rowwise().sum();
  const Vector extension = t.active.leftCols(4).rowwise().sum() + passive;
  const Vector flexion = t.active.rightCols(4).rowwise().sum() + passive;
  EXPECT_LT((ours.passive - passive).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((ours.flexion - flexion).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((ours.extension - extension).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Exo, CurvesHaveTheirLandmarks) {
  const MuscleCurves c;
  EXPECT_EQ(c.active(0.5), 0.0);
  EXPECT_EQ(c.active(1.6), 0.0);
  EXPECT_NEAR(c.active(1.0), 1.0, 1e-12);
  EXPECT_EQ(c.passive(1.0), 0.0);
  EXPECT_NEAR(c.passive(1.3), 0.65, 1e-12);
  EXPECT_NEAR(c.passive(1.6), 1.95, 1e-12);
  EXPECT_NEAR(c.active(1.3), 0.5, 1e-12);
}

// The published muscles give the published peaks (78.3 N m at 85 and -50.9 N m at 70 degrees).
TEST(Exo, PublishedMusclesHaveThePublishedTorque) {
  const Isometric test = isometric(published_elbow_muscles(), 1.0);
  const TorqueCurves c = torque_curves(test.table, test.muscles);
  const TorquePeak flexion = peak_of(test.table.angle, c.flexion);
  const TorquePeak extension = peak_of(test.table.angle, c.extension);
  EXPECT_NEAR(flexion.torque, 78.3, 0.1);
  EXPECT_NEAR(flexion.angle, 85 * kDegree, 2.5 * kDegree);
  EXPECT_NEAR(extension.torque, -50.9, 0.1);
  EXPECT_NEAR(extension.angle, 70 * kDegree, 5 * kDegree);
  EXPECT_GT(c.passive[30], 9.0);  // what the fit repairs
}

void expect_goals(const MuscleTable& table, const TorqueCurves& c) {
  const TorquePeak flexion = peak_of(table.angle, c.flexion);
  const TorquePeak extension = peak_of(table.angle, c.extension);
  EXPECT_NEAR(flexion.torque, 78.0, 4.0);
  EXPECT_NEAR(flexion.angle, 85 * kDegree, 3 * kDegree);
  EXPECT_NEAR(extension.torque, -51.0, 3.0);
  EXPECT_NEAR(extension.angle, 67.5 * kDegree, 2.6 * kDegree);
  const TorqueReference amis = amis_torque();
  const TorqueReference buchanan = buchanan_torque();
  EXPECT_LE(torque_error(table.angle, c.flexion, amis.angle, amis.flexion), 12.0);
  EXPECT_LE(torque_error(table.angle, c.extension, amis.angle, amis.extension), 12.0);
  EXPECT_LE(torque_error(table.angle, c.flexion, buchanan.angle, buchanan.flexion), 6.0);
  EXPECT_LE(torque_error(table.angle, c.extension, buchanan.angle, buchanan.extension), 8.0);
  EXPECT_LE(c.passive.segment(30, 81).cwiseAbs().maxCoeff(), 2.0);
}

TEST(Exo, FittedMusclesReachTheMeasuredTorque) {
  const Isometric test = isometric(fitted_elbow_muscles());
  expect_goals(test.table, torque_curves(test.table, test.muscles));
}

// Wherever the arm can be, at full excitation: a run ends where a muscle would push.
TEST(Exo, FittedMusclesPullInEveryPose) {
  const ExoPlant plant(scene_of(Coupling::kArmOnly));
  const Matrix range = plant.model().joint_range();
  EngineRun run(plant.model());
  run.activation().setOnes();
  constexpr int kSteps = 5;
  for (int i = 0; i < kSteps * kSteps * kSteps * kSteps; ++i) {
    for (Index j = 0, rest = i; j < 4; ++j, rest /= kSteps) {
      const double share = static_cast<double>(rest % kSteps) / (kSteps - 1);
      run.position()[j] = range(j, 0) + share * (range(j, 1) - range(j, 0));
    }
    ASSERT_NO_THROW(run.forward()) << run.position().transpose() / kDegree;
  }
}

// The whole fit takes 58 000 evaluations; a part of it already comes close and shows that the
// committed numbers are where it goes.
TEST(Exo, FitReachesTheMeasuredTorque) {
  const Isometric test = isometric(unfitted_elbow_muscles());
  MuscleFitOptions options;
  options.evaluations = 5000;
  const MuscleFit fit = fit_muscles(test.table, test.muscles, options);
  EXPECT_LE(fit.evaluations, 20000 + 4);
  const TorqueReference amis = amis_torque();
  EXPECT_LE(torque_error(test.table.angle, fit.curves.flexion, amis.angle, amis.flexion), 14.0);
  EXPECT_LE(fit.curves.passive.segment(30, 81).cwiseAbs().maxCoeff(), 2.0);
  EXPECT_NEAR(fit.flexor_scale, 1.0, 0.1);
  const MuscleFit again = fit_muscles(test.table, test.muscles, options);
  EXPECT_EQ(again.objective, fit.objective);
  Token token;
  token.cancel();
  EXPECT_THROW(fit_muscles(test.table, test.muscles, options, &token), Error);
  std::vector<Muscle> others = test.muscles;
  std::swap(others[0], others[1]);
  expect_refusal([&] { fit_muscles(test.table, others); }, "'triceps_long' in the table");
  options.evaluations = 0;
  expect_refusal([&] { fit_muscles(test.table, test.muscles, options); }, "evaluations");
}

TEST(Exo, TablesRefuseWhatIsNotThere) {
  const ExoPlant plant(scene_of(Coupling::kArmOnly));
  const Vector angle = Vector::LinSpaced(3, 0.0, 1.0);
  const std::vector<std::string> biceps = {"biceps_long"};
  const auto table = [&](const char* joint, const char* muscle, const Vector& a, const Vector& p) {
    muscle_table(plant.model(), joint, {muscle}, a, p);
  };
  expect_refusal([&] { table("knee", "biceps_long", angle, Vector()); }, "no joint 'knee'");
  expect_refusal([&] { table("elbow_flexion", "soleus", angle, Vector()); }, "'soleus'");
  expect_refusal([&] { table("elbow_flexion", "biceps_long", angle, Vector::Zero(9)); },
                 "9 numbers, 4 are expected");
  expect_refusal([&] { table("elbow_flexion", "biceps_long", Vector(), Vector()); }, "one entry");
  EXPECT_THROW(torque_error(angle, angle, Vector::Constant(1, 9.0), angle.head(1)), Error);
}

TEST(Exo, ShoulderMusclesArePartOfAScene) {
  ExoScene scene = scene_of(Coupling::kArmOnly);
  for (const Muscle& m : published_shoulder_muscles()) scene.arm.muscles.push_back(m);
  const ExoPlant plant(scene);
  EXPECT_EQ(plant.model().count(Part::kActuator), 23);
  for (const Muscle& m : scene.arm.muscles) {
    const auto range = plant.model().values(ModelQuantity::kLengthRange, m.name);
    EXPECT_GT(range[1] - range[0], 1e-3) << m.name;
    EXPECT_GT(range[0], 0.005) << m.name;
  }
}

// Two plants whose scene differs only in a number equal the change of that number.
TEST(Exo, ChangedScenesEqualRecompiledOnes) {
  ExoScene scene = scene_of(Coupling::kRigid);
  const ExoPlant plant(scene);
  scene.exo.links[3].mass = 0.6;
  scene.arm.muscles[6].force = 800.0;
  const ExoPlant recompiled(scene);
  const auto range = scene.arm.muscles[6].range;
  const ExoPlant changed =
      plant.changed({{ModelQuantity::kMass, "Link4", {0.6}},
                     {ModelQuantity::kMuscle, "brachialis", {800.0, range[0], range[1]}}});
  for (const ArrayDifference& d : changed.model().differences(recompiled.model())) {
    EXPECT_LT(d.difference, 1e-14) << d.array;
  }
}

}  // namespace
}  // namespace ulna
