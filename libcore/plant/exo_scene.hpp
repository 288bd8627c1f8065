// The exoskeleton and the arm in it as one scene: which bodies there are, and the engine's text.
#pragma once

#include <string>
#include <vector>

#include "plant/arm_description.hpp"
#include "plant/exo_description.hpp"

namespace ulna {

// How the arm is held.
enum class Coupling {
  kRigid,    // upper arm and forearm stand in their links, perfectly aligned: the nominal model
  kApart,    // the arm moves on its own joints and nothing holds it
  kExoOnly,  // no arm
  kArmOnly,  // no exoskeleton
};

struct SolverOptions {
  double timestep = 0.005;  // s
  int iterations = 200;     // of Newton's method, at most
  double tolerance = 1e-11;
  double impratio = 10.0;  // friction to normal impedance of contacts
  bool elliptic = false;   // friction cones; else pyramids
  Vector3 gravity = Vector3(0.0, 0.0, -9.81);
};

struct ExoScene {
  ExoDescription exo = ExoDescription::published();
  ArmDescription arm = ArmDescription::cylinders();
  Coupling coupling = Coupling::kRigid;
  SolverOptions solver;

  bool has_exo() const { return coupling != Coupling::kArmOnly; }
  bool has_arm() const { return coupling != Coupling::kExoOnly; }

  // Throws Error (kArgument) with the first thing that cannot be.
  void check() const;
};

// Every body with mass, parents first; joints in the order of their degrees of freedom.
std::vector<RigidBody> bodies_of(const ExoScene& scene);

// The scene in the engine's language, every element named. Motors are named "<joint>_motor" and
// take torque (N m); muscles have their names, and take excitation between 0 and 1. Length ranges
// are placeholders (0.1, 0.2 m) until the paths are known, see exo_plant.hpp. Throws Error
// (kArgument) when the device of an arm that is held rigidly has no joint at its elbow.
std::string mjcf_of(const ExoScene& scene);

}  // namespace ulna
