#include "plant/exo_plant.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

constexpr int kElbowSteps = 125;   // one a degree
constexpr int kShoulderSteps = 6;  // of each of three joints

// Shortest and longest path of each actuator over configurations.
class Extremes {
 public:
  explicit Extremes(Index actuators) : range_(Matrix::Constant(actuators, 2, -1.0)) {}

  void see(EngineRun& run) {
    run.forward();
    const Vector length = run.actuator_length();
    for (Index i = 0; i < length.size(); ++i) {
      const bool first = range_(i, 0) < 0.0;
      range_(i, 0) = first ? length[i] : std::min(range_(i, 0), length[i]);
      range_(i, 1) = first ? length[i] : std::max(range_(i, 1), length[i]);
    }
  }

  double shortest(Index i) const { return range_(i, 0); }
  double longest(Index i) const { return range_(i, 1); }

 private:
  Matrix range_;
};

double between(const JointRange& range, int step, int steps) {
  return range.lower + (range.upper - range.lower) * step / steps;
}

// Held on the device, the last link's joint bends the elbow.
void see_elbow(const EngineModel& model, const ExoScene& scene, Extremes& extremes) {
  EngineRun run(model);
  const bool rigid = scene.coupling == Coupling::kRigid;
  const std::string joint = rigid ? scene.exo.links.back().joint : "elbow_flexion";
  const Index elbow = model.position_of(joint);
  const JointRange range = scene.arm.elbow_flexion;
  for (int i = 0; i <= kElbowSteps; ++i) {
    run.position() = model.reference();
    run.position()[elbow] = between(range, i, kElbowSteps);
    extremes.see(run);
  }
}

void see_shoulder(const ExoScene& scene, Extremes& extremes) {
  ExoScene alone = scene;
  alone.coupling = Coupling::kArmOnly;
  const EngineModel model = EngineModel::from_text(mjcf_of(alone));
  EngineRun run(model);
  const Index flexion = model.position_of("shoulder_flexion");
  const Index abduction = model.position_of("shoulder_abduction");
  const Index rotation = model.position_of("shoulder_rotation");
  constexpr int kCount = kShoulderSteps + 1;
  for (int i = 0; i < kCount * kCount * kCount; ++i) {
    run.position() = model.reference();
    run.position()[flexion] = between(scene.arm.flexion, i % kCount, kShoulderSteps);
    run.position()[abduction] = between(scene.arm.abduction, i / kCount % kCount, kShoulderSteps);
    run.position()[rotation] = between(scene.arm.rotation, i / kCount / kCount, kShoulderSteps);
    extremes.see(run);
  }
}

std::vector<Change> length_ranges(const EngineModel& model, const ExoScene& scene) {
  std::vector<Change> changes;
  if (!scene.has_arm() || scene.arm.muscles.empty()) return changes;
  const auto in_group = [&](bool shoulder) {
    return std::any_of(scene.arm.muscles.begin(), scene.arm.muscles.end(), [=](const Muscle& m) {
      return (m.group == MuscleGroup::kShoulder) == shoulder;
    });
  };
  Extremes elbow(model.controls());
  const auto muscles = static_cast<Index>(scene.arm.muscles.size());
  Extremes shoulder(muscles);  // the arm alone has no motors
  if (in_group(false)) see_elbow(model, scene, elbow);
  if (in_group(true)) see_shoulder(scene, shoulder);
  for (Index k = 0; k < muscles; ++k) {
    const Muscle& muscle = scene.arm.muscles[static_cast<std::size_t>(k)];
    const bool of_shoulder = muscle.group == MuscleGroup::kShoulder;
    const Index i = of_shoulder ? k : model.at(Part::kActuator, muscle.name);
    const Extremes& seen = of_shoulder ? shoulder : elbow;
    require(seen.longest(i) - seen.shortest(i) > 1e-6, "muscle",
            "muscle '" + muscle.name + "' does not change its length when its joints move");
    changes.push_back(
        {ModelQuantity::kLengthRange, muscle.name, {seen.shortest(i), seen.longest(i)}});
  }
  return changes;
}

EngineModel compile(const std::string& text, const ExoScene& scene) {
  const EngineModel model = EngineModel::from_text(text, {.contacts = 0});
  return model.changed(length_ranges(model, scene));
}

// The text with the length ranges that were found: read again, it gives the same muscles.
std::string with_ranges(std::string text, const EngineModel& model, const ExoScene& scene) {
  const std::string unknown = "lengthrange=\"0.1 0.2\"";
  std::size_t at = 0;
  for (std::size_t k = 0; scene.has_arm() && k < scene.arm.muscles.size(); ++k) {
    at = text.find(unknown, at);
    if (at == std::string::npos) break;
    const std::vector<double> range =
        model.values(ModelQuantity::kLengthRange, scene.arm.muscles[k].name);
    const std::string known = sentence(17, "lengthrange=\"", range[0], " ", range[1], "\"");
    text.replace(at, unknown.size(), known);
    at += known.size();
  }
  return text;
}

std::string degrees(double angle) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g", angle * 180.0 / kPi);
  return text;
}

}  // namespace

ExoPlant::ExoPlant(const ExoScene& scene) : ExoPlant(scene, mjcf_of(scene)) {}

ExoPlant::ExoPlant(const ExoScene& scene, const std::string& unranged)
    : model_(compile(unranged, scene)),
      text_(with_ranges(unranged, model_, scene)),
      scene_(std::make_shared<const ExoScene>(scene)),
      nominal_(std::make_shared<const RigidTree>(bodies_of(scene), scene.solver.gravity)) {}

ExoPlant ExoPlant::from_file(const std::string& path, const EngineRoom& room) {
  return {EngineModel::from_file(path, room), ""};
}

ExoPlant ExoPlant::written(EngineModel model, std::string text, const ExoScene& scene) {
  ExoPlant plant(std::move(model), std::move(text));
  plant.scene_ = std::make_shared<const ExoScene>(scene);
  return plant;
}

ExoPlant ExoPlant::changed(const std::vector<Change>& changes) const {
  ExoPlant other(model_.changed(changes), "");
  other.scene_ = scene_;
  return other;
}

const RigidTree& ExoPlant::nominal() const {
  if (nominal_ != nullptr) return *nominal_;
  throw Error(Fault::kUnsupported, "plant",
              "the plant has no nominal model: it was read from a scene file or changed after it "
              "was made from its description");
}

const ExoScene& ExoPlant::scene() const {
  nominal();
  return *scene_;
}

Vector ExoPlant::friction_torque(const VectorRef& rate) const {
  require(rate.size() == model_.velocities(), "rate", "rate must have one number for each joint");
  require_finite(rate, "rate");
  return model_.joint_damping().cwiseProduct(rate) +
         model_.joint_friction().cwiseProduct(rate.cwiseSign());
}

Vector ExoPlant::inverse_dynamics(const VectorRef& angle, const VectorRef& rate,
                                  const VectorRef& acceleration, bool friction) const {
  Vector torque = nominal().inverse_dynamics(angle, rate, acceleration);
  if (friction) torque += friction_torque(rate);
  return torque;
}

void ExoPlant::check_start(const VectorRef& angle) const {
  require(angle.size() == model_.positions(), "start",
          "the start has " + std::to_string(angle.size()) + " numbers, " +
              std::to_string(model_.positions()) + " are expected");
  const Matrix range = model_.joint_range();
  for (Index j = 0; j < model_.count(Part::kJoint); ++j) {
    const std::string joint = model_.name(Part::kJoint, j);
    const Index at = model_.position_of(joint);
    require(std::isfinite(angle[at]), "start", "the start of joint '" + joint + "' is not finite");
    if (angle[at] >= range(j, 0) && angle[at] <= range(j, 1)) continue;
    throw Error(Fault::kArgument, "start",
                "the start of joint '" + joint + "' is " + degrees(angle[at]) +
                    " degrees, outside its range of " + degrees(range(j, 0)) + " to " +
                    degrees(range(j, 1)),
                "joint " + joint);
  }
}

}  // namespace ulna
