// The engine's dry friction in closed form. The engine has Coulomb friction as a soft constraint:
// it opposes with (a + B v) / R and never with more than its limit, so that a joint creeps where
// the limit is not reached. B and R follow from the compiled model alone, which makes friction a
// part of the nominal model that is exact at every speed.
#pragma once

#include <algorithm>
#include <string>

#include "plant/engine/model.hpp"

namespace ulna {

struct FrictionLaw {
  double limit = 0.0;               // N m; 0: no friction
  double rate_slope = 0.0;          // N m s/rad, while it creeps
  double acceleration_slope = 0.0;  // kg m^2

  // Torque that opposes the motion, to be added to what a motor must give.
  double torque(double rate, double acceleration) const {
    return std::clamp(rate_slope * rate + acceleration_slope * acceleration, -limit, limit);
  }
  // Speed above which friction is at its limit when nothing accelerates, rad/s.
  double creep_rate() const { return rate_slope > 0.0 ? limit / rate_slope : 0.0; }
};

// Of a joint with one degree of freedom. Throws Error (kArgument) where there is none.
FrictionLaw friction_law(const EngineModel& model, const std::string& joint);

// Largest control of an actuator, either way; infinite where it has no limit.
double control_limit(const EngineModel& model, Index actuator);

}  // namespace ulna
