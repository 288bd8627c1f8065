// The device with the arm in it by soft interfaces, in full (tissue, cuffs,
// straps) or reduced to bushings. The scene is the same as without them; a run
// of its engine is coupled to them.
#pragma once

#include <memory>
#include <vector>

#include "plant/exo_plant.hpp"
#include "plant/soft/bushing.hpp"
#include "plant/soft/soft_interface.hpp"

namespace ulna {

// How the arm stands in the device that it was put in.
struct Donning {
  Vector3 shoulder_offset = Vector3::Zero();  // of the arm's shoulder from the device's, world, m
  Vector3 elbow_offset = Vector3::Zero();     // of the elbow from where the arm's
                                              // lengths put it, humerus frame, m
  double rotation = 0.0;  // of the humerus about its axis against the device, rad
};

struct SoftScene {
  ExoScene scene;  // coupling is kApart always
  std::vector<SoftInterfaceOptions> interfaces;
  Donning donning;

  // With cuffs and straps at upper arm and forearm.
  static SoftScene of(const ExoScene& scene, const Donning& donning = {},
                      CuffDesign design = CuffDesign::kFitted);
};

class SoftPlant {
 public:
  // Throws Error (kArgument) that names what cannot be.
  explicit SoftPlant(const SoftScene& soft);

  // The same with each interface replaced by bushings, see reduced_plant.hpp.
  SoftPlant reduced(std::vector<Bushing> bushings) const;
  bool is_reduced() const { return !bushings_.empty(); }

  const SoftScene& description() const { return soft_; }
  const EngineModel& model() const { return plant_.model(); }
  const ExoPlant& plant() const { return plant_; }
  const std::vector<std::shared_ptr<const SoftInterface>>& interfaces() const {
    return interfaces_;
  }
  // Their tissue in steps of the engine, and in steps that are long against its
  // motion.
  const std::vector<std::shared_ptr<const TissueStep>>& steps() const { return steps_; }
  const std::vector<std::shared_ptr<const TissueStep>>& slow_steps() const { return slow_steps_; }
  const std::vector<Bushing>& bushings() const { return bushings_; }

  // Whole configuration with the device at angles (one a device joint) and the
  // arm donned: turned about its axis as the upper link and the donning
  // rotation say, and lying in its cuffs.
  Vector donned(const VectorRef& device_angle) const;

  // Puts a run of model() (or of one with other numbers) into the donned pose,
  // at rest, and couples it. The throws of Strap::don.
  void attach(EngineRun& run, const VectorRef& device_angle) const;

 private:
  void lay_in_cuffs(EngineRun& run) const;

  SoftScene soft_;
  ExoPlant plant_;
  std::vector<std::shared_ptr<const SoftInterface>> interfaces_;
  std::vector<std::shared_ptr<const TissueStep>> steps_;
  std::vector<std::shared_ptr<const TissueStep>> slow_steps_;
  std::vector<Bushing> bushings_;
};

// What one interface did in the last step.
struct InterfaceReport {
  std::string name;
  ContactReport cuff, strap;  // wrenches on the limb, cuff frame
  double tension = 0.0;       // of the strap, N; not a number for a reduced one
  Vector3 displacement;       // of the tissue's centre against where it was donned,
                              // cuff frame, m
  Vector3 sliding;            // of the skin along the cuff, mean over what is pressed, m
  double turn = 0.0;          // angle of the limb against the link since it was donned, rad
};

// Sets the device's length of the upper arm and the places of its cuffs to
// those of the arm, as a device with sliding links is adjusted to its wearer.
// Factors: of the published lengths.
void fit_device(SoftScene& soft, double upper_factor, double fore_factor);

// Reports of the run's coupling; empty where there is none.
std::vector<InterfaceReport> interface_reports(const EngineRun& run);

// Potential and kinetic energy inside the interfaces at the run's present
// position, J.
double interface_energy(EngineRun& run);

// Pose of limb `index` in its cuff; throws Error (kArgument) for a run without
// such an interface.
LimbPose interface_pose(EngineRun& run, std::size_t index);

// For a full plant, the state of interface `index`; throws Error (kArgument)
// otherwise.
const InterfaceRun& interface_run(const EngineRun& run, std::size_t index);

}  // namespace ulna
