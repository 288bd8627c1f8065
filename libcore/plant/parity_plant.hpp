// The published simulation as a plant that an assessment can mobilise.
#pragma once

#include <memory>

#include "plant/exo_plant.hpp"
#include "plant/mobilised.hpp"
#include "plant/parity_scene.hpp"

namespace ulna {

class ParityPlant {
 public:
  // Throws Error (kArgument) that names the option that cannot be.
  explicit ParityPlant(const ParityOptions& options);

  const ParityOptions& options() const { return options_; }
  const ExoPlant& plant() const { return plant_; }
  const EngineModel& model() const { return plant_.model(); }
  const std::shared_ptr<const NominalModel>& nominal() const { return nominal_; }

  // Puts a run of model() at angles of the device's joints, at rest, the arm parallel to it and the
  // straps flat, as they are written. In the reference it is the published beginning.
  void attach(EngineRun& run, const VectorRef& device_angle) const;

 private:
  ParityOptions options_;
  ExoPlant plant_;
  RigidTree device_;
  std::shared_ptr<const NominalModel> nominal_;
};

// Joints as of a soft plant: the device's, then shoulder_flexion, _abduction, _rotation and
// elbow_flexion of the arm. nominal: the scene of another nominal model than the plant's own.
std::shared_ptr<const MobilisedPlant> mobilised(std::shared_ptr<const ParityPlant> plant,
                                                const ExoScene* nominal = nullptr);

}  // namespace ulna
