#include "plant/soft/soft_mobilised.hpp"

#include <algorithm>
#include <utility>

#include "plant/engine_mobilised.hpp"

namespace ulna {
namespace {

constexpr const char* kAxes[] = {"_x", "_y", "_z"};
constexpr Index kCommonChannels = 16;  // two wrenches, displacement, turn
constexpr Index kFullChannels = 4;     // pressure, area, tension, sliding

std::vector<PlantChannel> interface_channels(const SoftPlant& plant) {
  std::vector<PlantChannel> channels;
  for (const auto& interface : plant.interfaces()) {
    const std::string& name = interface->options().name;
    for (const char* part : {"_cuff", "_strap"}) {
      for (const char* axis : kAxes) channels.push_back({"F_" + name + part + axis, "N"});
      for (const char* axis : kAxes) channels.push_back({"M_" + name + part + axis, "Nm"});
    }
    for (const char* axis : kAxes) channels.push_back({"displacement_" + name + axis, "m"});
    channels.push_back({"turn_" + name, "rad"});
    if (plant.is_reduced()) continue;
    channels.push_back({"pressure_" + name, "Pa"});
    channels.push_back({"area_" + name, "m^2"});
    channels.push_back({"tension_" + name, "N"});
    channels.push_back({"slide_" + name, "m"});
  }
  return channels;
}

Vector interface_values(const EngineRun& run, bool reduced) {
  const std::vector<InterfaceReport> reports = interface_reports(run);
  const Index width = kCommonChannels + (reduced ? 0 : kFullChannels);
  Vector values(static_cast<Index>(reports.size()) * width);
  Index at = 0;
  for (const InterfaceReport& r : reports) {
    values.segment(at, kCommonChannels) << r.cuff.wrench, r.strap.wrench, r.displacement, r.turn;
    if (!reduced) {
      values.segment(at + kCommonChannels, kFullChannels)
          << std::max(r.cuff.peak_pressure, r.strap.peak_pressure),
          r.cuff.area + r.strap.area, r.tension, r.sliding.norm();
    }
    at += width;
  }
  return values;
}

}  // namespace

std::shared_ptr<const MobilisedPlant> mobilised(std::shared_ptr<const SoftPlant> plant,
                                                const ExoScene* nominal) {
  // What the device knows: its own links as they are adjusted, the arm perfectly aligned in them.
  const ExoScene& described = plant->description().scene;
  EngineWiring wiring;
  for (const ExoLink& link : described.exo.links) {
    wiring.device_joints.push_back(link.joint);
    wiring.motors.push_back(link.motor_limit > 0.0 ? link.joint + "_motor" : "");
    wiring.counterparts.push_back(-1);
  }
  wiring.human_joints = {"shoulder_flexion", "shoulder_abduction", "shoulder_rotation",
                         "elbow_flexion"};
  wiring.counterparts.back() = 3;
  for (const Muscle& muscle : described.arm.muscles) {
    wiring.muscles.push_back(muscle.name);
    wiring.groups.push_back(muscle.group);
  }
  wiring.attach = [plant](EngineRun& run, const VectorRef& angle) { plant->attach(run, angle); };
  wiring.extras = interface_channels(*plant);
  wiring.read_extras = [reduced = plant->is_reduced()](const EngineRun& run) {
    return interface_values(run, reduced);
  };
  auto own = std::make_shared<const NominalModel>(nominal == nullptr ? described : *nominal,
                                                  plant->model());
  return mobilised(plant->model(), std::move(wiring), std::move(own));
}

}  // namespace ulna
