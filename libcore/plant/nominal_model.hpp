// What an exoskeleton knows of itself and of the arm in it: rigid bodies of the description with
// the arm rigidly in the device, its damping and its friction. (6) and (20) of Tesfazgi 2023:
//
//     tau_hum = M(q) q'' + C(q, q') q' + g(q) + B q' + friction - tau_motor
#pragma once

#include <string>
#include <vector>

#include "plant/engine/friction_law.hpp"
#include "plant/exo_scene.hpp"

namespace ulna {

enum class NominalFriction {
  kNone,
  kCoulomb,  // the limit times the sign of the rate; none at rest
  kEngine,   // as the simulated device has it: creeps below a small speed, see FrictionLaw; a log
             // that holds the device's losses is taken at its word
};

// What of (20) is part of the nominal torque; gravity, Coriolis and centrifugal torques always.
struct NominalTerms {
  bool inertia = true;
  bool damping = true;
  NominalFriction friction = NominalFriction::kEngine;
};

class NominalModel {
 public:
  // The scene's arm rigidly in its device, without wrist and pronation; friction laws by name of
  // the joint from `device`, the compiled plant whose device it is. Throws Error (kArgument) for a
  // scene without a device or arm.
  NominalModel(const ExoScene& scene, const EngineModel& device);

  // Bodies of one's own; their joints are joints of the device.
  NominalModel(RigidTree tree, const EngineModel& device);

  const std::vector<std::string>& joints() const noexcept { return joints_; }
  const RigidTree& tree() const noexcept { return tree_; }
  const std::vector<FrictionLaw>& friction() const noexcept { return friction_; }
  const Vector& damping() const noexcept { return damping_; }

  // Torque that motors and muscles give together for a motion, N m, one a joint.
  Vector torque(const VectorRef& angle, const VectorRef& rate, const VectorRef& acceleration,
                const NominalTerms& terms = {}) const;
  // Of it, damping and friction.
  Vector loss(const VectorRef& rate, const VectorRef& acceleration,
              const NominalTerms& terms = {}) const;

 private:
  RigidTree tree_;
  std::vector<std::string> joints_;
  Vector damping_;
  std::vector<FrictionLaw> friction_;
};

}  // namespace ulna
