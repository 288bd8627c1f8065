// The tables behind the human model: joints, mass fractions, lengths over height.
#pragma once

#include <array>
#include <string_view>

namespace ulna::human {

// Joints of the model, trunk first. A hinge has an axis letter; axes that the 48-hinge model leaves
// out are there for the 66-hinge one, without limits of their own (-180 to 180 degrees).
struct Hinge {
  char axis;
  double lower_deg, upper_deg;
  bool in_48 = true;
};

struct Joint {
  std::string_view name;  // "jL5S1"
  std::string_view parent;
  std::string_view child;
  std::array<Hinge, 3> hinges;  // about x, y, z
};

constexpr Hinge none(char axis) { return {axis, -180.0, 180.0, false}; }

// Limits: table of the published model.
inline constexpr std::array<Joint, 22> kJoints = {{
    {"jL5S1", "Pelvis", "L5", {{{'x', -35, 35}, {'y', -30, 75}, none('z')}}},
    {"jL4L3", "L5", "L3", {{{'x', -35, 35}, {'y', -30, 75}, none('z')}}},
    {"jL1T12", "L3", "T12", {{{'x', -35, 35}, {'y', -30, 75}, none('z')}}},
    {"jT9T8", "T12", "T8", {{{'x', -20, 20}, {'y', -15, 40}, {'z', -35, 35}}}},
    {"jT1C7", "T8", "Neck", {{{'x', -35, 35}, {'y', -55, 90}, {'z', -70, 70}}}},
    {"jC1Head", "Neck", "Head", {{{'x', -35, 35}, {'y', -25, 10}, none('z')}}},
    {"jRightC7Shoulder", "T8", "RightShoulder", {{{'x', -5, 45}, none('y'), none('z')}}},
    {"jRightShoulder",
     "RightShoulder",
     "RightUpperArm",
     {{{'x', -135, 90}, {'y', -90, 90}, {'z', -45, 180}}}},
    {"jRightElbow", "RightUpperArm", "RightForeArm", {{none('x'), {'y', -90, 85}, {'z', 0, 145}}}},
    {"jRightWrist", "RightForeArm", "RightHand", {{{'x', -50, 60}, none('y'), {'z', -30, 20}}}},
    {"jLeftC7Shoulder", "T8", "LeftShoulder", {{{'x', -5, 45}, none('y'), none('z')}}},
    {"jLeftShoulder",
     "LeftShoulder",
     "LeftUpperArm",
     {{{'x', -90, 135}, {'y', -90, 90}, {'z', -180, 45}}}},
    {"jLeftElbow", "LeftUpperArm", "LeftForeArm", {{none('x'), {'y', -90, 85}, {'z', -145, 0}}}},
    {"jLeftWrist", "LeftForeArm", "LeftHand", {{{'x', -60, 50}, none('y'), {'z', -20, 30}}}},
    {"jRightHip", "Pelvis", "RightUpperLeg", {{{'x', -30, 45}, {'y', -15, 120}, {'z', -45, 45}}}},
    {"jRightKnee", "RightUpperLeg", "RightLowerLeg", {{none('x'), {'y', 0, 135}, {'z', -40, 30}}}},
    {"jRightAnkle",
     "RightLowerLeg",
     "RightFoot",
     {{{'x', -35, 45}, {'y', -30, 50}, {'z', -25, 50}}}},
    {"jRightBallFoot", "RightFoot", "RightToe", {{none('x'), {'y', -10, 90}, none('z')}}},
    {"jLeftHip", "Pelvis", "LeftUpperLeg", {{{'x', -30, 45}, {'y', -15, 120}, {'z', -45, 45}}}},
    {"jLeftKnee", "LeftUpperLeg", "LeftLowerLeg", {{none('x'), {'y', 0, 135}, {'z', -30, 40}}}},
    {"jLeftAnkle", "LeftLowerLeg", "LeftFoot", {{{'x', -35, 45}, {'y', -30, 50}, {'z', -50, 25}}}},
    {"jLeftBallFoot", "LeftFoot", "LeftToe", {{none('x'), {'y', -10, 90}, none('z')}}},
}};

// Mass of a segment over the mass of the body; of each of two where there are two. Both columns sum
// to 1. In the first the toes have half a per cent of the foot.
struct Mass {
  std::string_view segment;  // without "Right", "Left"
  double lengths;            // MassTable::kSegmentLengths
  double published;          // MassTable::kPublished
};
inline constexpr double kToeOfFoot = 0.005;
inline constexpr std::array<Mass, 15> kMasses = {{
    {"Pelvis", 0.1183, 0.080},
    {"L5", 0.0291, 0.102},
    {"L3", 0.0444, 0.102},
    {"T12", 0.0519, 0.102},
    {"T8", 0.0818, 0.040},
    {"Neck", 0.0194, 0.012},
    {"Head", 0.0487, 0.036},
    {"Shoulder", 0.0523, 0.031},
    {"UpperArm", 0.0263, 0.030},
    {"ForeArm", 0.0150, 0.020},
    {"Hand", 0.0059, 0.006},
    {"UpperLeg", 0.1447, 0.125},
    {"LowerLeg", 0.0457, 0.0365},
    {"Foot", 0.0133 * (1.0 - kToeOfFoot), 0.0130},
    {"Toe", 0.0133 * kToeOfFoot, 0.0015},
}};

// Lengths over height. From pelvis to head and from sole to hip they add up to 1.
struct Length {
  std::string_view segment;
  double fraction;
};
inline constexpr std::array<Length, 17> kLengths = {{
    {"head", 0.130},
    {"neck", 0.052},
    {"shoulder", 0.129},  // from the middle to the shoulder joint (Drillis and Contini 1966)
    {"upper_arm", 0.186},
    {"forearm", 0.146},
    {"hand", 0.108},
    {"thigh", 0.245},
    {"shank", 0.246},
    {"foot_length", 0.152},
    {"foot_width", 0.055},
    {"foot_height", 0.039},
    {"T8", 0.0829},
    {"T12", 0.0526},
    {"L3", 0.0450},
    {"L5", 0.0295},
    {"pelvis_height", 0.078},
    {"pelvis_width", 0.191},
}};

// Parts of the foot's length, from the heel: the ankle, the ball. A choice of this model.
inline constexpr double kAnkleOfFoot = 0.25;
inline constexpr double kBallOfFoot = 0.72;

inline constexpr std::array<std::string_view, 17> kSuitLinks = {
    "Pelvis",        "T8",           "Head",         "RightShoulder",
    "RightUpperArm", "RightForeArm", "RightHand",    "LeftShoulder",
    "LeftUpperArm",  "LeftForeArm",  "LeftHand",     "RightUpperLeg",
    "RightLowerLeg", "RightFoot",    "LeftUpperLeg", "LeftLowerLeg",
    "LeftFoot"};

}  // namespace ulna::human
