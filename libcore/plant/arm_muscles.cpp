#include "plant/arm_muscles.hpp"

namespace ulna {

std::vector<Muscle> published_elbow_muscles() {
  return {
      {"triceps_long",
       MuscleGroup::kExtensor,
       982.2,
       {0.7, 0.9},
       {{Frame::kScapula, {0.03083, 0.02581, -0.04169}},
        {Frame::kUlna, {-0.01682, 0.00657, -0.02635}}},
       ""},
      {"triceps_medial",
       MuscleGroup::kExtensor,
       767.9,
       {0.7, 0.9},
       {{Frame::kHumerus, {0.17415, 0.001432, -0.00827}},
        {Frame::kUlna, {-0.01771, 0.02561, -0.02364}}},
       ""},
      {"triceps_lateral",
       MuscleGroup::kExtensor,
       767.9,
       {0.7, 0.9},
       {{Frame::kHumerus, {0.07102, -0.00863, -0.010792}},
        {Frame::kUlna, {-0.02348, 0.02012, -0.02043}}},
       ""},
      {"anconeus",
       MuscleGroup::kExtensor,
       430.5,
       {0.7, 0.9},
       {{Frame::kHumerus, {0.30395, -0.01346, -0.01568}},
        {Frame::kUlna, {0.03161, -0.00914, -0.00822}}},
       ""},
      {"biceps_short",
       MuscleGroup::kFlexor,
       443.3,
       {0.95, 1.2},
       {{Frame::kScapula, {0.08244, 0.00915, -0.00833}},
        {Frame::kRadius, {0.03809, 0.00282, 0.00202}}},
       ""},
      {"biceps_long",
       MuscleGroup::kFlexor,
       309.3,
       {0.95, 1.2},
       {{Frame::kScapula, {0.04288, 0.01401, -0.00249}},
        {Frame::kHumerus, {-0.0001, -0.0217, 0.0011}},
        {Frame::kRadius, {0.03809, 0.00282, 0.00202}}},
       ""},
      {"brachialis",
       MuscleGroup::kFlexor,
       701.0,
       {0.95, 1.2},
       {{Frame::kHumerus, {0.16994, 0.00421, -0.00129}},
        {Frame::kUlna, {0.03331, 0.01924, 0.00854}}},
       ""},
      {"brachioradialis",
       MuscleGroup::kFlexor,
       185.5,
       {0.95, 1.2},
       {{Frame::kHumerus, {0.21716, -0.00443, 0.002}},
        {Frame::kRadius, {0.26513, 0.00412, 0.01037}}},
       ""},
  };
}

std::vector<WrapCylinder> elbow_cylinders() {
  // Behind the joint the triceps' tendon over the olecranon; before it the flexors' lines of action
  // at full extension, where the published straight lines pass within 8 to 18 mm of the axis and no
  // physiological force reaches the measured torque.
  return {{"elbow_back", 0.020, -Vector3::UnitZ()}, {"elbow_front", 0.023, Vector3::UnitZ()}};
}

namespace {

struct Fitted {
  const char* name;
  double force;
  double range[2];
};

// What fit_muscles() finds from the published forces, flexor ranges of 0.9 ... 1.05 and the
// arm's default scales, to four digits; the tests repeat it.
constexpr Fitted kFitted[] = {
    {"triceps_long", 1141.32, {0.6500, 0.8315}},   {"triceps_medial", 892.30, {0.6594, 0.8021}},
    {"triceps_lateral", 892.30, {0.6500, 0.9824}}, {"anconeus", 500.24, {0.6500, 0.9549}},
    {"biceps_short", 446.14, {0.9751, 1.0751}},    {"biceps_long", 311.28, {0.9742, 1.0742}},
    {"brachialis", 705.48, {0.9737, 1.0737}},      {"brachioradialis", 186.69, {0.9730, 1.0730}}};

}  // namespace

std::vector<Muscle> unfitted_elbow_muscles() {
  std::vector<Muscle> muscles = published_elbow_muscles();
  for (Muscle& muscle : muscles) {
    if (muscle.group == MuscleGroup::kFlexor) {
      muscle.range[0] = 0.9;
      muscle.range[1] = 1.05;
    }
    // The anconeus is too short and too close to the joint to reach around it.
    if (muscle.name == "anconeus") continue;
    muscle.wrap = muscle.group == MuscleGroup::kExtensor ? "elbow_back" : "elbow_front";
  }
  return muscles;
}

std::vector<Muscle> fitted_elbow_muscles() {
  std::vector<Muscle> muscles = unfitted_elbow_muscles();
  for (std::size_t k = 0; k < muscles.size(); ++k) {
    muscles[k].force = kFitted[k].force;
    muscles[k].range[0] = kFitted[k].range[0];
    muscles[k].range[1] = kFitted[k].range[1];
  }
  return muscles;
}

std::vector<Muscle> published_shoulder_muscles() {
  return {
      {"pectoralis_sternal",
       MuscleGroup::kShoulder,
       515.4,
       {0.75, 1.05},
       {{Frame::kThorax, {0.16922, -0.02628, -0.07385}},
        {Frame::kHumerus, {0.06748, -0.01078, 0.01714}}},
       ""},
      {"pectoralis_ribs",
       MuscleGroup::kShoulder,
       390.5,
       {0.75, 1.05},
       {{Frame::kThorax, {0.14595, -0.00795, 0.02405}},
        {Frame::kHumerus, {0.05923, -0.01111, 0.0178}}},
       ""},
      {"pectoralis_clavicular",
       MuscleGroup::kShoulder,
       364.4,
       {0.75, 1.05},
       {{Frame::kClavicle, {0.01566, -0.07287, 0.01192}},
        {Frame::kHumerus, {0.07144, -0.01148, 0.01682}}},
       ""},
      {"supraspinatus",
       MuscleGroup::kShoulder,
       487.8,
       {0.75, 1.05},
       {{Frame::kScapula, {0.02272, 0.07205, 0.01412}},
        {Frame::kHumerus, {-0.0159, -0.01774, 0.00552}}},
       ""},
      {"coracobrachialis",
       MuscleGroup::kShoulder,
       242.5,
       {0.75, 1.05},
       {{Frame::kScapula, {0.07924, 0.01029, -0.01058}},
        {Frame::kHumerus, {0.1617, 0.00522, 0.00501}}},
       ""},
      {"deltoid_clavicular",
       MuscleGroup::kShoulder,
       259.9,
       {0.75, 1.05},
       {{Frame::kClavicle, {0.01804, -0.13657, 0.01128}},
        {Frame::kHumerus, {0.10735, -0.01638, 0.01038}}},
       ""},
      {"deltoid_anterior",
       MuscleGroup::kShoulder,
       1142.6,
       {0.75, 1.05},
       {{Frame::kScapula, {0.00374, 0.06638, 0.00272}},
        {Frame::kHumerus, {0.10386, -0.01451, -0.00724}}},
       ""},
      {"deltoid_middle",
       MuscleGroup::kShoulder,
       1142.6,
       {0.75, 1.05},
       {{Frame::kScapula, {0.01758, -0.00783, 0.00354}},
        {Frame::kHumerus, {0.10267, -0.01684, -0.00097}}},
       ""},
      {"infraspinatus",
       MuscleGroup::kShoulder,
       1210.8,
       {0.75, 1.05},
       {{Frame::kScapula, {0.0048, 0.09815, -0.0456}},
        {Frame::kHumerus, {-0.01547, -0.01798, -0.00814}}},
       ""},
      {"teres_minor",
       MuscleGroup::kShoulder,
       354.3,
       {0.75, 1.05},
       {{Frame::kScapula, {0.01249, 0.05321, -0.05922}},
        {Frame::kHumerus, {0.0051, -0.02655, -0.00853}}},
       ""},
      {"teres_major",
       MuscleGroup::kShoulder,
       425.4,
       {0.75, 1.05},
       {{Frame::kScapula, {0.00864, 0.09026, -0.10074}},
        {Frame::kHumerus, {0.0695, 0.0048, 0.00963}}},
       ""},
      {"subscapularis",
       MuscleGroup::kShoulder,
       1377.8,
       {0.75, 1.05},
       {{Frame::kScapula, {0.01647, 0.07893, -0.04978}},
        {Frame::kHumerus, {-0.0015, 0.00617, 0.02045}}},
       ""},
      {"latissimus_thoracic",
       MuscleGroup::kShoulder,
       389.1,
       {0.75, 1.05},
       {{Frame::kThorax, {-0.017, -0.01, -0.10505}},
        {Frame::kHumerus, {0.04118, -0.00176, 0.01744}}},
       ""},
      {"latissimus_lumbar",
       MuscleGroup::kShoulder,
       389.1,
       {0.75, 1.05},
       {{Frame::kThorax, {-0.0002, -0.01495, -0.2249}},
        {Frame::kHumerus, {0.04118, -0.00176, 0.01744}}},
       ""},
      {"latissimus_iliac",
       MuscleGroup::kShoulder,
       281.7,
       {0.75, 1.05},
       {{Frame::kThorax, {0.04125, -0.0903, -0.2468}},
        {Frame::kHumerus, {0.04118, -0.00176, 0.01744}}},
       ""},
  };
}

}  // namespace ulna
