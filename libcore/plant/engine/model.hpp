// A compiled model of the engine: immutable, shared by any number of threads and runs. This folder
// is the only place that includes MuJoCo; its headers do not show it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/types.hpp"

struct mjModel_;

namespace ulna {

enum class Part { kBody, kJoint, kGeom, kSite, kTendon, kActuator, kEquality };

// "body", "joint", ...
const char* word(Part part);

// What a run has room for. Rows of constraints cost memory in their square (12 bytes a pair).
struct EngineRoom {
  Index contacts = 100;  // at once; fewer where fewer pairs of bodies can touch
  Index rows = 0;        // of constraints at once; 0: as many as there can be with those contacts
};

// What can be changed in a compiled model. The names are of parts of the model; units SI.
enum class ModelQuantity {
  kMass,           // body; kg; inertia stays as it is
  kInertia,        // body; centre of mass x y z (m), then xx yy zz xy xz yz about it, body axes
  kBodyPosition,   // body; x y z in the parent, m
  kSitePosition,   // site; x y z in the body, m
  kJointDamping,   // joint of one degree of freedom; N m s/rad or N s/m
  kJointFriction,  // joint of one degree of freedom; N m or N
  kLengthRange,    // actuator; shortest and longest path, m
  kMuscle,         // muscle; peak force N, normalised lengths at the two ends of the length range
  kReference,      // equality; time constant and damping ratio, or -stiffness and -damping
  kImpedance,      // equality; the engine's five solimp numbers
};

struct Change {
  ModelQuantity quantity;
  std::string name;
  std::vector<double> values;
};

// One array of two models of one shape: how far they are apart.
struct ArrayDifference {
  std::string array;
  double difference = 0.0;  // largest, relative to the larger of 1 and the array's largest
};

class EngineModel {
 public:
  // Compiles MJCF in memory. Throws Error (kFormat) with the engine's reason in one sentence.
  static EngineModel from_text(const std::string& mjcf, const EngineRoom& room = {});

  // Compiles an MJCF file; what it includes is found beside it. Throws Error: kFile, kFormat.
  static EngineModel from_file(const std::string& path, const EngineRoom& room = {});

  // A model with other numbers, without compiling again. Throws Error (kArgument) that names the
  // part for unknown names and impossible values, kUnsupported where the engine keeps derived poses
  // that it cannot compute again (a body of a model with weld constraints).
  EngineModel changed(const std::vector<Change>& changes) const;

  // The numbers that a change would replace.
  std::vector<double> values(ModelQuantity quantity, const std::string& name) const;

  Index count(Part part) const;
  Index find(Part part, const std::string& name) const;  // -1 where there is none
  Index at(Part part, const std::string& name) const;    // throws Error (kArgument), with the names
  std::string name(Part part, Index index) const;        // "" for one without a name

  Index positions() const;    // numbers in a configuration
  Index velocities() const;   // degrees of freedom
  Index controls() const;     // actuators
  Index activations() const;  // of actuators with dynamics

  // Of a joint with one degree of freedom; throws Error (kArgument) for others.
  Index position_of(const std::string& joint) const;
  Index velocity_of(const std::string& joint) const;

  Vector reference() const;       // configuration that the model is written in
  Matrix joint_range() const;     // joints x 2, rad or m; without limits -inf, inf
  double timestep() const;        // s
  Vector joint_damping() const;   // a degree of freedom, N m s/rad
  Vector joint_friction() const;  // a degree of freedom, N m
  Index constraint_rows() const;  // a run has room for

  // Arrays that differ from those of a model of the same shape. Throws where shapes differ.
  std::vector<ArrayDifference> differences(const EngineModel& other) const;

  const mjModel_* raw() const noexcept { return model_.get(); }  // for plant/engine

 private:
  explicit EngineModel(std::shared_ptr<const mjModel_> model) : model_(std::move(model)) {}

  std::shared_ptr<const mjModel_> model_;
};

}  // namespace ulna
