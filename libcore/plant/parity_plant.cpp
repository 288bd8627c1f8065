#include "plant/parity_plant.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "plant/engine_mobilised.hpp"
#include "plant/parity_interface.hpp"

namespace ulna {
namespace {

const std::vector<std::string> kArmJoints = {"shoulder_flexion", "shoulder_abduction",
                                             "shoulder_rotation", "elbow_flexion"};

RigidTree device_of(const ParityOptions& options) {
  return RigidTree(bodies_of(parity_bodies(options).exo));
}

ExoPlant compiled(const ParityOptions& options) {
  std::string text = parity_mjcf(options);
  EngineModel model =
      EngineModel::from_text(text, {.contacts = kParityContacts, .rows = kParityRows});
  return ExoPlant::written(std::move(model), std::move(text), parity_bodies(options));
}

// Where the published nominal model has the shoulder and the elbow in its modelling pose, m.
const Vector3 kNominalShoulder(-0.015, 0.0025, 0.0);
const Vector3 kNominalElbow(0.235, 0.010, -0.015);

RigidTree::Pose in_link(const RigidTree& device, const std::string& link, const Vector3& place,
                        Index& parent) {
  const std::vector<RigidTree::Pose> poses = device.poses(device.reference());
  for (parent = 0; device.bodies()[static_cast<std::size_t>(parent)].name != link;) ++parent;
  const RigidTree::Pose& pose = poses[static_cast<std::size_t>(parent)];
  const Matrix3 back = pose.orientation.transpose();
  return {back * (place - pose.position), back};
}

// The nominal arm, whatever the arm of the plant, without tissue and straps.
RigidTree published_nominal(const RigidTree& device) {
  const ExoScene nominal = parity_bodies({});
  std::vector<RigidBody> bodies = device.bodies();
  ArmMount mount{.fixed = true};
  mount.upper = in_link(device, nominal.exo.upper_link, kNominalShoulder, mount.upper_parent);
  mount.fore = in_link(device, nominal.exo.fore_link, kNominalElbow, mount.fore_parent);
  append_arm(nominal.arm, mount, bodies);
  return RigidTree(std::move(bodies));
}

// A shell as one body at its bone's axes.
ArmSegment segment_of(const ParityShell& shell, const Vector3& centre) {
  ArmSegment tissue;
  tissue.centre = centre;
  tissue.mass = ParityShell::kMass;
  for (const ParityShell::Element& e : shell.elements) {
    const Vector3 at = (e.position - ParityShell::kRadius * e.outward).cwiseAbs2();
    tissue.mass += ParityShell::kMass;
    tissue.moments +=
        ParityShell::kMass * Vector3(at.y() + at.z(), at.x() + at.z(), at.x() + at.y());
  }
  return tissue;
}

// Everything that has mass in the plant, rigidly together, the elbow in the device's.
ExoScene whole_scene(const ParityOptions& options) {
  ExoScene scene = parity_bodies(options);
  scene.coupling = Coupling::kRigid;
  scene.exo.straps = ExoDescription::published().straps;
  scene.exo.use_published_straps();
  const ParityCentres centres = parity_centres(scene.arm);
  scene.arm.upper_tissue = segment_of(ParityShell::upper_arm(), centres.upper);
  scene.arm.fore_tissue = segment_of(ParityShell::forearm(), centres.fore);
  return scene;
}

std::shared_ptr<const NominalModel> nominal_model(const ParityOptions& options,
                                                  const RigidTree& device,
                                                  const EngineModel& model) {
  if (options.defects.nominal_omissions) {
    return std::make_shared<const NominalModel>(published_nominal(device), model);
  }
  return std::make_shared<const NominalModel>(whole_scene(options), model);
}

}  // namespace

ParityPlant::ParityPlant(const ParityOptions& options)
    : options_(options),
      plant_(compiled(options)),
      device_(device_of(options)),
      nominal_(nominal_model(options, device_, model())) {}

void ParityPlant::attach(EngineRun& run, const VectorRef& device_angle) const {
  const auto set = [&](const std::string& joint, double angle) {
    run.position()[model().position_of(joint)] = angle;
  };
  const std::vector<std::string> joints = device_.joint_names();
  for (Index j = 0; j < device_angle.size(); ++j) {
    set(joints[static_cast<std::size_t>(j)], device_angle[j]);
  }
  const std::string link = parity_bodies(options_).exo.upper_link;
  Index upper = 0;
  while (device_.bodies()[static_cast<std::size_t>(upper)].name != link) ++upper;
  const auto pose = [&](const VectorRef& angle) {
    return device_.poses(angle)[static_cast<std::size_t>(upper)].orientation;
  };
  // Turned about y by the flexion, then about z, then about x.
  const Matrix3 turn = pose(device_angle) * pose(device_.reference()).transpose();
  set("shoulder_flexion", -0.5 * kPi + std::atan2(-turn(2, 0), turn(0, 0)));
  set("shoulder_abduction", std::asin(std::clamp(turn(1, 0), -1.0, 1.0)));
  set("shoulder_rotation", std::atan2(-turn(1, 2), turn(1, 1)));
  set("elbow_flexion", device_angle[device_angle.size() - 1]);
}

std::shared_ptr<const MobilisedPlant> mobilised(std::shared_ptr<const ParityPlant> plant,
                                                const ExoScene* nominal) {
  const ExoScene described = parity_bodies(plant->options());
  EngineWiring wiring;
  for (const ExoLink& link : described.exo.links) {
    wiring.device_joints.push_back(link.joint);
    wiring.motors.push_back(link.joint + "_motor");
    wiring.counterparts.push_back(-1);
  }
  wiring.human_joints = kArmJoints;
  wiring.counterparts.back() = 3;
  for (const Muscle& muscle : described.arm.muscles) {
    wiring.muscles.push_back(muscle.name);
    wiring.groups.push_back(muscle.group);
  }
  wiring.attach = [plant](EngineRun& run, const VectorRef& angle) { plant->attach(run, angle); };
  const auto own = nominal == nullptr
                       ? plant->nominal()
                       : std::make_shared<const NominalModel>(*nominal, plant->model());
  return mobilised(plant->model(), std::move(wiring), own);
}

}  // namespace ulna
