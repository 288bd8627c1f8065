// A simulation of an EngineModel: the mutable state, of one thread at a time.
#pragma once

#include <memory>
#include <string>

#include "plant/engine/model.hpp"

struct mjData_;

namespace ulna {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

class EngineRun;

// Forces that depend on the step they act in, so that stiff springs can be taken at its end: what
// holds a limb in a device. One coupling belongs to one run.
class StepCoupling {
 public:
  virtual ~StepCoupling() = default;

  // Force on each degree of freedom for the coming step. `run` stands at its beginning, with
  // net_force() of everything else; `before` is the force that is in it already.
  virtual Vector force(EngineRun& run, const VectorRef& before) = 0;
};

class EngineRun {
 public:
  using Out = Eigen::Map<Vector>;
  using In = Eigen::Map<const Vector>;

  // Starts at the model's reference configuration, at rest. Throws Error (kMemory).
  explicit EngineRun(EngineModel model);

  const EngineModel& model() const noexcept { return model_; }

  // To the reference configuration, at rest, time 0.
  void reset();

  // State and inputs, to be written before forward() or step(). Angles rad, rates rad/s.
  Out position();
  Out velocity();
  Out activation();
  Out control();
  Out applied();  // force on each degree of freedom from outside, N m or N

  // What follows from the state without moving it: forces, accelerations, contacts.
  void forward();

  // Moves on by `steps` time steps, computing everything anew at each. Throws Error when the run
  // cannot go on, after which it can only be freed: kAnalysis for motion that diverged (the engine
  // would start again from the reference without a word), kUnsupported for more contacts than there
  // is room for and for muscles shorter than the engine can compute, kData for a control that is
  // not finite, kInternal for the engine's own faults.
  void step(Index steps = 1);

  // From now on each step asks the coupling for its force. Forces of couplings are counted among
  // those applied, and are not part of applied(). NULL: none.
  void couple(std::unique_ptr<StepCoupling> coupling);
  StepCoupling* coupling() const noexcept { return coupling_.get(); }
  const Vector& coupling_force() const noexcept { return coupling_force_; }  // of the last step

  // Force on each degree of freedom that the engine needs for an acceleration at the present state:
  // M a + c - passive - constraint forces. Leaves the state as it is.
  Vector inverse(const VectorRef& acceleration);

  // After forward() or step(); valid until the next call of either.
  double time() const;  // s
  In acceleration() const;
  In bias() const;                 // Coriolis, centrifugal and gravity
  In passive() const;              // damping and springs
  In constraint_force() const;     // friction, limits, equalities, contacts
  In actuator_torque() const;      // of all actuators, on each degree of freedom
  In actuator_force() const;       // of each actuator along its path; muscles pull with less than 0
  In actuator_length() const;      // m or rad
  Matrix actuator_moment() const;  // actuators x degrees of freedom: d length / d position
  Matrix inertia() const;          // M(q)
  // All forces on each degree of freedom but inertia, the applied ones included.
  Vector net_force() const;
  // Velocity of a point of a body (world, m), then its rate of turning, in world axes for the rates
  // of all degrees of freedom: 6 x degrees of freedom.
  Matrix point_jacobian(Index body, const Vector3& point) const;
  double potential_energy() const;  // of weight, not of springs, J
  double kinetic_energy() const;    // J
  Index contacts() const;
  Index constraint_rows() const;

  Vector3 body_position(Index body) const;     // in the world, m
  Matrix3 body_orientation(Index body) const;  // columns: body axes in the world
  Vector3 site_position(Index site) const;

  bool faulted() const noexcept { return !fault_.empty(); }

  const mjData_* raw() const noexcept { return data_.get(); }  // for plant/engine

 private:
  template <class Call>
  void enter(Call call);
  void advance();
  void advance_coupled();
  void check_usable() const;
  void check_inputs();
  void check_state();
  void check_muscles();
  [[noreturn]] void fail(int kind, const std::string& reason);

  EngineModel model_;
  std::unique_ptr<mjData_, void (*)(mjData_*)> data_;
  std::string fault_;
  std::unique_ptr<StepCoupling> coupling_;
  Vector coupling_force_;
};

}  // namespace ulna
