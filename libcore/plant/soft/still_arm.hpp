// The arm in a device that stands still: forces are in balance, muscles hold
// what they have. Full interfaces are taken to their equilibrium in long
// implicit steps, some hundred times faster than by a simulation. It follows
// how the load came about, as friction makes it matter.
#pragma once

#include <vector>

#include "plant/soft/interface_place.hpp"
#include "plant/soft/soft_plant.hpp"

namespace ulna {

class StillArm {
 public:
  // Donned with the device at its angles (one a joint), muscles without
  // activation. Throws Error: kUnsupported for a reduced plant, and what
  // SoftPlant::donned and InterfaceRun::don throw.
  StillArm(const SoftPlant& full, const VectorRef& device_angle);

  void activate(double elbow_muscles);  // 0 to 1
  void bend(double angle);              // of the device's last joint; the elbow goes with it
  void balance(int steps);              // towards the equilibrium

  EngineRun& run() { return run_; }
  std::size_t size() const { return interfaces_.size(); }
  const InterfaceRun& interface(std::size_t i) const { return interfaces_[i]; }
  LimbPose pose(std::size_t i) const { return places_[i].pose(run_); }

  // How cuff and strap resist a move of the limb from here, their muscles' and
  // joints' answers apart: N/m, N, N m.
  struct Resistance {
    Matrix6 cuff, strap;
  };
  Resistance stiffness(std::size_t i) const;
  // The same against its speed, N s/m, N s, N m s.
  Resistance damping(std::size_t i) const;

 private:
  void step(const Vector& turned);
  Resistance resistance(std::size_t i, std::shared_ptr<const TissueStep> step) const;

  const SoftPlant& plant_;
  EngineRun run_;
  std::vector<Index> arm_;  // degrees of freedom
  std::vector<InterfacePlace> places_;
  std::vector<InterfaceRun> interfaces_;
};

}  // namespace ulna
