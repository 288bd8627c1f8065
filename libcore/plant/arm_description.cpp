#include "plant/arm_description.hpp"

#include <cmath>
#include <set>

#include "base/error.hpp"
#include "plant/arm_muscles.hpp"

namespace ulna {
namespace {

constexpr double kPublishedUpperScale = 0.86267;
constexpr double kForearmLength = 0.265;
const Vector3 kRadiusInUlna(0.0133, -0.0171, 0.0163);  // scale 1, m
const Vector3 kHandInRadius(kForearmLength, 0.0, 0.0);

ArmSegment cylinder(double mass, double radius, double length, double scale,
                    const Vector3& centre) {
  const double along = mass * scale * scale * radius * radius / 2.0;
  const double across = scale * scale * mass * (radius * radius / 4.0 + length * length / 12.0);
  return {mass, scale * centre, Vector3(along, across, across)};
}

// Solid ellipsoid: the soft tissue around a segment.
ArmSegment ellipsoid(double mass, const Vector3& half, const Vector3& centre) {
  const Vector3 square = half.cwiseAbs2();
  return {mass, centre,
          mass / 5.0 *
              Vector3(square.y() + square.z(), square.x() + square.z(), square.x() + square.y())};
}

// A palm of 0.5 kg (half sides 45, 40, 10 mm), fingers of 0.12 kg at 130 mm and a thumb of 15 g:
// the hand of the published simulation with its fingers straight and still.
ArmSegment whole_hand() {
  struct Piece {
    double mass;
    Vector3 at;
    Vector3 moments;
  };
  const Vector3 palm = Vector3(0.045, 0.04, 0.01).cwiseAbs2();
  const Piece pieces[] = {
      {0.5,
       {0.045, 0, 0},
       0.5 / 3.0 * Vector3(palm.y() + palm.z(), palm.x() + palm.z(), palm.x() + palm.y())},
      {0.12, {0.13, 0, 0}, 0.12 / 12.0 * Vector3(0.08 * 0.08, 0.08 * 0.08, 2 * 0.08 * 0.08)},
      {0.015, {0.06, 0.05, 0}, Vector3::Constant(1e-6)}};
  ArmSegment hand;
  for (const Piece& p : pieces) {
    hand.mass += p.mass;
    hand.centre += p.mass * p.at;
  }
  hand.centre /= hand.mass;
  for (const Piece& p : pieces) {
    const Vector3 d = (p.at - hand.centre).cwiseAbs2();
    hand.moments += p.moments + p.mass * Vector3(d.y() + d.z(), d.x() + d.z(), d.x() + d.y());
  }
  return hand;
}

ArmSegment gyrating(double mass, double length, double centre, double sagittal, double frontal,
                    double along) {
  const double square = mass * length * length;
  return {mass, Vector3(centre * length, 0.0, 0.0),
          square * Vector3(along * along, sagittal * sagittal, frontal * frontal)};
}

void check_segment(const ArmSegment& s, const std::string& name, bool needed) {
  require(std::isfinite(s.mass) && s.centre.allFinite() && s.moments.allFinite(), "segment",
          "the " + name + " holds a number that is not finite");
  require(needed ? s.mass > 0.0 : s.mass >= 0.0, "mass",
          "the " + name + " must have a positive mass");
  if (s.mass > 0.0) check_inertia(s.moments.asDiagonal(), "the " + name + " ");
}

void check_range(const JointRange& range, const char* name) {
  require(std::isfinite(range.lower) && std::isfinite(range.upper) && range.lower < range.upper,
          "range", std::string("the range of ") + name + " must be two angles, the lower first");
}

void check_muscle(const Muscle& m, const ArmDescription& arm) {
  const std::string what = "muscle '" + m.name + "' ";
  require(!m.name.empty(), "muscle", "a muscle has no name");
  require(std::isfinite(m.force) && m.force > 0.0, "force", what + "must have a positive force");
  require(std::isfinite(m.range[0]) && std::isfinite(m.range[1]) && m.range[0] >= 0.5 &&
              m.range[0] < m.range[1],
          "range", what + "must have a range of two lengths of 0.5 or more, the shorter first");
  require(m.points.size() >= 2, "points", what + "must have two points or more");
  for (const MusclePoint& point : m.points) {
    require(point.at.allFinite(), "points", what + "has a point that is not finite");
  }
  if (m.wrap.empty()) return;
  for (const WrapCylinder& wrap : arm.wraps) {
    if (wrap.name == m.wrap) return;
  }
  throw Error(Fault::kArgument, "wrap",
              what + "goes around '" + m.wrap + "', which is not among the cylinders");
}

}  // namespace

ArmDescription ArmDescription::cylinders(double upper_factor, double fore_factor, double upper_mass,
                                         double fore_mass) {
  ArmDescription arm;
  arm.upper_scale = kPublishedUpperScale * upper_factor;
  arm.fore_scale = fore_factor;
  arm.humerus = cylinder(upper_mass, 0.045, 0.2907, arm.upper_scale, 0.5 * arm.elbow);
  const Vector3 ulna_centre(0.5 * (kForearmLength + 0.0133), -0.00855, 0.00815);
  arm.ulna = cylinder(0.5 * fore_mass, 0.03, kForearmLength, fore_factor, ulna_centre);
  arm.radius = cylinder(0.5 * fore_mass, 0.03, kForearmLength, fore_factor, {0.1325, 0, 0});
  arm.hand = whole_hand();
  arm.upper_tissue = ellipsoid(0.489, {0.08, 0.04, 0.04}, arm.upper_scale * Vector3(0.14, 0, 0));
  arm.fore_tissue = ellipsoid(0.351, {0.08, 0.03, 0.03}, fore_factor * Vector3(0.12, -0.01, 0.015));
  arm.wraps = elbow_cylinders();
  arm.muscles = fitted_elbow_muscles();
  arm.check();
  return arm;
}

ArmDescription ArmDescription::person(double height, double mass) {
  require(std::isfinite(height) && height > 0.5 && height < 2.6, "height_m",
          "height must be between 0.5 and 2.6 m");
  require(std::isfinite(mass) && mass > 5.0 && mass < 400.0, "mass_kg",
          "mass must be between 5 and 400 kg");
  const double upper = 0.172 * height;
  const double fore = 0.157 * height;
  ArmDescription arm = cylinders();
  arm.upper_scale = upper / arm.elbow.norm();
  arm.fore_scale = fore / (kRadiusInUlna + kHandInRadius).norm();
  arm.humerus = gyrating(0.03 * mass, upper, 0.436, 0.328, 0.31, 0.182);
  // One segment in two bodies that move together or turn about its axis.
  arm.ulna = gyrating(0.5 * 0.0175 * mass, fore, 0.43, 0.295, 0.284, 0.13);
  arm.radius = arm.ulna;
  arm.radius.centre -= arm.fore_scale * kRadiusInUlna;
  arm.upper_tissue = {};
  arm.fore_tissue = {};
  arm.check();
  return arm;
}

Vector3 ArmDescription::scaled(const MusclePoint& point) const {
  switch (point.frame) {
    case Frame::kHumerus:
      return upper_scale * point.at;
    case Frame::kUlna:
    case Frame::kRadius:
      return fore_scale * point.at;
    default:
      return point.at;
  }
}

void ArmDescription::check() const {
  require(std::isfinite(upper_scale) && upper_scale > 0.2 && upper_scale < 3.0, "upper_scale",
          "the upper arm's scale must be between 0.2 and 3");
  require(std::isfinite(fore_scale) && fore_scale > 0.2 && fore_scale < 3.0, "fore_scale",
          "the forearm's scale must be between 0.2 and 3");
  require(elbow.allFinite() && elbow.norm() > 0.01, "elbow", "the elbow must be off the shoulder");
  require(std::isfinite(damping) && damping >= 0.0, "damping",
          "the arm's joint damping must be 0 or more");
  check_segment(humerus, "humerus", true);
  check_segment(ulna, "ulna", true);
  check_segment(radius, "radius", true);
  check_segment(hand, "hand", true);
  check_segment(upper_tissue, "upper tissue", false);
  check_segment(fore_tissue, "forearm tissue", false);
  check_range(flexion, "the shoulder's flexion");
  check_range(abduction, "the shoulder's abduction");
  check_range(rotation, "the shoulder's rotation");
  check_range(elbow_flexion, "the elbow");
  for (const WrapCylinder& wrap : wraps) {
    require(std::isfinite(wrap.radius) && wrap.radius > 0.0 && wrap.side.allFinite() &&
                wrap.side.norm() > 0.0,
            "wraps", "cylinder '" + wrap.name + "' must have a positive radius and a side");
  }
  std::set<std::string> names;
  for (const Muscle& muscle : muscles) {
    check_muscle(muscle, *this);
    require(names.insert(muscle.name).second, "muscle",
            "two muscles have the name '" + muscle.name + "'");
  }
}

const char* body_word(Frame frame) {
  switch (frame) {
    case Frame::kHumerus:
      return "humerus";
    case Frame::kUlna:
      return "ulna";
    case Frame::kRadius:
      return "radius";
    default:
      return "";
  }
}

Vector3 still_frame(Frame frame) {
  const Vector3 thorax(-0.0157, 0.2097, 0.0231);  // of the shoulder centre; clavicle at its origin
  return frame == Frame::kScapula ? Vector3(thorax + Vector3(-0.0282, -0.2077, -0.0001)) : thorax;
}

namespace {

struct Hinge {
  const char* joint;
  Vector3 axis;
  double reference;
};

RigidBody body_of(const char* name, const ArmSegment& segment, Index parent,
                  const Vector3& position) {
  RigidBody body{.name = name, .parent = parent};
  body.position = position;
  body.mass = segment.mass;
  body.centre = segment.centre;
  body.inertia = segment.moments.asDiagonal();
  return body;
}

// All hinges but the last on massless frames at the body's place.
Index append_on(RigidBody body, const std::vector<Hinge>& hinges, std::vector<RigidBody>& bodies) {
  for (std::size_t i = 0; i < hinges.size(); ++i) {
    const Hinge& hinge = hinges[i];
    const bool last = i + 1 == hinges.size();
    RigidBody frame = last ? body : RigidBody{.name = std::string(hinge.joint) + "_frame"};
    if (!last) frame.massless = true;
    frame.parent = body.parent;
    frame.position = body.position;
    frame.orientation = body.orientation;
    frame.joint = hinge.joint;
    frame.axis = hinge.axis;
    frame.reference = hinge.reference;
    bodies.push_back(frame);
    body.parent = static_cast<Index>(bodies.size()) - 1;
    body.position = Vector3::Zero();
    body.orientation = Matrix3::Identity();
  }
  if (hinges.empty()) bodies.push_back(body);
  return static_cast<Index>(bodies.size()) - 1;
}

}  // namespace

void append_arm(const ArmDescription& arm, const ArmMount& mount, std::vector<RigidBody>& bodies) {
  RigidBody humerus = body_of("humerus", arm.humerus, mount.upper_parent, mount.upper.position);
  humerus.orientation = mount.upper.orientation;
  std::vector<Hinge> shoulder = {{"shoulder_flexion", Vector3::UnitY(), -0.5 * kPi},
                                 {"shoulder_abduction", Vector3::UnitZ(), 0.0},
                                 {"shoulder_rotation", Vector3::UnitX(), 0.0}};
  std::vector<Hinge> elbow = {{"elbow_flexion", -Vector3::UnitY(), 0.0}};
  if (mount.fixed) shoulder.clear(), elbow.clear();
  const Index upper = append_on(humerus, shoulder, bodies);

  RigidBody ulna =
      body_of("ulna", arm.ulna, mount.fixed ? mount.fore_parent : upper,
              mount.fixed ? mount.fore.position : Vector3(arm.upper_scale * arm.elbow));
  if (mount.fixed) ulna.orientation = mount.fore.orientation;
  const Index fore = append_on(ulna, elbow, bodies);

  std::vector<Hinge> pronation;
  if (arm.pronation) pronation = {{"forearm_pronation", Vector3::UnitX(), 0.0}};
  const Index radius = append_on(
      body_of("radius", arm.radius, fore, arm.fore_scale * kRadiusInUlna), pronation, bodies);
  std::vector<Hinge> wrist;
  if (arm.wrist) {
    wrist = {{"wrist_flexion", -Vector3::UnitY(), 0.0}, {"wrist_abduction", Vector3::UnitZ(), 0.0}};
  }
  append_on(body_of("hand", arm.hand, radius, arm.fore_scale * kHandInRadius), wrist, bodies);

  const Vector3 origin = Vector3::Zero();
  if (arm.upper_tissue.mass > 0.0) {
    bodies.push_back(body_of("upper_tissue", arm.upper_tissue, upper, origin));
  }
  if (arm.fore_tissue.mass > 0.0) {
    bodies.push_back(body_of("fore_tissue", arm.fore_tissue, fore, origin));
  }
}

}  // namespace ulna
