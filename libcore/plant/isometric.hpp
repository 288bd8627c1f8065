// The maximum isometric torque test: what each muscle does at a joint, held still at each angle.
#pragma once

#include <string>
#include <vector>

#include "base/token.hpp"
#include "plant/exo_plant.hpp"

namespace ulna {

// One row an angle, one column a muscle.
struct MuscleTable {
  std::vector<std::string> muscles;
  Vector angle;    // rad
  Matrix length;   // of the path, m
  Matrix moment;   // torque on the joint per newton of pull, m: -d length / d angle
  Matrix active;   // torque at full excitation without the passive part, N m
  Matrix passive;  // torque at no excitation, N m
};

// Holds `joint` at each angle and every other joint in `pose` (the model's reference where empty).
// Throws Error: kArgument for a joint, muscle or pose that is not there.
MuscleTable muscle_table(const EngineModel& model, const std::string& joint,
                         const std::vector<std::string>& muscles, const VectorRef& angle,
                         const VectorRef& pose, Token* token = nullptr);

// Peak of a torque curve: torque and angle of the entry that is largest in magnitude.
struct TorquePeak {
  double torque = 0.0;  // N m
  double angle = 0.0;   // rad
};
TorquePeak peak_of(const VectorRef& angle, const VectorRef& torque);

// Measured maximum isometric elbow torque, flexion positive.
struct TorqueReference {
  std::string name;
  Vector angle;      // rad
  Vector flexion;    // N m
  Vector extension;  // N m, negative
};
TorqueReference amis_torque();      // Amis et al., six angles
TorqueReference buchanan_torque();  // Buchanan et al., twelve angles

// Root of the mean square difference at the reference's angles within the curve's, which is read
// between its entries by straight lines. Throws Error (kData) when no angle is within.
double torque_error(const VectorRef& angle, const VectorRef& torque,
                    const VectorRef& reference_angle, const VectorRef& reference_torque);

}  // namespace ulna
