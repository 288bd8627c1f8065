#include "plant/engine/friction_law.hpp"

#include <mujoco/mujoco.h>

namespace ulna {

// Constraint rows of friction have no position, so of the engine's spring and damper only the
// damper is left: reference acceleration -B v, inverse weight R.
FrictionLaw friction_law(const EngineModel& model, const std::string& joint) {
  const mjModel* m = model.raw();
  const Index dof = model.velocity_of(joint);
  FrictionLaw law{.limit = m->dof_frictionloss[dof]};
  if (law.limit <= 0.0) return {};
  const mjtNum* reference = m->dof_solref + mjNREF * dof;
  const mjtNum* impedance = m->dof_solimp + mjNIMP * dof;
  const auto within = [](double value) { return std::clamp(value, mjMINIMP, mjMAXIMP); };
  const double least = within(impedance[0]);
  const double most = within(impedance[1]);
  const double resistance = std::max(mjMINVAL, (1.0 - least) / least * m->dof_invweight0[dof]);
  double damping = -reference[1] / most;  // the direct form: -stiffness, -damping
  if (reference[0] > 0.0) {
    double time = reference[0];
    if ((m->opt.disableflags & mjDSBL_REFSAFE) == 0) time = std::max(time, 2.0 * m->opt.timestep);
    damping = 2.0 / (most * time);
  }
  law.acceleration_slope = 1.0 / resistance;
  law.rate_slope = damping / resistance;
  return law;
}

double control_limit(const EngineModel& model, Index actuator) {
  const mjModel* m = model.raw();
  if (m->actuator_ctrllimited[actuator] == 0) return kInfinity;
  const mjtNum* range = m->actuator_ctrlrange + 2 * actuator;
  return std::min(-range[0], range[1]);
}

}  // namespace ulna
