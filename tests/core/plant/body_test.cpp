// Whole bodies: the human model against its table, tree algorithms against the fixed-base tree,
// the engine and each other, files read back, and what is refused.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "base/error.hpp"
#include "base/random.hpp"
#include "plant/body/body_file.hpp"
#include "plant/body/body_motion.hpp"
#include "plant/body/human_body.hpp"
#include "plant/engine/run.hpp"

namespace ulna {
namespace {

HumanMeasures person(HumanJoints joints = HumanJoints::k48) {
  return {.height = 1.793, .mass = 72.7, .joints = joints};
}

std::shared_ptr<const BodyTree> shared(BodyTree tree) {
  return std::make_shared<const BodyTree>(std::move(tree));
}

Vector3 three(Random& random, double scale) {
  return scale * Vector3(random.normal(), random.normal(), random.normal());
}

struct Motion {
  BodyState state;
  Vector6 base;  // proper acceleration
  Vector joint;  // acceleration
};

Motion random_motion(const BodyTree& body, std::uint64_t seed) {
  Random random(seed);
  Motion m;
  m.state.position = three(random, 1.0);
  m.state.orientation =
      Eigen::AngleAxisd(random.normal(), three(random, 1.0).normalized()).toRotationMatrix();
  m.state.velocity = three(random, 1.0);
  m.state.angular_velocity = three(random, 1.0);
  m.state.angle.resize(body.dofs());
  m.state.rate.resize(body.dofs());
  m.joint.resize(body.dofs());
  for (Index k = 0; k < body.dofs(); ++k) {
    m.state.angle[k] = 0.5 * random.normal();
    m.state.rate[k] = random.normal();
    m.joint[k] = 3.0 * random.normal();
  }
  m.base.head<3>() = three(random, 2.0) + Vector3(0, 0, body.gravity());
  m.base.tail<3>() = three(random, 2.0);
  return m;
}

// The engine pushes back at limits; random angles are beyond them.
BodyTree without_limits(const BodyTree& body) {
  std::vector<BodyLink> links = body.links();
  for (BodyLink& link : links) {
    link.lower = -kInfinity;
    link.upper = kInfinity;
  }
  return BodyTree(std::move(links));
}

double largest(const Matrix& m) { return m.cwiseAbs().maxCoeff(); }

// What the engine needs at the base and the joints for the motion.
Vector engine_inverse(const BodyTree& body, const Motion& m) {
  EngineRun run(EngineModel::from_text(to_mjcf(without_limits(body), "body")));
  const Matrix3& r = m.state.orientation;
  const Eigen::Quaterniond q(r);
  run.position() << m.state.position, q.w(), q.x(), q.y(), q.z(), m.state.angle;
  // The engine's free joint: linear velocity in the world, angular in the body's axes.
  run.velocity() << m.state.velocity, r.transpose() * m.state.angular_velocity, m.state.rate;
  Vector acceleration(6 + body.dofs());
  acceleration << m.base.head<3>() - Vector3(0, 0, body.gravity()),
      r.transpose() * m.base.tail<3>(), m.joint;
  return run.inverse(acceleration);
}

TEST(HumanBody, HasTheJointsOfTheTable) {
  const std::string path = std::string(ULNA_SOURCE_DIR) + "/../shared/data/wholebody/joints_48.csv";
  std::ifstream file(path);
  if (!file) GTEST_SKIP() << path << " is not there";
  const BodyTree body = human_body(person());
  ASSERT_EQ(body.size(), 49);
  ASSERT_EQ(body.dofs(), 48);
  std::string line;
  std::getline(file, line);
  Index rows = 0;
  while (std::getline(file, line)) {
    std::stringstream cells(line);
    std::string cell[8];
    for (std::string& c : cell) std::getline(cells, c, ',');
    const Index i = std::stol(cell[0]);
    SCOPED_TRACE(line);
    const BodyLink& link = body.link(i);
    EXPECT_EQ(link.joint, cell[1]);
    EXPECT_EQ(body.link(link.parent).name, cell[2]);
    EXPECT_EQ(link.name, cell[3]);
    Vector3 axis;
    std::stringstream(cell[4]) >> axis.x() >> axis.y() >> axis.z();
    EXPECT_EQ(link.axis, axis);
    EXPECT_NEAR(link.lower, std::stod(cell[5]) * kDegree, 1e-12);
    EXPECT_NEAR(link.upper, std::stod(cell[6]) * kDegree, 1e-12);
    EXPECT_EQ(link.position.isZero(0.0), cell[7] == "0");
    ++rows;
  }
  EXPECT_EQ(rows, 48);
}

TEST(HumanBody, HasTheMassAndHeightThatWereGiven) {
  for (const MassTable table : {MassTable::kSegmentLengths, MassTable::kPublished}) {
    for (const HumanJoints joints : {HumanJoints::k48, HumanJoints::k66}) {
      HumanMeasures measures = person(joints);
      measures.table = table;
      const BodyTree body = human_body(measures);
      EXPECT_EQ(body.dofs(), joints == HumanJoints::k48 ? 48 : 66);
      EXPECT_EQ(body.size(), body.dofs() + 1);
      // Fractions have four digits and sum to 1.
      EXPECT_NEAR(body.mass(), measures.mass, 1e-9);
      Index massive = 0;
      for (const BodyLink& link : body.links()) massive += link.massless ? 0 : 1;
      EXPECT_EQ(massive, 23);
      BodyMotion motion(shared(body));
      BodyState still;
      still.angle = still.rate = Vector::Zero(body.dofs());
      motion.move(still);
      const auto at = [&](const char* link) { return motion.position(body.at_link(link)); };
      const double sole = at("RightFoot").z() - 0.039 * measures.height;
      EXPECT_NEAR(at("Head").z() + 0.130 * measures.height - sole, measures.height, 1e-12);
      EXPECT_NEAR(at("LeftHand").y() - at("RightHand").y(),
                  2.0 * (0.129 + 0.186 + 0.146) * measures.height, 1e-12);
    }
  }
}

TEST(HumanBody, TakesMeasuredLengthsAndPoints) {
  HumanMeasures measures = person();
  measures.lengths = {{"upper_arm", 0.31}};
  EXPECT_NEAR(
      human_body(measures).link(human_body(measures).at_joint("jLeftElbow_roty")).position.y(),
      0.31, 1e-15);
  // Points of the model itself, in a frame of its own, give the model again.
  const BodyTree plain = human_body(person());
  BodyMotion motion(shared(plain));
  BodyState still;
  still.angle = still.rate = Vector::Zero(plain.dofs());
  still.position = Vector3(3.0, -2.0, 0.9);
  motion.move(still);
  HumanMeasures from_points = person();
  for (const std::string& name : point_names()) {
    if (name[0] != 'j') continue;
    for (const BodyLink& link : plain.links()) {
      if (link.joint.starts_with(name + "_rot") && !link.position.isZero(0.0)) {
        from_points.points.push_back({name, motion.position(plain.at_joint(link.joint))});
      }
    }
  }
  EXPECT_EQ(from_points.points.size(), 22u);
  const BodyTree again = human_body(from_points);
  for (Index i = 0; i < plain.size(); ++i) {
    EXPECT_LT(largest(again.link(i).position - plain.link(i).position), 1e-12);
    EXPECT_LT(largest(again.link(i).inertia - plain.link(i).inertia), 1e-12);
  }
  // One point moves what hangs on it along.
  HumanMeasures moved = person();
  const double hip = 0.5 * 0.191 * 1.793;
  moved.points = {
      {"jRightHip", {0, -hip, 0}}, {"jLeftHip", {0, hip, 0}}, {"jRightKnee", {0.01, -hip, -0.5}}};
  const BodyTree bent = human_body(moved);
  EXPECT_LT(
      largest(bent.link(bent.at_joint("jRightKnee_roty")).position - Vector3(0.01, 0.0, -0.5)),
      1e-12);
  EXPECT_LT(largest(bent.link(bent.at_joint("jRightAnkle_rotx")).position -
                    Vector3(0, 0, -0.246 * 1.793)),
            1e-12);
}

TEST(HumanBody, CarriesWhatIsAttached) {
  HumanMeasures measures = person();
  measures.attachments = {{"drill", "RightHand", 0.66, {0.05, -0.1, 0.0}, Matrix3::Zero()},
                          {"device", "Pelvis", 1.8, {-0.1, 0.0, 0.1}, 0.02 * Matrix3::Identity()}};
  const BodyTree plain = human_body(person());
  const BodyTree body = human_body(measures);
  EXPECT_NEAR(body.mass(), 72.7 + 2.46, 1e-9);
  const BodyLink& before = plain.link(plain.at_link("RightHand"));
  const BodyLink& hand = body.link(body.at_link("RightHand"));
  const Vector3 moment = before.mass * before.centre + 0.66 * Vector3(0.05, -0.1, 0.0);
  EXPECT_LT(largest(hand.centre - moment / (before.mass + 0.66)), 1e-14);
  check_inertia(hand.inertia, "hand ");
}

void expect_refused(const HumanMeasures& measures, const char* argument, const char* words) {
  try {
    human_body(measures);
    FAIL() << "accepted, although " << words;
  } catch (const Error& error) {
    EXPECT_EQ(error.argument(), argument) << error.what();
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(HumanBody, RefusesWhatNobodyHas) {
  const auto with = [](auto change) {
    HumanMeasures m = person();
    change(m);
    return m;
  };
  expect_refused(with([](auto& m) { m.height = 179.3; }), "height", "179.3");
  expect_refused(with([](auto& m) { m.height = kNaN; }), "height", "height");
  expect_refused(with([](auto& m) { m.mass = 0.0; }), "mass", "5 and 400");
  expect_refused(with([](auto& m) { m.density = 1.0; }), "density", "density");
  expect_refused(with([](auto& m) { m.lengths = {{"arm", 0.3}}; }), "lengths", "upper_arm");
  expect_refused(with([](auto& m) { m.lengths = {{"hand", 0.0}}; }), "lengths", "'hand'");
  expect_refused(with([](auto& m) { m.lengths = {{"hand", kNaN}}; }), "lengths", "'hand'");
  expect_refused(with([](auto& m) {
                   m.lengths = {{"hand", 0.1}, {"hand", 0.1}};
                 }),
                 "lengths", "two lengths");
  expect_refused(with([](auto& m) {
                   m.points = {{"jRightKnee", Vector3::Zero()}};
                 }),
                 "points", "both hips");
  expect_refused(with([](auto& m) {
                   m.points = {{"knee", Vector3::Zero()}};
                 }),
                 "points", "no point 'knee'");
  expect_refused(with([](auto& m) {
                   m.points = {{"jRightHip", {0, -0.1, 0}},
                               {"jLeftHip", {0, 0.1, 0}},
                               {"jRightKnee", {0, -0.1, 0.001}}};
                 }),
                 "points", "jRightKnee");
  expect_refused(with([](auto& m) {
                   m.attachments = {{"drill", "Hand", 0.66, {}, {}}};
                 }),
                 "link", "RightHand");
  expect_refused(with([](auto& m) {
                   m.attachments = {{"drill", "RightHand", -1.0, Vector3::Zero(), Matrix3::Zero()}};
                 }),
                 "mass", "drill");
}

TEST(BodyTree, RefusesWhatIsNoBody) {
  const auto refused = [](std::vector<BodyLink> links, const char* words) {
    try {
      const BodyTree tree(std::move(links));
      ADD_FAILURE() << "accepted: " << words;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  BodyLink base;
  base.name = "trunk";
  base.mass = 1.0;
  base.inertia = Matrix3::Identity();
  BodyLink arm = base;
  arm.name = "arm";
  arm.joint = "shoulder";
  arm.parent = 0;
  EXPECT_EQ(BodyTree({base, arm}).dofs(), 1);
  refused({}, "needs a link");
  refused({arm}, "no parent");
  BodyLink bad = arm;
  bad.parent = -1;
  refused({base, bad}, "'arm' has no parent");
  bad = arm;
  bad.parent = 2;
  refused({base, bad}, "after its parent");
  bad = arm;
  bad.name = "trunk";
  refused({base, bad}, "'trunk'");
  bad = arm;
  bad.mass = -1.0;
  refused({base, bad}, "positive mass");
  bad = arm;
  bad.inertia(0, 0) = 3.0;
  refused({base, bad}, "triangle");
  bad = arm;
  bad.axis = Vector3(1, 1, 0);
  refused({base, bad}, "length is not 1");
  bad = arm;
  bad.lower = 1.0;
  bad.upper = 0.0;
  refused({base, bad}, "limits");
  bad = base;
  bad.mass = 0.0;
  bad.massless = true;
  refused({bad}, "no mass");
  const BodyTree body = human_body(person());
  EXPECT_THROW(body.at_link("Elbow"), Error);
  EXPECT_THROW(rebased(body, "Elbow"), Error);
}

TEST(BodyMotion, AgreesWithTheTreeOnTheWorld) {
  const BodyTree body = human_body(person());
  std::vector<RigidBody> bodies(body.links().begin(), body.links().end());
  const RigidTree fixed(std::move(bodies), Vector3(0, 0, -9.81));
  Motion m = random_motion(body, 1);
  m.state.orientation.setIdentity();
  m.state.angular_velocity.setZero();
  m.base << 0, 0, 9.81, 0, 0, 0;
  BodyMotion motion(shared(body));
  motion.move(m.state);
  motion.accelerate(m.base, m.joint);
  Vector torque(body.dofs());
  Vector6 missing;
  motion.inverse_dynamics(Matrix::Zero(6, body.size()), torque, missing);
  const Vector expected = fixed.inverse_dynamics(m.state.angle, m.state.rate, m.joint);
  EXPECT_LT(largest(torque - expected), 1e-11);  // rounding of sums of 100 N m
  const Vector3 place = fixed.poses(m.state.angle).back().position;
  EXPECT_LT(largest(motion.position(body.size() - 1) - m.state.position - place), 1e-13);
}

TEST(BodyMotion, AgreesWithTheEngine) {
  for (const HumanJoints joints : {HumanJoints::k48, HumanJoints::k66}) {
    const BodyTree body = human_body(person(joints));
    for (std::uint64_t seed = 0; seed < 5; ++seed) {
      const Motion m = random_motion(body, seed);
      BodyMotion motion(shared(body));
      motion.move(m.state);
      motion.accelerate(m.base, m.joint);
      Vector torque(body.dofs());
      Vector6 missing;
      motion.inverse_dynamics(Matrix::Zero(6, body.size()), torque, missing);
      const Vector engine = engine_inverse(body, m);
      // The engine's own inertias are exact to about 1e-12 of 100 N m.
      EXPECT_LT(largest(torque - engine.tail(body.dofs())), 1e-8);
      EXPECT_LT(largest(missing.head<3>() - engine.head<3>()), 1e-8);
      EXPECT_LT(largest(m.state.orientation.transpose() * missing.tail<3>() - engine.segment<3>(3)),
                1e-8);
    }
  }
}

TEST(BodyMotion, AgreesWithTheEngineThroughUrdf) {
  const BodyTree body = human_body(person());
  EngineRun run(
      EngineModel::from_text(to_urdf(without_limits(body), "human")));  // its root is on the world
  Motion m = random_motion(body, 3);
  m.state.orientation.setIdentity();
  m.state.angular_velocity.setZero();
  m.base << 0, 0, 9.81, 0, 0, 0;
  ASSERT_EQ(run.position().size(), body.dofs());
  for (Index k = 0; k < body.dofs(); ++k) {
    const std::string& joint = body.link(body.link_of_dof(k)).joint;
    run.position()[run.model().position_of(joint)] = m.state.angle[k];
    run.velocity()[run.model().velocity_of(joint)] = m.state.rate[k];
  }
  Vector acceleration(body.dofs());
  for (Index k = 0; k < body.dofs(); ++k) {
    acceleration[run.model().velocity_of(body.link(body.link_of_dof(k)).joint)] = m.joint[k];
  }
  const Vector engine = run.inverse(acceleration);
  BodyMotion motion(shared(body));
  motion.move(m.state);
  motion.accelerate(m.base, m.joint);
  Vector torque(body.dofs());
  Vector6 missing;
  motion.inverse_dynamics(Matrix::Zero(6, body.size()), torque, missing);
  for (Index k = 0; k < body.dofs(); ++k) {
    const std::string& joint = body.link(body.link_of_dof(k)).joint;
    EXPECT_NEAR(torque[k], engine[run.model().velocity_of(joint)], 1e-8) << joint;
  }
}

TEST(BodyMotion, MassMatrixIsWhatNewtonAndEulerSay) {
  const BodyTree body = human_body(person());
  const Motion m = random_motion(body, 5);
  BodyMotion motion(shared(body));
  motion.move(m.state);
  const Index n = body.dofs();
  Matrix inertia(6 + n, 6 + n);
  motion.mass_matrix(inertia);
  EXPECT_LT(largest(inertia - inertia.transpose()), 1e-14);  // rounding of rotated inertias
  EXPECT_EQ(inertia.llt().info(), Eigen::Success);
  EXPECT_LT(largest(inertia.topLeftCorner(6, 6) - motion.locked_inertia()), 1e-12);
  const auto forces = [&](const Vector6& base, const Vector& joint) {
    motion.accelerate(base, joint);
    Vector all(6 + n);
    Vector torque(n);
    Vector6 missing;
    motion.inverse_dynamics(Matrix::Zero(6, body.size()), torque, missing);
    all << missing, torque;
    return all;
  };
  const Vector rest = forces(Vector6::Zero(), Vector::Zero(n));
  const Vector moved = forces(m.base, m.joint);
  Vector acceleration(6 + n);
  acceleration << m.base, m.joint;
  EXPECT_LT(largest(moved - rest - inertia * acceleration), 1e-10);
}

TEST(BodyMotion, MomentumAndJacobiansFollowTheMotion) {
  const BodyTree body = human_body(person());
  const Motion m = random_motion(body, 7);
  BodyMotion motion(shared(body));
  const Index n = body.dofs();
  const Vector3 linear = m.base.head<3>() - Vector3(0, 0, 9.81);  // of the base origin
  const Vector3 angular = m.base.tail<3>();
  const auto at = [&](double t) {
    BodyState s = m.state;
    s.position += t * s.velocity + 0.5 * t * t * linear;
    s.velocity += t * linear;
    // The rotation vector of a motion with angular velocity w + a t, to the third order.
    const Vector3 w = m.state.angular_velocity;
    const Vector3 turn = t * w + 0.5 * t * t * angular + t * t * t / 12.0 * angular.cross(w);
    if (t != 0.0) {
      s.orientation =
          Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * s.orientation;
    }
    s.angular_velocity += t * angular;
    s.angle += t * s.rate + 0.5 * t * t * m.joint;
    s.rate += t * m.joint;
    return s;
  };
  const Index hand = body.at_link("LeftHand");
  const Vector3 point(0.02, 0.1, -0.01);
  motion.move(at(0.0));
  const Vector6 velocity = motion.velocity(hand, point);
  Matrix jacobian(6, 6 + n);
  motion.jacobian(hand, point, jacobian);
  Vector rates(6 + n);
  rates << m.state.velocity, m.state.angular_velocity, m.state.rate;
  EXPECT_LT(largest(jacobian * rates - velocity), 1e-12);
  motion.accelerate(m.base, m.joint);
  const Vector6 rate = motion.centroidal_momentum_rate();
  const Vector6 acceleration = motion.acceleration(hand, point);
  // The base wrench and the weight are all that acts.
  Vector torque(n);
  Vector6 missing;
  motion.inverse_dynamics(Matrix::Zero(6, body.size()), torque, missing);
  EXPECT_LT(largest(missing.head<3>() - Vector3(0, 0, 9.81 * body.mass()) - rate.head<3>()), 1e-10);
  const double h = 1e-4;
  const auto momentum = [&](double t) -> Vector6 {
    motion.move(at(t));
    return motion.centroidal_momentum();
  };
  const auto hand_velocity = [&](double t) -> Vector6 {
    motion.move(at(t));
    return motion.velocity(hand, point);
  };
  const auto hand_position = [&](double t) -> Vector3 {
    motion.move(at(t));
    return motion.position(hand, point);
  };
  // Central differences: errors of h^2 times third derivatives of some hundreds.
  EXPECT_LT(largest((momentum(h) - momentum(-h)) / (2.0 * h) - rate), 1e-4);
  Vector6 true_acceleration = (hand_velocity(h) - hand_velocity(-h)) / (2.0 * h);
  true_acceleration[2] += 9.81;
  EXPECT_LT(largest(true_acceleration - acceleration), 1e-4);
  EXPECT_LT(largest((hand_position(h) - hand_position(-h)) / (2.0 * h) - velocity.head<3>()), 1e-5);
  const auto centre = [&](double t) -> Vector3 {
    motion.move(at(t));
    return motion.centre_of_mass();
  };
  const Vector3 drift = (centre(h) - centre(-h)) / (2.0 * h);
  motion.move(at(0.0));
  EXPECT_LT(largest(drift - motion.centre_of_mass_velocity()), 1e-6);
}

TEST(BodyMotion, FreeFallTakesNoTorqueAndTorqueScalesWithMass) {
  HumanMeasures measures = person();
  const BodyTree body = human_body(measures);
  Motion m = random_motion(body, 9);
  m.state.rate.setZero();
  m.state.angular_velocity.setZero();
  BodyMotion motion(shared(body));
  motion.move(m.state);
  motion.accelerate(Vector6::Zero(), Vector::Zero(body.dofs()));
  Vector torque(body.dofs());
  Vector6 missing;
  motion.inverse_dynamics(Matrix::Zero(6, body.size()), torque, missing);
  EXPECT_EQ(largest(torque), 0.0);
  // Twice the mass of the same shape.
  std::vector<BodyLink> links = body.links();
  for (BodyLink& link : links) {
    link.mass *= 2.0;
    link.inertia *= 2.0;
  }
  m = random_motion(body, 9);
  BodyMotion heavy(shared(BodyTree(links)));
  Vector twice(body.dofs());
  for (BodyMotion* which : {&motion, &heavy}) {
    which->move(m.state);
    which->accelerate(m.base, m.joint);
    which->inverse_dynamics(Matrix::Zero(6, body.size()), which == &heavy ? twice : torque,
                            missing);
  }
  EXPECT_LT(largest(twice - 2.0 * torque), 1e-12 * largest(twice));
}

TEST(BodyTree, TorquesDoNotDependOnTheBase) {
  const BodyTree body = human_body(person());
  const Motion m = random_motion(body, 11);
  BodyMotion motion(shared(body));
  motion.move(m.state);
  motion.accelerate(m.base, m.joint);
  Random random(12);
  Matrix external(6, body.size());
  for (double& x : external.reshaped()) x = 10.0 * random.normal();
  Vector torque(body.dofs());
  Vector6 missing;
  motion.inverse_dynamics(external, torque, missing);
  external.col(0).head<3>() += m.state.orientation.transpose() * missing.head<3>();
  external.col(0).tail<3>() += m.state.orientation.transpose() * missing.tail<3>();
  for (const char* base : {"RightHand", "LeftFoot", "T8", "LeftShoulder"}) {
    SCOPED_TRACE(base);
    const BodyTree other = rebased(body, base);
    ASSERT_EQ(other.size(), body.size());
    EXPECT_EQ(other.link(0).name, base);
    EXPECT_NEAR(other.mass(), body.mass(), 1e-12);
    BodyMotion from(shared(other));
    const Index link = body.at_link(base);
    Motion n;
    n.state.position = motion.position(link);
    n.state.orientation = motion.link(link).axes;
    n.state.velocity = motion.velocity(link).head<3>();
    n.state.angular_velocity = motion.link(link).turn;
    n.base = motion.acceleration(link);
    n.state.angle.resize(body.dofs());
    n.state.rate.resize(body.dofs());
    n.joint.resize(body.dofs());
    for (Index k = 0; k < other.dofs(); ++k) {
      const Index was = body.dof(body.at_joint(other.link(other.link_of_dof(k)).joint));
      n.state.angle[k] = m.state.angle[was];
      n.state.rate[k] = m.state.rate[was];
      n.joint[k] = m.joint[was];
    }
    from.move(n.state);
    from.accelerate(n.base, n.joint);
    // External wrenches keep their place: link frames that moved need them told anew.
    Matrix told(6, body.size());
    for (Index i = 0; i < other.size(); ++i) {
      const Index was = body.at_link(other.link(i).name);
      const LinkMotion& old = motion.link(was);
      const LinkMotion& now = from.link(i);
      const Vector3 force = old.axes * external.col(was).head<3>();
      const Vector3 moment = old.axes * external.col(was).tail<3>();
      const Vector3 arm = motion.position(was) - from.position(i);
      told.col(i) << now.axes.transpose() * force,
          now.axes.transpose() * (moment + arm.cross(force));
    }
    Vector again(other.dofs());
    from.inverse_dynamics(told, again, missing);
    EXPECT_LT(largest(missing), 1e-9);
    for (Index k = 0; k < other.dofs(); ++k) {
      const std::string& joint = other.link(other.link_of_dof(k)).joint;
      EXPECT_NEAR(again[k], torque[body.dof(body.at_joint(joint))], 1e-9) << joint;
    }
  }
}

void expect_same(const BodyTree& a, const BodyTree& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  for (Index i = 0; i < a.size(); ++i) {
    const Index j = b.at_link(a.link(i).name);
    SCOPED_TRACE(a.link(i).name);
    EXPECT_EQ(a.link(i).joint, b.link(j).joint);
    if (i > 0) {
      EXPECT_EQ(a.link(a.parent(i)).name, b.link(b.parent(j)).name);
      EXPECT_LE(largest(a.link(i).position - b.link(j).position), tolerance);
      EXPECT_LE(largest(a.link(i).orientation - b.link(j).orientation), tolerance);
      EXPECT_LE(largest(a.link(i).axis - b.link(j).axis), tolerance);
      EXPECT_NEAR(a.link(i).lower, b.link(j).lower, tolerance);
      EXPECT_NEAR(a.link(i).upper, b.link(j).upper, tolerance);
    }
    EXPECT_EQ(a.link(i).massless, b.link(j).massless);
    EXPECT_NEAR(a.link(i).mass, b.link(j).mass, tolerance);
    EXPECT_LE(largest(a.link(i).centre - b.link(j).centre), tolerance);
    EXPECT_LE(largest(a.link(i).inertia - b.link(j).inertia), tolerance);
  }
}

TEST(BodyFile, IsReadBackAsItWasWritten) {
  for (const HumanJoints joints : {HumanJoints::k48, HumanJoints::k66}) {
    const BodyTree body = human_body(person(joints));
    expect_same(body, from_urdf(to_urdf(body, "human")), 0.0);
    expect_same(body, from_mjcf(to_mjcf(body, "human")), 1e-12);  // inertias by principal axes
  }
  // A body with turned frames, a fixed link and a reference angle.
  const BodyTree other = rebased(human_body(person()), "RightHand");
  expect_same(other, from_urdf(to_urdf(other, "from the hand")), 1e-14);
  const std::string path = std::filesystem::temp_directory_path() / "ulna_body_test.urdf";
  std::ofstream(path) << to_urdf(other, "human");
  expect_same(other, read_body(path), 1e-14);
  std::ofstream(path) << to_mjcf(other, "human");
  EXPECT_EQ(read_body(path).dofs(), 48);
  std::ofstream(path) << "time,angle\n";
  EXPECT_THROW(read_body(path), Error);
  std::filesystem::remove(path);
  EXPECT_THROW(read_body(path), Error);
}

void expect_urdf_refused(const std::string& inside, const char* words) {
  try {
    from_urdf("<robot name='r'>" + inside + "</robot>");
    ADD_FAILURE() << "accepted: " << inside;
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(BodyFile, SaysWhatIsWrongWithUrdf) {
  const std::string trunk =
      "<link name='trunk'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' "
      "iyz='0' izz='1'/></inertial></link>";
  const auto joint = [](const char* type, const char* parent, const char* child) {
    return std::string("<joint name='j' type='") + type + "'><parent link='" + parent +
           "'/><child link='" + child + "'/></joint>";
  };
  EXPECT_EQ(from_urdf("<robot>" + trunk + "</robot>").size(), 1);
  expect_urdf_refused("", "no links");
  expect_urdf_refused(trunk + trunk, "two links");
  expect_urdf_refused(trunk + "<link name='arm'/>", "carried by no joint");
  expect_urdf_refused(trunk + "<link name='arm'/>" + joint("prismatic", "trunk", "arm"),
                      "'prismatic'");
  expect_urdf_refused(trunk + joint("revolute", "trunk", "arm"), "'arm', which is not there");
  expect_urdf_refused(trunk + "<link name='a'/><link name='b'/>" + joint("fixed", "a", "b") +
                          joint("fixed", "b", "a"),
                      "ring");
  expect_urdf_refused(
      trunk + "<link name='a'/>" + joint("fixed", "trunk", "a") + joint("fixed", "trunk", "a"),
      "two joints");
  expect_urdf_refused(
      "<link name='t'><inertial><mass value='1 kg'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' "
      "iyz='0' izz='1'/></inertial></link>",
      "1 kg");
  expect_urdf_refused("<link name='t'><inertial><mass value='1'/></inertial></link>", "ixx");
  expect_urdf_refused(
      "<link name='t'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' "
      "iyz='0' izz='-1'/></inertial></link>",
      "not positive");
  EXPECT_THROW(from_urdf("<robot"), Error);
  EXPECT_THROW(from_urdf(""), Error);
  EXPECT_THROW(from_urdf("<mujoco/>"), Error);
  EXPECT_THROW(from_mjcf("<mujoco/>"), Error);
  EXPECT_THROW(from_mjcf("<mujoco><worldbody><body><joint type='slide'/><geom size='1'/></body>"
                         "</worldbody></mujoco>"),
               Error);
  EXPECT_THROW(from_mjcf("<mujoco><worldbody><body><geom size='1'/></body><body><geom size='1'/>"
                         "</body></worldbody></mujoco>"),
               Error);
}

TEST(BodyFile, ReadsBallsAndAnchorsOfAUser) {
  const BodyTree body = from_mjcf(
      "<mujoco><worldbody><body name='trunk'><freejoint/><geom size='0.1'/>"
      "<body name='arm' pos='0 0.3 0'><joint name='shoulder' type='ball' pos='0 -0.1 0'/>"
      "<geom type='box' size='0.03 0.1 0.03'/>"
      "<body name='fore' pos='0 0.2 0'><joint name='elbow' axis='0 0 1' pos='0.01 -0.1 0' "
      "range='0 140' limited='true'/>"
      "<geom type='box' size='0.02 0.1 0.02'/></body></body></body></worldbody></mujoco>");
  EXPECT_EQ(body.size(), 5);
  EXPECT_EQ(body.dofs(), 4);
  EXPECT_EQ(body.link(body.at_joint("shoulder_rotz")).name, "arm");
  EXPECT_NEAR(body.link(body.at_joint("elbow")).upper, 140 * kDegree, 1e-12);
  EXPECT_LT(largest(body.link(body.at_joint("shoulder_rotx")).position - Vector3(0, 0.2, 0)),
            1e-14);
  // From the shoulder's anchor (0, -0.1, 0) to the elbow's (0.01, 0.1, 0), arm axes.
  EXPECT_LT(largest(body.link(body.at_link("fore")).position - Vector3(0.01, 0.2, 0)), 1e-14);
  EXPECT_LT(largest(body.link(body.at_link("fore")).centre - Vector3(-0.01, 0.1, 0)), 1e-14);
}

TEST(BodyState, IsChecked) {
  const BodyTree body = human_body(person());
  BodyState state = random_motion(body, 1).state;
  check_state(body, state);
  BodyState bad = state;
  bad.angle.conservativeResize(47);
  EXPECT_THROW(check_state(body, bad), Error);
  bad = state;
  bad.rate[3] = kNaN;
  EXPECT_THROW(check_state(body, bad), Error);
  bad = state;
  bad.orientation *= 1.1;
  EXPECT_THROW(check_state(body, bad), Error);
}

}  // namespace
}  // namespace ulna
