// The human model: 23 segments that carry mass on 48 hinges (49 links) or, with all 22 joints
// spherical, on 66 hinges (67 links). Neutral pose: T-pose, all link frames along x forward,
// y left, z up, origin at the joint that carries the link (Pelvis: midway between the hips).
//
// Joints, axes, limits and names after the public Xsens-like model of Latella et al. 2021 (section
// II-F, figure 3). A joint of several hinges turns in the order x, y, z with massless links
// "<link>_f1", "<link>_f2" between them. Segments are boxes, cylinders and a sphere of uniform
// density, from mass fractions and lengths over height.
#pragma once

#include <string>
#include <vector>

#include "plant/body/body_tree.hpp"

namespace ulna {

enum class MassTable {
  kSegmentLengths,  // the default: fractions that go with the lengths over height below
  kPublished,       // fractions of the published model, meant for segments from suit points
};

enum class HumanJoints {
  k48,  // elbow, knee, wrist, trunk without the axes that hardly move
  k66,  // all 22 joints spherical
};

// A length of one kind of segment, m.
struct SegmentLength {
  std::string segment;  // see segment_names()
  double length = 0.0;
};

// Where a joint's centre or the end of a segment is in the neutral pose, m, any one frame with
// x forward, y left, z up.
struct BodyPoint {
  std::string name;  // see point_names()
  Vector3 position = Vector3::Zero();
};

struct HumanMeasures {
  double height = 0.0;  // m
  double mass = 0.0;    // kg, without attachments
  MassTable table = MassTable::kSegmentLengths;
  HumanJoints joints = HumanJoints::k48;
  std::vector<SegmentLength> lengths = {};  // measured; the others follow from height
  std::vector<BodyPoint> points = {};       // measured; they come before lengths
  std::vector<Attachment> attachments = {};
  double density = 1050.0;  // kg/m^3, fixes the girth of segments
};

// Throws Error (kArgument) with what is wrong and the range that is taken: height 0.5 to 2.5 m,
// mass 5 to 400 kg, lengths 5 mm to 1.2 m, unknown or double names, points of which two joints
// fall together.
BodyTree human_body(const HumanMeasures& measures);

// "head", "neck", "shoulder", "upper_arm", ...: names of lengths. pelvis_width is between the hip
// joints, foot_height from sole to ankle.
std::vector<std::string> segment_names();
// Length of a segment of a person of unit height.
double segment_fraction(const std::string& segment);

// The 22 joints ("jL5S1", "jRightHip", ...) and the ends of segments ("HeadTop", "RightHandTip",
// "RightHeel", "RightToeTip", "LeftHandTip", ...).
std::vector<std::string> point_names();

// The 17 links that wear a sensor in the usual suit.
std::vector<std::string> suit_links();

}  // namespace ulna
