// Soft tissue, cuffs, straps and the plants that are held by them: geometry,
// true stiffness, energy, donning, refusals, and bushings against what they
// were made from.
#include "plant/soft/soft_plant.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "plant/soft/compression.hpp"
#include "plant/soft/plant_difference.hpp"
#include "plant/soft/reduced_plant.hpp"

namespace ulna {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <class Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

bool says(const std::string& text, const char* words) {
  return text.find(words) != std::string::npos;
}

TEST(Tissue, HasThePublishedNumbersOfElements) {
  EXPECT_EQ(Tissue(TissueOptions::upper_arm()).size(), 162);
  EXPECT_EQ(Tissue(TissueOptions::forearm()).size(), 116);
}

// Facets inside a smooth surface: 3 % of area and volume at this number of
// elements.
TEST(Tissue, SurfaceAndVolumeAreTheEllipsoids) {
  const TissueMesh mesh({0.08, 0.04, 0.04}, {17, 9, 9});
  // Prolate spheroid: 2 pi b^2 (1 + a/(b e) asin e).
  const double e = std::sqrt(1.0 - 0.25);
  const double surface = 2.0 * kPi * 0.04 * 0.04 * (1.0 + 2.0 / e * std::asin(e));
  EXPECT_NEAR(mesh.surface() / surface, 1.0, 0.03);
  double thrice = 0.0;  // a volume grows with the cube of its radii
  for (int i = 0; i < mesh.size(); ++i) thrice += mesh.volume_rate(i) * mesh.radius(i);
  EXPECT_NEAR(thrice / (4.0 * kPi * 0.08 * 0.04 * 0.04), 1.0, 0.03);
}

TEST(Tissue, LaplacianIsSemidefiniteAndBlindToAUniformRadius) {
  const TissueMesh mesh({0.08, 0.03, 0.03}, {9, 4, 4});
  const Matrix& l = mesh.laplacian();
  EXPECT_LT((l * Vector::Ones(mesh.size())).cwiseAbs().maxCoeff(), 1e-12);
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(l);
  EXPECT_GT(solver.eigenvalues().minCoeff(), -1e-12);
  EXPECT_GT(solver.eigenvalues()[1], 1e-4);  // connected
}

// The distance's gradient and the shares' by central differences.
TEST(Tissue, PlaceOnTheSurfaceHasItsGradients) {
  const TissueMesh mesh({0.08, 0.04, 0.04}, {9, 5, 5});
  const Vector3 at(0.031, 0.024, 0.037);
  const SurfacePlace place = mesh.place(at);
  EXPECT_NEAR(place.share.sum(), 1.0, 1e-12);
  EXPECT_GE(place.share.minCoeff(), 0.0);
  constexpr double h = 1e-6;
  for (int k = 0; k < 3; ++k) {
    const Vector3 step = h * Vector3::Unit(k);
    const SurfacePlace up = mesh.place(at + step);
    const SurfacePlace down = mesh.place(at - step);
    const double gap = ((at + step).norm() - up.radius) - ((at - step).norm() - down.radius);
    EXPECT_NEAR(place.slope[k], gap / (2.0 * h), 1e-6);
    EXPECT_LT((place.gradient.col(k) - (up.share - down.share) / (2.0 * h)).norm(), 1e-4);
  }
  const Vector3 on = mesh.radius(7) * mesh.direction(7);
  const SurfacePlace corner = mesh.place(on);
  EXPECT_NEAR(corner.radius, mesh.radius(7), 1e-12);
  Index most = 0;
  corner.share.maxCoeff(&most);
  EXPECT_EQ(corner.element[static_cast<std::size_t>(most)], 7);
}

CompressionResult compressed(TissueOptions options, double stiffness) {
  options.stiffness = stiffness;
  CompressionOptions test;
  test.force_factor = 1.3;
  return compress(Tissue(options), test);
}

// Published range 10 to 70 kPa at 30 to 40 % strain, between the softest and
// the stiffest setting.
TEST(Compression, BracketsThePublishedModulus) {
  for (const TissueOptions& options : {TissueOptions::upper_arm(), TissueOptions::forearm(),
                                       TissueOptions::upper_arm().of_half_length(0.12),
                                       TissueOptions::forearm().of_half_length(0.12),
                                       TissueOptions::forearm().of_half_length(0.14)}) {
    const CompressionResult soft = compressed(options, 100.5);
    const CompressionResult stiff = compressed(options, 974.43);
    EXPECT_LT(soft.modulus_at(0.30), 10e3);
    EXPECT_GT(stiff.modulus_at(0.30), 70e3);
    EXPECT_GT(stiff.modulus_at(0.40), 70e3);
    for (const CompressionResult* r : {&soft, &stiff}) {
      for (Index i = 1; i < r->strain.size(); ++i) {
        EXPECT_GT(r->strain[i], r->strain[i - 1]);
        EXPECT_GT(r->stress[i], r->stress[i - 1]);
      }
      EXPECT_LT(r->energy.maxCoeff(), 1e-12);  // J, of a few
    }
  }
}

// True stiffness: neither the number of elements nor their mass changes it by
// 10 %.
TEST(Compression, DoesNotDependOnElements) {
  for (TissueOptions options : {TissueOptions::upper_arm(), TissueOptions::forearm()}) {
    const CompressionResult usual = compressed(options, 537.5);
    TissueOptions finer = options;
    finer.counts = {13, 7, 7};
    TissueOptions heavier = options;
    heavier.element_mass *= 10.0;
    for (const TissueOptions& other : {finer, heavier}) {
      const CompressionResult r = compressed(other, 537.5);
      for (const double strain : {0.3, 0.35, 0.4}) {
        EXPECT_NEAR(r.modulus_at(strain) / usual.modulus_at(strain), 1.0, 0.10) << strain;
      }
    }
  }
}

TEST(Compression, RefusesWhatCannotBe) {
  TissueOptions bad;
  bad.stiffness = -1.0;
  EXPECT_TRUE(says(refusal([&] { Tissue{bad}; }), "stiffness must be positive"));
  bad = {};
  bad.counts = {1, 5, 5};
  EXPECT_TRUE(says(refusal([&] { Tissue{bad}; }), "between 2 and 40 points"));
  bad = {};
  bad.semi_axes[1] = kNan;
  EXPECT_TRUE(says(refusal([&] { Tissue{bad}; }), "semi-axes"));
  CompressionOptions test;
  test.largest_strain = 2.0;
  const Tissue tissue(TissueOptions::forearm());
  EXPECT_TRUE(says(refusal([&] { compress(tissue, test); }), "largest strain"));
  test.largest_strain = 0.9;
  EXPECT_TRUE(says(refusal([&] { compress(tissue, test); }), "below 0.9"));
  CompressionOptions quick;
  quick.largest_strain = 0.05;
  const CompressionResult r = compress(tissue, quick);
  EXPECT_TRUE(says(refusal([&] { r.modulus_at(0.3); }), "not compressed to that strain"));
  Token token;
  token.cancel();
  EXPECT_TRUE(says(refusal([&] { compress(tissue, {}, &token); }), "cancelled"));
}

// Radius and half angle from two measured lengths; published, four digits.
TEST(Cuff, HasThePublishedArc) {
  EXPECT_NEAR(Cuff::upper_arm().radius(), 0.05658, 5e-6);
  EXPECT_NEAR(Cuff::upper_arm().half_angle() / kDegree, 76.43, 5e-3);
  EXPECT_NEAR(Cuff::forearm().radius(), 0.04746, 5e-6);
  EXPECT_NEAR(Cuff::forearm().half_angle() / kDegree, 63.58, 5e-3);
  int plate = -1;
  const Cuff cuff = Cuff::upper_arm();
  Cuff::Faces steel;
  steel.fill(cuff.face());
  EXPECT_NEAR(cuff.penetration(steel, {0.0, 0.0, 0.0}, plate), -cuff.face(), 1e-12);
  const double beyond = cuff.penetration(steel, (cuff.face() + 0.004) * cuff.outward(4), plate);
  EXPECT_NEAR(beyond, 0.004, 1e-12);
  EXPECT_EQ(plate, 4);
}

// The lining presses into the limb as far as it is told, or until it is tight.
TEST(Cuff, IsTightened) {
  Cuff cuff = Cuff::upper_arm();
  cuff.set_arc(0.05, 110.0 * kDegree);
  EXPECT_NEAR(cuff.radius(), 0.05, 1e-12);
  EXPECT_NEAR(cuff.half_angle(), 110.0 * kDegree, 1e-12);
  cuff.squeeze = 0.012;
  const Matrix3 round = Matrix3::Identity() * 0.04 * 0.04;
  EXPECT_NEAR(cuff.faces(Vector3::Zero(), round, 1e6)[2], 0.028, 1e-12);
  cuff.tightness = 6e3;
  EXPECT_NEAR(cuff.faces(Vector3::Zero(), round, 1e6)[2], 0.034, 1e-12);
  EXPECT_NEAR(cuff.faces(Vector3::Zero(), round, 1e5)[2], 0.028, 1e-12);
  cuff.tightness = kNan;
  EXPECT_TRUE(says(refusal([&] { cuff.check(); }), "tight at a pressure"));
}

TEST(Cuff, RefusesAnArcThatCannotBe) {
  Cuff cuff = Cuff::forearm();
  cuff.slant = 0.5 * cuff.chord;
  EXPECT_TRUE(says(refusal([&] { cuff.check(); }), "slant"));
  cuff = Cuff::forearm();
  cuff.orientation(0, 0) = 2.0;
  EXPECT_TRUE(says(refusal([&] { cuff.check(); }), "right frame"));
}

Matrix3 round_limb(double radius) {
  return Vector3(1.0 / (radius * radius), 1.0 / (radius * radius), 1.0 / 0.0064).asDiagonal();
}

TEST(Strap, HasItsPretensionWhenDonned) {
  for (const double tension : {0.0, 30.0, 100.0}) {
    StrapOptions options;
    options.pretension = tension;
    const Strap strap(options);
    const Strap::Donned donned = strap.don({0.0, -0.02, 0.0}, round_limb(0.04));
    EXPECT_NEAR(strap.webbing(donned.points, donned.rest).tension, tension, 1e-9);
  }
}

// Two tangents and an arc around a circle of 41 mm (limb and half the strap),
// from anchors at
// (+-45, -5) mm; the row over the middle.
TEST(Strap, LiesOnTheShortestPath) {
  StrapOptions options;
  options.across = 1;
  options.pretension = 0.0;
  options.along = 41;
  const Strap strap(options);
  const Strap::Donned donned = strap.don({0.0, -0.02, 0.0}, round_limb(0.04));
  double length = 0.0;
  for (const double rest : donned.rest) length += rest;
  const double apart = std::hypot(0.045, 0.015);
  const double arc = std::atan2(0.045, 0.015) - std::acos(0.041 / apart);
  const double expected = 2.0 * (std::sqrt(apart * apart - 0.041 * 0.041) + 0.041 * arc);
  EXPECT_NEAR(length, expected, 1e-4);  // chords of its points
}

TEST(Strap, ForcesAreTheGradientOfItsEnergy) {
  StrapOptions options;
  const Strap strap(options);
  Strap::Donned donned = strap.don({0.004, -0.018, 0.0}, round_limb(0.041));
  const Strap::Webbing web = strap.webbing(donned.points, donned.rest);
  constexpr double h = 1e-7;
  for (const Index k : {0, 4, 11, 17}) {
    for (int axis = 0; axis < 3; ++axis) {
      Matrix up = donned.points, down = donned.points;
      up(axis, k) += h;
      down(axis, k) -= h;
      const Strap::Webbing a = strap.webbing(up, donned.rest);
      const Strap::Webbing b = strap.webbing(down, donned.rest);
      EXPECT_NEAR(web.force[3 * k + axis], -(a.energy - b.energy) / (2.0 * h), 1e-4);
      const Vector slope = -(a.force - b.force) / (2.0 * h);
      EXPECT_LT((slope - web.stiffness.col(3 * k + axis)).norm(), 1e-3 * 20000.0);
    }
  }
}

TEST(Strap, RefusesWhatCannotBeClosed) {
  StrapOptions options;
  options.length = 0.05;
  EXPECT_TRUE(says(refusal([&] {
                     Strap(options).don({0.0, -0.02, 0.0}, round_limb(0.04));
                   }),
                   "the strap around the limb is too short: it has 50.0 mm without tension"));
  options = {};
  options.pretension = 1e5;
  EXPECT_TRUE(says(refusal([&] {
                     Strap(options).don({0.0, -0.02, 0.0}, round_limb(0.04));
                   }),
                   "too short"));
  options = {};
  options.limb = "forearm";
  EXPECT_TRUE(says(refusal([&] {
                     Strap(options).don({0.0, -0.02, 0.2}, round_limb(0.04));
                   }),
                   "the strap around the forearm lies beside it"));
  options.stiffness = kNan;
  EXPECT_TRUE(says(refusal([&] { Strap{options}; }), "positive stiffness"));
}

struct Held {
  std::shared_ptr<const SoftInterface> model;
  std::shared_ptr<const TissueStep> step;
  LimbPose pose{Vector3(0.0, -0.0152, 0.0), Matrix3::Identity()};

  explicit Held(double shear = SoftInterfaceOptions{}.shear) {
    SoftInterfaceOptions options = SoftInterfaceOptions::upper_arm(1.0, CuffDesign::kPublished);
    options.shear = shear;
    model = std::make_shared<const SoftInterface>(options);
    step = std::make_shared<const TissueStep>(model->tissue(), 0.005);
    pose.orientation << 0, 0, 1, 0, 1, 0, -1, 0, 0;  // the limb along the cuff
  }
  InterfaceRun donned() const {
    InterfaceRun run(model, step);
    run.don(pose);
    return run;
  }
};

TEST(Interface, LosesEnergyWhileTheLimbIsHeld) {
  const Held held;
  InterfaceRun run = held.donned();
  double before = run.energy(held.pose);
  const double first = before;
  for (int i = 0; i < 400; ++i) {
    run.impose(held.pose, Twist::Zero());
    const double now = run.energy(held.pose);
    // A point of the strap that crosses an edge of a facet meets a kink:
    // microjoules of a joule.
    EXPECT_LE(now, before * (1.0 + 1e-5)) << i;
    before = now;
  }
  EXPECT_LT(before, 0.9 * first);
  EXPECT_GT(run.cuff().normal_force, 10.0);
  EXPECT_GT(run.strap().normal_force, 10.0);
  EXPECT_GT(run.cuff().peak_pressure, run.cuff().normal_force / run.cuff().area);
}

// The limb goes round a circle: the work done on it never gives energy back.
TEST(Interface, TakesWorkInACycle) {
  const Held held;
  InterfaceRun run = held.donned();
  for (int i = 0; i < 200; ++i) run.impose(held.pose, Twist::Zero());
  double work = 0.0;
  const double start = run.energy(held.pose);
  LimbPose pose = held.pose;
  constexpr int kSteps = 200;
  for (int i = 0; i < 2 * kSteps; ++i) {
    const double angle = 2.0 * kPi * i / kSteps;
    Twist twist = Twist::Zero();
    twist.head<3>() = 0.02 * Vector3(-std::sin(angle), std::cos(angle), 0.5 * std::sin(2 * angle));
    work -= 0.005 * run.impose(pose, twist).dot(twist);
    pose.position += 0.005 * twist.head<3>();
  }
  EXPECT_GT(work, run.energy(pose) - start);
}

// Long steps come to what short ones end in: the energy that is left, within
// the friction's 2 %.
TEST(Interface, ComesToRestAsInTime) {
  const Held held;
  InterfaceRun slow = held.donned(), quick = held.donned();
  slow.come_to_rest(held.pose, std::make_shared<const TissueStep>(held.model->tissue(), 50.0));
  for (int i = 0; i < 1000; ++i) quick.impose(held.pose, Twist::Zero());
  EXPECT_NEAR(slow.energy(held.pose) / quick.energy(held.pose), 1.0, 0.02);
  quick.impose(held.pose, Twist::Zero());
  slow.impose(held.pose, Twist::Zero());
  EXPECT_NEAR(slow.cuff().normal_force / quick.cuff().normal_force, 1.0, 0.02);
}

// Flesh keeps its volume: G = E/3, so that a layer of it is a third as stiff along as across.
TEST(Interface, SkinIsAThirdAsStiffAlongAsAcross) {
  const Held held;
  const double across = held.model->tissue().options().foundation();
  EXPECT_NEAR(held.model->shear_stiffness(), across / 3.0, 1e-9 * across);
  // Pulled along, the same interface with ten times the shear answers with ten times the force.
  const auto pulled = [](double shear) {
    const Held place(shear);
    InterfaceRun run = place.donned();
    run.come_to_rest(place.pose, std::make_shared<const TissueStep>(place.model->tissue(), 50.0));
    run.impose(place.pose, Twist::Zero());
    const double before = run.cuff().wrench[2];
    Twist twist = Twist::Zero();
    twist[2] = 1e-3;
    run.impose(place.pose, twist);  // 5 micrometres
    return before - run.cuff().wrench[2];
  };
  const double soft = pulled(0.01), hard = pulled(10.0);
  const double per_shear = (hard - soft) / (10.0 - 0.01);
  EXPECT_NEAR(pulled(1.0) - soft, per_shear * 0.99, 0.02 * per_shear);
  EXPECT_GT(per_shear, 0.0);
}

// Along the limb: skin and lining are a spring first, then slide at Coulomb's
// limit, and what has slid stays. A stiff skin, so that it slides within millimetres.
TEST(Interface, SticksThenSlides) {
  const Held held(4.0);
  InterfaceRun run = held.donned();
  run.come_to_rest(held.pose, std::make_shared<const TissueStep>(held.model->tissue(), 50.0));
  const auto move = [&](LimbPose& pose, double speed, int steps) {
    Twist twist = Twist::Zero();
    twist[2] = speed;
    for (int i = 0; i < steps; ++i) {
      run.impose(pose, twist);
      pose.position.z() += 0.005 * speed;
    }
  };
  LimbPose pose = held.pose;
  const double before = run.impose(pose, Twist::Zero())[2];
  move(pose, 0.001, 20);  // 0.1 mm
  const double pulled = run.impose(pose, Twist::Zero())[2];
  EXPECT_LT(pulled, before - 1.0);
  EXPECT_LT(run.sliding().norm(), 1e-5);
  move(pose, -0.001, 20);
  EXPECT_NEAR(run.impose(pose, Twist::Zero())[2], before, 0.02 * (before - pulled) + 0.1);
  move(pose, 0.01, 200);  // 10 mm
  const double limit = 0.7 * run.cuff().normal_force;
  EXPECT_NEAR(-run.cuff().wrench[2] / limit, 1.0,
              0.15);  // the limb's end is not parallel
  EXPECT_GT(run.sliding().z(), 0.006);
  const double slid = run.sliding().z();
  move(pose, -0.01, 10);
  EXPECT_NEAR(run.sliding().z(), slid, 2e-4);
}

SoftScene usual(double timestep = 0.005) {
  SoftScene soft = SoftScene::of(ExoScene{});
  soft.scene.solver.timestep = timestep;
  return soft;
}

Vector start_angle(double elbow) {
  Vector angle(4);
  angle << 0.0, -90.0 * kDegree, 0.0, elbow * kDegree;
  return angle;
}

TEST(SoftPlant, AnAlignedArmHasTheDevicesAngles) {
  const SoftPlant plant(usual());
  const Vector donned = plant.donned(start_angle(110.0));
  EXPECT_NEAR(donned[7], 110.0 * kDegree,
              2.0 * kDegree);  // its elbow is 4 mm off the device's
  EXPECT_NEAR(donned[4], -90.0 * kDegree, 3.0 * kDegree);
  EXPECT_NEAR(donned[6], 0.0, 1e-9);
  SoftScene turned = usual();
  turned.donning.rotation = 3.0 * kDegree;
  EXPECT_NEAR(SoftPlant(turned).donned(start_angle(110.0))[6], 3.0 * kDegree, 1e-9);
}

// Kinetic energy, weight and interfaces of a run without motors, muscles and
// gravity.
TEST(SoftPlant, EnergyNeverGrows) {
  SoftScene soft = usual();
  soft.scene.solver.gravity.setZero();
  soft.scene.arm.muscles.clear();
  for (const bool reduced : {false, true}) {
    SoftPlant plant(soft);
    if (reduced) {
      plant = plant.reduced(reduce(plant).bushings);
    }
    EngineRun run(plant.model());
    Vector angle = start_angle(60.0);
    angle[0] = -20.0 * kDegree;
    angle[1] = -50.0 * kDegree;
    plant.attach(run, angle);
    run.velocity()[3] = 0.5;  // the device against the arm
    double before = run.kinetic_energy() + interface_energy(run);
    for (int i = 0; i < 400; ++i) {
      run.step();
      run.forward();
      const double now = run.kinetic_energy() + interface_energy(run);
      EXPECT_LT(now, before + 1e-6) << i << " " << reduced;  // J: turning axes in a step of 5 ms
      before = now;
    }
    EXPECT_LT(run.velocity().norm(), 0.1);
  }
}

TEST(SoftPlant, ForcesOnArmAndDeviceAreOpposite) {
  const SoftPlant plant(usual());
  EngineRun run(plant.model());
  plant.attach(run, start_angle(80.0));
  run.step(20);
  const std::vector<InterfaceReport> reports = interface_reports(run);
  ASSERT_EQ(reports.size(), 2u);
  EXPECT_EQ(reports[1].name, "fore");
  // A turn of everything about the elbow's axes together does no work on the
  // interface.
  EXPECT_NEAR(run.coupling_force()[3] + run.coupling_force()[7], 0.0,
              0.05 * std::fabs(run.coupling_force()[3]) + 0.5);
  for (const InterfaceReport& r : reports) {
    EXPECT_GT(r.cuff.normal_force, 0.0);
    EXPECT_GT(r.tension, 0.0);
    EXPECT_GE(r.cuff.normal_force * (1.0 + 1e-9),
              0.3 * r.cuff.wrench.head<3>().norm());  // friction adds at most 0.7 of it
  }
}

Vector human(EngineRun& run) { return run.position().tail(4); }

// The arm in balance at a pose and after a simulation there with a device that
// stands still.
TEST(StillArm, IsWhereASimulationComesTo) {
  const SoftPlant plant(usual());
  std::vector<Change> still;
  for (int j = 1; j <= 4; ++j) {
    still.push_back({ModelQuantity::kJointDamping, "J" + std::to_string(j), {1e7}});
  }
  EngineRun run(plant.model().changed(still));
  plant.attach(run, start_angle(60.0));
  run.step(100);
  for (Index i = 4; i < 12; ++i) run.control()[i] = 0.4;
  run.step(400);
  StillArm arm(plant, start_angle(60.0));
  arm.balance(4);
  arm.activate(0.4);
  arm.balance(8);
  const double moved = (human(run) - plant.donned(start_angle(60.0)).tail(4)).norm();
  EXPECT_GT(moved, 0.3 * kDegree);
  // 8 %: the muscles' forces build up over 50 ms there and at once here, and
  // friction remembers it.
  EXPECT_LT((human(run) - human(arm.run())).norm(), 0.08 * moved);
}

double slip_of(const SoftPlant& plant) {
  StillArm arm(plant, start_angle(110.0));
  const double donned = arm.run().position()[7] - arm.run().position()[3];
  arm.balance(4);
  arm.activate(0.4);
  arm.balance(4);
  double most = 0.0;
  for (double angle = 110.0; angle > 3.0; angle -= 5.0) {
    arm.bend(angle * kDegree);
    most = std::max(most, std::fabs(arm.run().position()[7] - arm.run().position()[3] - donned));
  }
  return most / kDegree;
}

// All but the softest twentieth of the tissue's range, 100.5 to 974.43 N/m; the published geometry
// lets the arm go.
TEST(SoftPlant, FittedCuffsHoldTheArm) {
  SoftScene soft = usual();
  for (const double stiffness : {144.2, 974.43}) {
    for (SoftInterfaceOptions& i : soft.interfaces) i.tissue.stiffness = stiffness;
    EXPECT_LT(slip_of(SoftPlant(soft)), 5.0) << stiffness;
  }
  SoftScene published = SoftScene::of(ExoScene{}, {}, CuffDesign::kPublished);
  published.scene.solver.timestep = 0.005;
  for (SoftInterfaceOptions& i : published.interfaces) i.tissue.stiffness = 200.0;
  EXPECT_GT(slip_of(SoftPlant(published)), 8.0);
}

// Bushings explain what they were made from and hold the arm where the full
// interfaces do.
TEST(Reduced, StandsWhereTheFullPlantDoes) {
  const SoftPlant full(usual());
  const Reduction reduction = reduce(full);
  ASSERT_EQ(reduction.bushings.size(), 4u);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NO_THROW(reduction.bushings[k].check());
    EXPECT_LT(reduction.misfit[k], 0.3) << reduction.bushings[k].name;
  }
  const SoftPlant reduced = full.reduced(reduction.bushings);
  std::vector<Change> still;
  for (int j = 1; j <= 4; ++j) {
    still.push_back({ModelQuantity::kJointDamping, "J" + std::to_string(j), {1e7}});
  }
  StillArm arm(full, start_angle(110.0));
  arm.balance(4);
  arm.activate(0.4);
  arm.balance(4);
  for (double angle = 110.0; angle > 30.0; angle -= 5.0) arm.bend((angle - 5.0) * kDegree);
  EngineRun run(reduced.model().changed(still));
  // Donned and bent as the full one was; bushings know places alone.
  reduced.attach(run, start_angle(110.0));
  for (Index i = 4; i < 12; ++i) run.control()[i] = 0.4;
  run.step(200);
  for (int i = 0; i < 400; ++i) {
    run.position()[3] -= 0.2 * kDegree;
    run.step();
  }
  run.step(200);
  ASSERT_NEAR(run.position()[3], 30.0 * kDegree, 1e-3 * kDegree);
  // Of a slip of 2 degrees.
  EXPECT_NEAR(run.position()[7], human(arm.run())[3], 0.2 * kDegree);
  EXPECT_TRUE(says(refusal([&] { reduce(reduced); }), "reduced already"));
  ReductionOptions bad;
  bad.poses = 1;
  EXPECT_TRUE(says(refusal([&] { reduce(full, bad); }), "4 to 1000 poses"));
  bad = {};
  bad.end = bad.start;
  EXPECT_TRUE(says(refusal([&] { reduce(full, bad); }), "start and an end"));
  bad = {};
  bad.activation = 1.5;
  EXPECT_TRUE(says(refusal([&] { reduce(full, bad); }), "between 0 and 1"));
  Token token;
  token.cancel();
  EXPECT_TRUE(says(refusal([&] { reduce(full, {}, &token); }), "cancelled"));
}

TEST(Reduced, ReportOfTheDifference) {
  PlantOutcome a{.k = 2.0, .d = 1.0, .k_true = 1.5, .slip = 0.05, .angle = Vector::Zero(4)};
  PlantOutcome b{
      .k = 2.3, .d = 0.9, .k_true = 1.6, .slip = 0.04, .angle = Vector::Constant(4, 0.02)};
  const PlantDifference d = PlantDifference::between({a, a, PlantOutcome{}}, {b, a, b});
  EXPECT_EQ(d.samples, 2);
  EXPECT_NEAR(d.k[0], 0.3, 1e-12);
  EXPECT_NEAR(d.k_error[0], 0.2, 1e-12);
  EXPECT_NEAR(d.slip[0], -0.01, 1e-12);
  EXPECT_NEAR(d.angle[0], 0.02, 1e-12);
  EXPECT_NEAR(d.k_error_rms, 0.2 / std::sqrt(2.0), 1e-12);
  EXPECT_TRUE(std::isnan(d.k[2]));
  EXPECT_TRUE(says(refusal([&] { PlantDifference::between({a}, {}); }), "1 outcomes"));
  EXPECT_TRUE(std::isnan(d.torque_rms));
  // A limb that is 3 mm and 4 mm off along two axes, the other one where it was, in every row.
  a.torque = Vector::Constant(3, 1.0);
  b.torque = Vector::Constant(2, 1.5);  // a shorter run: the rows that both have
  a.displacement = Matrix::Zero(3, 6);
  b.displacement = Matrix::Zero(3, 6);
  b.displacement.col(1).setConstant(0.003);
  b.displacement.col(2).setConstant(0.004);
  const PlantDifference more = PlantDifference::between({a}, {b});
  EXPECT_NEAR(more.torque_rms, 0.5, 1e-12);
  EXPECT_NEAR(more.displacement_rms, 0.005 / std::sqrt(2.0), 1e-12);
}

double elbow_after(double timestep) {
  const SoftPlant plant(usual(timestep));
  EngineRun run(plant.model());
  plant.attach(run, start_angle(80.0));
  for (Index i = 0; i < 4; ++i) run.control()[i] = 0.0;
  run.step(static_cast<Index>(std::lround(0.2 / timestep)));
  return run.position()[7];
}

// First order in the step: the change halves with it.
TEST(SoftPlant, ConvergesWithTheStep) {
  const double coarse = elbow_after(0.005);
  const double middle = elbow_after(0.0025);
  const double fine = elbow_after(0.00125);
  EXPECT_LT(std::fabs(coarse - fine), 1.0 * kDegree);
  EXPECT_LT(std::fabs(middle - fine), 0.75 * std::fabs(coarse - fine) + 1e-5);
}

TEST(SoftPlant, TwoRunsHaveTheSameBits) {
  const SoftPlant plant(usual());
  EngineRun a(plant.model()), b(plant.model());
  plant.attach(a, start_angle(90.0));
  plant.attach(b, start_angle(90.0));
  a.step(50);
  for (int i = 0; i < 50; ++i) b.step();
  EXPECT_EQ((a.position() - b.position()).norm(), 0.0);
  plant.attach(b, start_angle(90.0));  // again from the start
  b.step(50);
  EXPECT_EQ((a.position() - b.position()).norm(), 0.0);
}

TEST(SoftPlant, RefusesWhatCannotBe) {
  SoftScene soft = usual();
  soft.donning.shoulder_offset = Vector3(0.0, 0.0, 0.15);  // a start that the arm cannot reach
  {
    const SoftPlant far(soft);
    EngineRun off(far.model());
    const std::string text = refusal([&] { far.attach(off, start_angle(110.0)); });
    EXPECT_TRUE(says(text, "outside its range") || says(text, "does not lie in the cuff") ||
                says(text, "lies beside it"))
        << text;
  }
  soft = usual();
  soft.donning.shoulder_offset[0] = kNan;
  EXPECT_TRUE(says(refusal([&] { SoftPlant{soft}; }), "offsets of shoulder and elbow"));
  soft = usual();
  soft.interfaces.clear();
  EXPECT_TRUE(says(refusal([&] { SoftPlant{soft}; }), "nothing holds the arm"));
  soft = usual();
  soft.interfaces[1].cuff.link = "Link9";
  EXPECT_TRUE(says(refusal([&] { SoftPlant{soft}; }), "Link9"));
  soft = usual();
  soft.interfaces[1].shear = 0.0;
  EXPECT_TRUE(says(refusal([&] { SoftPlant{soft}; }), "positive stiffness against shear"));
  for (const std::size_t which : {0u, 1u}) {
    soft = usual();
    soft.interfaces[which].strap.length = 0.04;
    const SoftPlant short_strap(soft);
    EngineRun run(short_strap.model());
    EXPECT_TRUE(says(refusal([&] { short_strap.attach(run, start_angle(90.0)); }),
                     which == 0 ? "the strap around the upper arm is too short"
                                : "the strap around the forearm is too short"));
  }
  const SoftPlant plant(usual());
  EXPECT_TRUE(says(refusal([&] { plant.donned(Vector::Zero(3)); }), "one finite angle"));
  EXPECT_TRUE(says(refusal([&] { plant.donned(start_angle(170.0)); }), "outside its range"));
  Bushing lopsided;
  lopsided.stiffness(0, 1) = 5.0;
  EXPECT_TRUE(says(refusal([&] { plant.reduced({lopsided}); }), "symmetric"));
}

}  // namespace
}  // namespace ulna
