#include "plant/body/human_body.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "base/error.hpp"
#include "base/words.hpp"
#include "plant/body/human_table.hpp"

namespace ulna {
namespace {

using human::kLengths;

constexpr double kShortest = 0.005;  // m
constexpr double kLongest = 1.2;

// Segment lengths of one person, m.
class Lengths {
 public:
  explicit Lengths(const HumanMeasures& measures) {
    for (const human::Length& l : kLengths) {
      length_[std::string(l.segment)] = l.fraction * measures.height;
    }
    std::set<std::string> seen;
    for (const SegmentLength& given : measures.lengths) {
      require(length_.contains(given.segment), "lengths",
              "there is no segment '" + given.segment +
                  "' to give a length; there are: " + join(segment_names()));
      require(seen.insert(given.segment).second, "lengths",
              "segment '" + given.segment + "' has two lengths");
      require(given.length >= kShortest && given.length <= kLongest, "lengths",
              sentence(4, "the length of segment '", given.segment, "' is ", given.length,
                       " m; lengths between ", kShortest, " and ", kLongest, " m are taken"));
      length_[given.segment] = given.length;
    }
  }
  double operator[](const char* segment) const { return length_.at(segment); }

 private:
  std::map<std::string, double> length_;
};

// Joint centres and ends of segments, neutral pose, from the midpoint of the hips.
std::map<std::string, Vector3> points_of(const Lengths& l) {
  std::map<std::string, Vector3> at;
  double z = l["pelvis_height"];
  at["jL5S1"] = {0, 0, z};
  at["jL4L3"] = {0, 0, z += l["L5"]};
  at["jL1T12"] = {0, 0, z += l["L3"]};
  at["jT9T8"] = {0, 0, z += l["T12"]};
  const double top = z += l["T8"];
  at["jT1C7"] = {0, 0, top};
  at["jC1Head"] = {0, 0, z += l["neck"]};
  at["HeadTop"] = {0, 0, z + l["head"]};
  for (const double side : {-1.0, 1.0}) {
    const std::string s = side < 0.0 ? "Right" : "Left";
    at["j" + s + "C7Shoulder"] = {0, 0, top};
    double y = l["shoulder"];
    at["j" + s + "Shoulder"] = {0, side * y, top};
    at["j" + s + "Elbow"] = {0, side * (y += l["upper_arm"]), top};
    at["j" + s + "Wrist"] = {0, side * (y += l["forearm"]), top};
    at[s + "HandTip"] = {0, side * (y + l["hand"]), top};
    const double hip = side * l["pelvis_width"] / 2.0;
    double down = -l["thigh"];
    at["j" + s + "Hip"] = {0, hip, 0};
    at["j" + s + "Knee"] = {0, hip, down};
    at["j" + s + "Ankle"] = {0, hip, down -= l["shank"]};
    down -= l["foot_height"];
    const double foot = l["foot_length"];
    at["j" + s + "BallFoot"] = {(human::kBallOfFoot - human::kAnkleOfFoot) * foot, hip, down};
    at[s + "Heel"] = {-human::kAnkleOfFoot * foot, hip, down};
    at[s + "ToeTip"] = {(1.0 - human::kAnkleOfFoot) * foot, hip, down};
  }
  return at;
}

std::map<std::string, Vector3> points_of(const HumanMeasures& measures, const Lengths& lengths) {
  std::map<std::string, Vector3> at = points_of(lengths);
  if (measures.points.empty()) return at;
  std::map<std::string, Vector3> given;
  for (const BodyPoint& point : measures.points) {
    require(at.contains(point.name), "points",
            "there is no point '" + point.name + "' of a body; there are: " + join(point_names()));
    require(point.position.allFinite(), "points",
            "point '" + point.name + "' holds a number that is not finite");
    require(given.emplace(point.name, point.position).second, "points",
            "point '" + point.name + "' is given twice");
  }
  // Points may come in any frame: the hips tell where the pelvis is.
  for (const char* hip : {"jRightHip", "jLeftHip"}) {
    require(given.contains(hip), "points",
            std::string("points must hold both hips, from which the others are seen; ") + hip +
                " is missing");
  }
  const Vector3 pelvis = 0.5 * (given["jRightHip"] + given["jLeftHip"]);
  // A point that is not given keeps its place relative to the joint before it.
  std::map<std::string, Vector3> placed;
  placed["jRightHip"] = given["jRightHip"] - pelvis;
  placed["jLeftHip"] = given["jLeftHip"] - pelvis;
  std::map<std::string, std::string> joint_of;  // of each segment
  for (const human::Joint& joint : human::kJoints) {
    joint_of[std::string(joint.child)] = joint.name;
  }
  const auto place = [&](const std::string& name, const std::string& segment) {
    if (placed.contains(name)) return;
    const auto before = joint_of.find(segment);
    const Vector3 shift = before == joint_of.end()
                              ? Vector3(Vector3::Zero())
                              : Vector3(placed.at(before->second) - at.at(before->second));
    placed[name] =
        given.contains(name) ? Vector3(given[name] - pelvis) : Vector3(at.at(name) + shift);
  };
  for (const human::Joint& joint : human::kJoints) {
    place(std::string(joint.name), std::string(joint.parent));
  }
  place("HeadTop", "Head");
  for (const std::string side : {"Right", "Left"}) {
    place(side + "HandTip", side + "Hand");
    place(side + "Heel", side + "Foot");
    place(side + "ToeTip", side + "Toe");
  }
  return placed;
}

struct Segment {
  LinkShape shape;
  Matrix3 inertia_over_mass = Matrix3::Zero();
};

Segment box(const Vector3& centre, const Vector3& edges) {
  const Vector3 squares = edges.cwiseAbs2();
  Segment made;
  made.shape = {LinkShapeKind::kBox, edges, centre, Vector3::UnitZ()};
  made.inertia_over_mass = Vector3((squares.sum() - squares.array()) / 12.0).asDiagonal();
  return made;
}

Segment cylinder(const Vector3& from, const Vector3& to, double mass, double density) {
  const Vector3 way = to - from;
  const double length = way.norm();
  const double r2 = mass / (density * kPi * length);
  const Vector3 axis = way / length;
  Segment made;
  made.shape = {LinkShapeKind::kCylinder, Vector3(std::sqrt(r2), length, 0.0), 0.5 * (from + to),
                axis};
  const double across = r2 / 4.0 + length * length / 12.0;
  made.inertia_over_mass =
      across * Matrix3::Identity() + (r2 / 2.0 - across) * axis * axis.transpose();
  return made;
}

// Box of a trunk segment between two heights; its depth follows from its mass.
Segment trunk(const Vector3& bottom, const Vector3& top, double width, double mass,
              double density) {
  const double height = (top - bottom).norm();
  return box(0.5 * (bottom + top), {mass / (density * width * height), width, height});
}

// What is between the given ends, by the kind of segment; ends are in the link's frame.
Segment segment_of(const std::string& link, const std::map<std::string, Vector3>& at,
                   const Lengths& l, double mass, double density) {
  const bool right = link.starts_with("Right");
  const std::string side = right ? "Right" : link.starts_with("Left") ? "Left" : "";
  const std::string kind = link.substr(side.size());
  const auto from = [&](const std::string& joint, const std::string& end) -> Vector3 {
    return at.at(end) - at.at(joint);
  };
  const double hips = from("jRightHip", "jLeftHip").norm();
  if (kind == "Pelvis") return trunk(Vector3::Zero(), at.at("jL5S1"), hips, mass, density);
  if (kind == "L5") return trunk(Vector3::Zero(), from("jL5S1", "jL4L3"), hips, mass, density);
  if (kind == "L3") return trunk(Vector3::Zero(), from("jL4L3", "jL1T12"), hips, mass, density);
  if (kind == "T12") return trunk(Vector3::Zero(), from("jL1T12", "jT9T8"), hips, mass, density);
  if (kind == "T8") return trunk(Vector3::Zero(), from("jT9T8", "jT1C7"), hips, mass, density);
  const Vector3 zero = Vector3::Zero();
  if (kind == "Neck") return cylinder(zero, from("jT1C7", "jC1Head"), mass, density);
  if (kind == "Head") {
    const Vector3 up = from("jC1Head", "HeadTop");
    const double radius = 0.5 * up.norm();
    Segment made;
    made.shape = {LinkShapeKind::kSphere, Vector3(radius, 0, 0), 0.5 * up, Vector3::UnitZ()};
    made.inertia_over_mass = 0.4 * radius * radius * Matrix3::Identity();
    return made;
  }
  const std::string j = "j" + side;
  if (kind == "Shoulder") {
    return cylinder(zero, from(j + "C7Shoulder", j + "Shoulder"), mass, density);
  }
  if (kind == "UpperArm") return cylinder(zero, from(j + "Shoulder", j + "Elbow"), mass, density);
  if (kind == "ForeArm") return cylinder(zero, from(j + "Elbow", j + "Wrist"), mass, density);
  if (kind == "UpperLeg") return cylinder(zero, from(j + "Hip", j + "Knee"), mass, density);
  if (kind == "LowerLeg") return cylinder(zero, from(j + "Knee", j + "Ankle"), mass, density);
  if (kind == "Hand") {
    // As broad as half its length; in the neutral pose the palm looks down.
    const Vector3 way = from(j + "Wrist", side + "HandTip");
    const double length = way.norm();
    const double breadth = 0.5 * length;
    return box(0.5 * way, {breadth, length, mass / (density * length * breadth)});
  }
  const double width = l["foot_width"];
  if (kind == "Foot") {
    // From the heel to the ball, from the sole to the ankle.
    const Vector3 heel = from(j + "Ankle", side + "Heel");
    const Vector3 ball = from(j + "Ankle", j + "BallFoot");
    const double height = std::max(-std::min(heel.z(), ball.z()), kShortest);
    const double length = std::max((ball - heel).head<2>().norm(), kShortest);
    return box({0.5 * (heel.x() + ball.x()), 0.5 * (heel.y() + ball.y()), -0.5 * height},
               {length, width, height});
  }
  const Vector3 tip = from(j + "BallFoot", side + "ToeTip");  // Toe
  const double length = tip.norm();
  const double thickness = std::max(mass / (density * length * width), 0.002);
  return box(0.5 * tip + Vector3(0, 0, 0.5 * thickness), {length, width, thickness});
}

double mass_fraction(const std::string& link, MassTable table) {
  const std::size_t side = link.starts_with("Right") ? 5 : link.starts_with("Left") ? 4 : 0;
  for (const human::Mass& row : human::kMasses) {
    if (row.segment != link.substr(side)) continue;
    return table == MassTable::kPublished ? row.published : row.lengths;
  }
  throw Error(Fault::kInternal, "", "segment '" + link + "' has no mass");
}

void check_measures(const HumanMeasures& m) {
  require(m.height >= 0.5 && m.height <= 2.5, "height",
          sentence(6, "height is ", m.height, " m; heights between 0.5 and 2.5 m are taken"));
  require(m.mass >= 5.0 && m.mass <= 400.0, "mass",
          sentence(6, "mass is ", m.mass, " kg; masses between 5 and 400 kg are taken"));
  require(m.density >= 500.0 && m.density <= 2000.0, "density",
          sentence(6, "density is ", m.density, " kg/m^3; 500 to 2000 are taken"));
}

}  // namespace

std::vector<std::string> segment_names() {
  std::vector<std::string> names;
  for (const human::Length& l : kLengths) names.emplace_back(l.segment);
  return names;
}

double segment_fraction(const std::string& segment) {
  for (const human::Length& l : kLengths) {
    if (l.segment == segment) return l.fraction;
  }
  throw Error(Fault::kArgument, "segment",
              "there is no segment '" + segment + "'; there are: " + join(segment_names()));
}

std::vector<std::string> point_names() {
  std::vector<std::string> names;
  for (const human::Joint& joint : human::kJoints) names.emplace_back(joint.name);
  names.emplace_back("HeadTop");
  for (const std::string side : {"Right", "Left"}) {
    for (const char* end : {"HandTip", "Heel", "ToeTip"}) names.push_back(side + end);
  }
  return names;
}

std::vector<std::string> suit_links() {
  return {human::kSuitLinks.begin(), human::kSuitLinks.end()};
}

BodyTree human_body(const HumanMeasures& measures) {
  check_measures(measures);
  const Lengths lengths(measures);
  const std::map<std::string, Vector3> at = points_of(measures, lengths);

  const auto fill = [&](BodyLink& link) {
    link.mass = measures.mass * mass_fraction(link.name, measures.table);
    const Segment segment = segment_of(link.name, at, lengths, link.mass, measures.density);
    link.shape = segment.shape;
    link.centre = segment.shape.centre;
    link.inertia = link.mass * segment.inertia_over_mass;
  };
  std::vector<BodyLink> links(1);
  links[0].name = "Pelvis";
  fill(links[0]);
  std::map<std::string, Index> place = {{"Pelvis", 0}};
  std::map<std::string, Vector3> origin = {{"Pelvis", Vector3::Zero()}};
  for (const human::Joint& joint : human::kJoints) {
    const std::string name(joint.name);
    const std::string child(joint.child);
    const std::string parent(joint.parent);
    origin[child] = at.at(name);
    const Vector3 offset = at.at(name) - origin.at(parent);
    require(offset.norm() >= kShortest, "points",
            "joint '" + name + "' falls on the joint before it; segment '" + parent +
                "' has no length");
    std::vector<human::Hinge> hinges;
    for (const human::Hinge& hinge : joint.hinges) {
      if (hinge.in_48 || measures.joints == HumanJoints::k66) hinges.push_back(hinge);
    }
    Index before = place.at(parent);
    for (std::size_t k = 0; k < hinges.size(); ++k) {
      const bool last = k + 1 == hinges.size();
      BodyLink link;
      link.name = last ? child : child + "_f" + std::to_string(k + 1);
      link.parent = before;
      if (k == 0) link.position = offset;
      link.joint = name + "_rot" + hinges[k].axis;
      link.axis = Vector3::Unit(hinges[k].axis - 'x');
      link.lower = hinges[k].lower_deg * kDegree;
      link.upper = hinges[k].upper_deg * kDegree;
      link.massless = !last;
      if (last) fill(link);
      before = static_cast<Index>(links.size());
      links.push_back(std::move(link));
    }
    place[child] = before;
  }
  return with_attachments(BodyTree(std::move(links)), measures.attachments);
}

}  // namespace ulna
