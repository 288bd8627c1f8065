// The human arm as numbers: segments, joints and muscle paths. Frames: humerus at the shoulder,
// ulna at the elbow, radius and hand along the forearm; in the modelling pose (upper arm forward
// and horizontal, elbow straight) all have the world's axes: x along the arm, y left, z up.
#pragma once

#include <string>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna {

struct ArmSegment {
  double mass = 0.0;                  // kg; 0: the segment is left out where it may be
  Vector3 centre = Vector3::Zero();   // of mass, segment axes, m
  Vector3 moments = Vector3::Zero();  // about it, segment axes, kg m^2
};

// Where a muscle's points are fixed. Thorax, clavicle and scapula stand still in the world.
enum class Frame { kThorax, kClavicle, kScapula, kHumerus, kUlna, kRadius };
enum class MuscleGroup { kFlexor, kExtensor, kShoulder };

struct MusclePoint {
  Frame frame;
  Vector3 at;  // in the frame of an arm of scale 1, m
};

// A cylinder across the elbow that paths go around, on the named side.
struct WrapCylinder {
  std::string name;
  double radius = 0.0;              // m
  Vector3 side = Vector3::UnitZ();  // direction from the elbow's axis, modelling pose
};

struct Muscle {
  std::string name;
  MuscleGroup group;
  double force = 0.0;              // peak isometric, N
  double range[2] = {0.75, 1.05};  // normalised lengths at the two ends of the length range
  std::vector<MusclePoint> points;
  std::string wrap;  // name of a cylinder between the last two points, or ""
};

struct JointRange {
  double lower;  // rad
  double upper;
};

struct ArmDescription {
  double upper_scale = 1.0;  // of the humerus and its points; 1: elbow 0.2908 m from the shoulder
  double fore_scale = 1.0;   // of ulna and radius and their points; 1: hand 0.279 m from the elbow
  Vector3 elbow = Vector3(0.2907, -0.0058, -0.0049);  // of scale 1, m
  ArmSegment humerus, ulna, radius, hand;
  ArmSegment upper_tissue, fore_tissue;                        // in the frames of humerus and ulna
  double damping = 0.6;                                        // of every joint, N m s/rad
  JointRange flexion{-95.0 * kPi / 180.0, 5.0 * kPi / 180.0};  // shoulder; -90 degrees: horizontal
  JointRange abduction{-95.0 * kPi / 180.0, 5.0 * kPi / 180.0};
  JointRange rotation{-80.0 * kPi / 180.0, 85.0 * kPi / 180.0};
  JointRange elbow_flexion{0.0, 125.0 * kPi / 180.0};
  bool pronation = false;  // the radius turns in the ulna, -85 ... 85 degrees
  bool wrist = false;      // the hand on two hinges, flexion 70 and abduction 20 degrees either way
  std::vector<WrapCylinder> wraps;
  std::vector<Muscle> muscles;

  // Cylinders with the published masses, at scales that put the elbow on the published device's
  // (Tesfazgi 2023): 0.86267 and 1, times the factors given; masses kg, of bone and muscle without
  // the soft tissue of 0.489 and 0.351 kg.
  static ArmDescription cylinders(double upper_factor = 1.0, double fore_factor = 1.0,
                                  double upper_mass = 1.761, double fore_mass = 0.962);
  // Segment lengths, masses, centres and gyration radii from height (m) and mass (kg); tissue is
  // part of them.
  static ArmDescription person(double height, double mass);

  // Throws Error (kArgument) that names the segment or muscle.
  void check() const;

  Vector3 scaled(const MusclePoint& point) const;  // in its frame, m
};

// Bodies of an arm whose shoulder is at `shoulder` of body `upper_parent` (-1: the world). Where
// the arm moves on its own its joints are there; on a device that carries it, `fixed`, the humerus
// stands in the upper parent and the ulna in `fore_parent`, with the poses given.
struct ArmMount {
  bool fixed = false;
  Index upper_parent = -1;
  RigidTree::Pose upper{Vector3::Zero(), Matrix3::Identity()};
  Index fore_parent = -1;
  RigidTree::Pose fore{Vector3::Zero(), Matrix3::Identity()};
};
void append_arm(const ArmDescription& arm, const ArmMount& mount, std::vector<RigidBody>& bodies);

const char* body_word(Frame frame);  // the body's name; "" for those that stand still
Vector3 still_frame(Frame frame);    // origin in the world of those that do

}  // namespace ulna
