// A plant of the physics engine as the protocol of an assessment sees it.
#pragma once

#include <functional>
#include <memory>

#include "plant/exo_plant.hpp"
#include "plant/mobilised.hpp"

namespace ulna {

// Which parts of a compiled model are what. Vectors of one length belong together.
struct EngineWiring {
  std::vector<std::string> device_joints;
  std::vector<std::string> motors;  // actuator of each device joint; "": none
  std::vector<Index> counterparts;  // human joint of each device joint; -1: none
  std::vector<std::string> human_joints;
  std::vector<std::string> muscles;  // actuators
  std::vector<MuscleGroup> groups;
  // Puts a run, of the plant or of one with other joint damping, into the donned pose for angles of
  // the device joints, at rest, and couples it; empty: the reference with the device joints at
  // their angles.
  std::function<void(EngineRun& run, const VectorRef& device_angle)> attach;
  std::vector<PlantChannel> extras;
  std::function<Vector(const EngineRun& run)> read_extras;  // after a step, one value an extra
};

// Throws Error (kArgument) that names the joint, motor or muscle that is not there.
std::shared_ptr<const MobilisedPlant> mobilised(const EngineModel& model, EngineWiring wiring,
                                                std::shared_ptr<const NominalModel> nominal);

// A plant whose device holds the arm rigidly: device joints are human joints. nominal: the scene of
// the nominal model; NULL: the plant's own. With one, a plant that was read from a file is taken
// too: its joints, motors ("J4_motor") and muscles are named as in that scene. Throws Error:
// kUnsupported for a plant without a description where there is no nominal model, kArgument for one
// whose device does not hold an arm or whose parts are not there.
std::shared_ptr<const MobilisedPlant> mobilised(const ExoPlant& plant,
                                                const ExoScene* nominal = nullptr);

}  // namespace ulna
