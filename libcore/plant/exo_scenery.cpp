#include "plant/exo_scenery.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace ulna {
namespace {

constexpr Colour kMetal = {0.36F, 0.40F, 0.45F, 1.0F};
constexpr Colour kDrive = {0.17F, 0.20F, 0.24F, 1.0F};
constexpr Colour kTrim = {0.93F, 0.62F, 0.13F, 1.0F};
constexpr Colour kCuff = {0.62F, 0.70F, 0.78F, 0.42F};
constexpr Colour kStrap = {0.12F, 0.13F, 0.15F, 1.0F};
constexpr Colour kBone = {0.95F, 0.91F, 0.80F, 1.0F};
constexpr Colour kSkin = {0.93F, 0.76F, 0.66F, 0.26F};
constexpr Colour kHand = {0.91F, 0.74F, 0.64F, 1.0F};
constexpr Colour kFigure = {0.80F, 0.82F, 0.85F, 1.0F};
constexpr Colour kStool = {0.46F, 0.50F, 0.55F, 1.0F};

constexpr double kBar = 0.014;  // radius of the device's bars, m
constexpr double kDriveRadius = 0.038;
constexpr double kDriveHalf = 0.028;    // of a drive's length
constexpr double kGuideRadius = 0.105;  // of a ring around the arm that a link turns on
constexpr double kFloor = -0.92;        // under the shoulder of a sitting person, m

Shape shape(ShapeKind kind, const Vector3& at, const Vector3& size, const Colour& colour,
            float shine = 0.3F) {
  return {.kind = kind, .position = at, .size = size, .colour = colour, .shine = shine};
}

// The device --------------------------------------------------------------------------------------

// A link's hinge as it is built: a drive beside the body that the link's mass lies on, or, where
// the axis runs through the arm, a ring around it.
struct BuiltHinge {
  Vector3 drive;  // link axes, m
  Vector3 axis;
  bool ring = false;
  Vector3 side = Vector3::UnitX();  // of the ring, on which the link is
};

class DeviceLook {
 public:
  DeviceLook(const ExoDescription& exo, std::vector<BodyShape>& shapes)
      : exo_(exo), shapes_(shapes), tree_(bodies_of(exo)) {
    pose_ = tree_.poses(tree_.reference());
    for (std::size_t i = 0; i < exo_.links.size(); ++i) hinges_.push_back(built_hinge(i));
  }

  void add(const std::vector<Cuff>& cuffs) {
    for (std::size_t i = 0; i < exo_.links.size(); ++i) {
      add_hinge(i);
      if (i + 1 < exo_.links.size()) add_bars(i);
    }
    add_stand();
    for (const Cuff& cuff : cuffs) add_cuff(cuff);
  }

 private:
  BuiltHinge built_hinge(std::size_t i) const {
    const ExoLink& link = exo_.links[i];
    BuiltHinge h;
    h.axis = link.axis.normalized();
    h.drive = h.axis * h.axis.dot(link.centre);
    // In the reference the upper arm is on the line from the origin to the last joint.
    const Vector3 elbow = pose_[exo_.links.size() - 1].position;
    const Vector3 axis = pose_[i].orientation * h.axis;
    const double along = elbow.norm() > 0.05 ? std::fabs(axis.dot(elbow.normalized())) : 0.0;
    const double off = axis.cross(pose_[i].position).norm();
    h.ring = i > 0 && i + 1 < exo_.links.size() && along > 0.95 && off < 0.05;
    const Vector3 side = link.centre - h.drive;
    if (h.ring && side.norm() > 1e-6) h.side = side.normalized();
    return h;
  }

  void put(std::size_t link, const Shape& s) { shapes_.push_back({exo_.links[link].name, s}); }
  void put_bar(std::size_t link, const Vector3& a, const Vector3& b) {
    if ((b - a).norm() > 1e-4) put(link, bar(a, b, kBar, kMetal));
  }

  void add_hinge(std::size_t i) {
    const BuiltHinge& h = hinges_[i];
    if (h.ring) {
      add_arc(i, h.drive, h.axis, h.side, kGuideRadius, 1.15, 0.012, kDrive);
      return;
    }
    const Matrix3 axes = axes_along(h.axis);
    Shape body =
        shape(ShapeKind::kCylinder, h.drive, {kDriveRadius, 0.0, kDriveHalf}, kDrive, 0.5F);
    body.orientation = axes;
    put(i, body);
    for (const double end : {-1.0, 1.0}) {
      Shape cap = body;
      cap.position += end * kDriveHalf * h.axis;
      cap.size = {0.82 * kDriveRadius, 0.0, 0.004};
      cap.colour = end * h.axis.dot(h.drive) >= 0.0 ? kTrim : kMetal;
      put(i, cap);
    }
  }

  void add_arc(std::size_t link, const Vector3& centre, const Vector3& axis, const Vector3& side,
               double radius, double half_angle, double thickness, const Colour& colour) {
    constexpr int kPieces = 18;
    const Vector3 across = axis.cross(side);
    const auto at = [&](int k) {
      const double angle = half_angle * (2.0 * k / kPieces - 1.0);
      return Vector3(centre + radius * (std::cos(angle) * side + std::sin(angle) * across));
    };
    for (int k = 0; k < kPieces; ++k) put(link, bar(at(k), at(k + 1), thickness, colour));
  }

  // Where a link's own hinge carries it: on its drive, or at the side of its ring.
  Vector3 outlet(std::size_t i) const {
    const BuiltHinge& h = hinges_[i];
    return h.ring ? Vector3(h.drive + kGuideRadius * h.side) : h.drive;
  }

  // First across this link's axis, then along it, so that it turns free of what it carries.
  void add_bars(std::size_t i) {
    const ExoLink& next = exo_.links[i + 1];
    const BuiltHinge& h = hinges_[i + 1];
    const Vector3 from = outlet(i);
    const auto here = [&](const Vector3& p) {
      return Vector3(next.position + reference_turn(i + 1) * p);
    };
    if (h.ring) {
      // The ring's carriage is on the side that the bar comes from.
      const Vector3 axis = reference_turn(i + 1) * h.axis;
      const Vector3 centre = here(h.drive);
      Vector3 out = from - centre;
      out -= out.dot(axis) * axis;
      const Vector3 side = out.norm() > 1e-6 ? Vector3(out.normalized()) : here(h.side);
      const Vector3 foot = centre + kGuideRadius * side;
      const Vector3 corner = from + (foot - from).dot(axis) * axis;
      put_bar(i, from, corner);
      put_bar(i, corner, foot);
      Shape carriage = shape(ShapeKind::kBox, foot, {0.022, 0.022, 0.03}, kTrim);
      carriage.orientation = axes_along(axis, side);
      put(i, carriage);
      return;
    }
    const Vector3 to = here(h.drive);
    const Vector3& axis = hinges_[i].axis;
    const Vector3 corner = hinges_[i].ring
                               ? Vector3(from + (to - from).dot(reference_turn(i + 1) * h.axis) *
                                                    (reference_turn(i + 1) * h.axis))
                               : Vector3(to - (to - from).dot(axis) * axis);
    put_bar(i, from, corner);
    put_bar(i, corner, to);
  }

  // Of link i in the one before, at its reference angle.
  const Matrix3& reference_turn(std::size_t i) const { return exo_.links[i].orientation; }

  // From the floor to the first drive, behind it.
  void add_stand() {
    const ExoLink& first = exo_.links.front();
    const auto world = [&](const Vector3& p) {
      return Vector3(first.position + first.orientation * p);
    };
    const Vector3 drive = world(hinges_.front().drive);
    const Vector3 axis = first.orientation * hinges_.front().axis;
    const double back = axis.dot(drive) >= 0.0 ? 1.0 : -1.0;
    const Vector3 head = drive + back * (kDriveHalf + 0.06) * axis;
    const auto still = [&](Shape s, bool framed) {
      s.framed = framed;
      shapes_.push_back({"", s});
    };
    still(bar(drive, head, 0.024, kMetal, ShapeKind::kCylinder), true);
    const Vector3 foot(head.x(), head.y(), kFloor + 0.02);
    still(bar(head, foot, 0.028, kMetal), false);
    still(shape(ShapeKind::kSphere, head, {0.034, 0.0, 0.0}, kDrive), true);
    still(shape(ShapeKind::kBox, {foot.x(), foot.y(), kFloor + 0.012}, {0.16, 0.2, 0.012}, kDrive),
          false);
  }

  void add_cuff(const Cuff& cuff) {
    const auto link = std::find_if(exo_.links.begin(), exo_.links.end(),
                                   [&](const ExoLink& l) { return l.name == cuff.link; });
    if (link == exo_.links.end()) return;
    const auto i = static_cast<std::size_t>(link - exo_.links.begin());
    const double half_plate = cuff.radius() * std::sin(cuff.half_angle() / Cuff::kPlates);
    for (int k = 0; k < Cuff::kPlates; ++k) {
      const Vector3 out = cuff.outward(k);
      Shape plate = shape(ShapeKind::kBox, cuff.position + cuff.orientation * (cuff.face() * out),
                          {half_plate + 0.0015, 0.5 * cuff.depth, 0.003}, kCuff, 0.4F);
      Matrix3 axes;
      axes.col(2) = out;
      axes.col(1) = Vector3::UnitZ();
      axes.col(0) = axes.col(1).cross(axes.col(2));
      plate.orientation = cuff.orientation * axes;
      put(i, plate);
    }
    // From the bar of the link to the back of the cuff.
    const Vector3 back =
        cuff.position +
        cuff.orientation * (cuff.face() * cuff.outward(2) + cuff.face() * cuff.outward(3)) / 2.0;
    add_arm_to_cuff(i, back);
  }

  void add_arm_to_cuff(std::size_t i, const Vector3& back) {
    const Vector3 from = outlet(i);
    const Vector3 along =
        (i + 1 < exo_.links.size() ? reference_turn(i + 1) * hinges_[i + 1].axis : hinges_[i].axis);
    // Parallel to the limb first, then under the cuff.
    const Vector3 corner = back + (from - back).dot(along) * along;
    put_bar(i, from, corner);
    put_bar(i, corner, back);
  }

  const ExoDescription& exo_;
  std::vector<BodyShape>& shapes_;
  RigidTree tree_;
  std::vector<RigidTree::Pose> pose_;
  std::vector<BuiltHinge> hinges_;
};

// The arm -----------------------------------------------------------------------------------------

void add_finger(const Vector3& base, const Vector3& way, double radius,
                std::vector<BodyShape>& shapes) {
  shapes.push_back({"hand", bar(base, base + way, radius, kHand)});
}

void add_arm(const ExoScene& scene, bool skin, std::vector<BodyShape>& shapes) {
  const ArmDescription& arm = scene.arm;
  const Vector3 elbow = arm.upper_scale * arm.elbow;
  const Vector3 wrist = arm.fore_scale * Vector3(0.265, 0.0, 0.0);         // radius axes
  const Vector3 ulna_end = arm.fore_scale * Vector3(0.25, -0.004, 0.009);  // ulna axes
  const auto put = [&](const char* body, const Shape& s) { shapes.push_back({body, s}); };
  put("humerus", shape(ShapeKind::kSphere, {0.0, 0.0, 0.0}, {0.021, 0.0, 0.0}, kBone));
  put("humerus", bar({0.0, 0.0, 0.0}, elbow, 0.0105, kBone));
  put("humerus", shape(ShapeKind::kEllipsoid, elbow, {0.014, 0.026, 0.015}, kBone));
  put("ulna", bar(arm.fore_scale * Vector3(-0.012, 0.0, -0.008), ulna_end, 0.0075, kBone));
  put("ulna", shape(ShapeKind::kSphere, arm.fore_scale * Vector3(-0.01, 0.0, -0.006),
                    {0.0125, 0.0, 0.0}, kBone));
  put("radius", bar({0.0, 0.0, 0.0}, wrist, 0.0075, kBone));
  put("radius", shape(ShapeKind::kSphere, {0.0, 0.0, 0.0}, {0.0105, 0.0, 0.0}, kBone));
  // Palm down, thumb to the left of a right hand.
  put("hand", shape(ShapeKind::kEllipsoid, {0.045, 0.0, 0.0}, {0.055, 0.042, 0.016}, kHand));
  for (int i = 0; i < 4; ++i) {
    const double y = 0.029 - 0.0193 * i;
    const double length = i == 3 ? 0.052 : i == 0 ? 0.066 : 0.074;
    add_finger({0.09 - 0.004 * std::abs(i - 1), y, 0.0}, {0.6 * length, 0.04 * y, -0.002}, 0.0085,
               shapes);
    add_finger({0.09 + 0.6 * length, 1.04 * y, -0.002}, {0.4 * length, 0.0, -0.014}, 0.0078,
               shapes);
  }
  add_finger({0.02, 0.036, -0.004}, {0.05, 0.03, -0.012}, 0.0098, shapes);
  if (!skin) return;
  const Vector3 middle = 0.54 * elbow;
  Shape upper = shape(ShapeKind::kEllipsoid, middle, {0.05, 0.05, 0.66 * elbow.norm()}, kSkin);
  upper.orientation = axes_along(elbow, Vector3::UnitY());
  put("humerus", upper);
  const Vector3 fore(0.132 * arm.fore_scale, -0.009, 0.010);
  Shape lower = shape(ShapeKind::kEllipsoid, fore, {0.037, 0.041, 0.175 * arm.fore_scale}, kSkin);
  lower.orientation = axes_along(Vector3::UnitX(), Vector3::UnitY());
  put("ulna", lower);
}

// The person and the room -------------------------------------------------------------------------

// To the left of a right shoulder, sitting upright.
void add_person(std::vector<BodyShape>& shapes) {
  const auto put = [&](Shape s) {
    s.framed = false;
    s.shine = 0.1F;
    shapes.push_back({"", s});
  };
  const double y = 0.20;  // of the body's middle
  put(shape(ShapeKind::kEllipsoid, {-0.045, y, -0.17}, {0.105, 0.155, 0.25}, kFigure));
  put(shape(ShapeKind::kEllipsoid, {-0.03, y, -0.40}, {0.11, 0.15, 0.14}, kFigure));
  put(bar({-0.045, 0.06, 0.0}, {-0.045, 2.0 * y - 0.06, 0.0}, 0.052, kFigure));
  put(bar({-0.045, y, 0.03}, {-0.03, y, 0.16}, 0.048, kFigure));
  put(shape(ShapeKind::kEllipsoid, {-0.015, y, 0.255}, {0.098, 0.078, 0.118}, kFigure));
  put(shape(ShapeKind::kCylinder, {-0.03, y, -0.535}, {0.19, 0.0, 0.022}, kStool));
  put(bar({-0.03, y, -0.55}, {-0.03, y, kFloor + 0.02}, 0.026, kStool));
  put(shape(ShapeKind::kCylinder, {-0.03, y, kFloor + 0.012}, {0.2, 0.0, 0.012}, kStool));
}

// The published device has its cuffs; where another has them only its soft interfaces say.
std::vector<Cuff> cuffs_of(const ExoDescription& exo) {
  const ExoDescription published = ExoDescription::published();
  const bool same = exo.name == published.name && exo.links.size() == published.links.size();
  return same ? std::vector<Cuff>{Cuff::upper_arm(), Cuff::forearm()} : std::vector<Cuff>();
}

}  // namespace

Scenery scenery_of(const ExoScene& scene, const ExoLookOptions& options) {
  Scenery s;
  s.engine_shapes = false;  // the cylinders that muscles go around
  s.floor = options.floor;
  s.floor_height = kFloor;
  if (scene.has_exo()) {
    DeviceLook(scene.exo, s.shapes).add(options.cuffs ? *options.cuffs : cuffs_of(scene.exo));
  }
  if (scene.has_arm()) add_arm(scene, options.skin, s.shapes);
  if (scene.has_arm() && options.person) add_person(s.shapes);
  if (scene.has_exo()) s.sweep.push_back(scene.exo.links.back().joint);
  if (scene.has_arm() && scene.coupling != Coupling::kRigid) s.sweep.push_back("elbow_flexion");
  return s;
}

}  // namespace ulna
