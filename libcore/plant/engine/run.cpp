#include "plant/engine/run.hpp"

#include <mujoco/mujoco.h>

#include <vector>

#include "base/error.hpp"
#include "plant/engine/trap.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

using engine::contained;

struct Making {
  const mjModel* model;
  mjData* data = nullptr;
  void operator()() { data = mj_makeData(model); }
};

mjData* make_data(const mjModel* model) {
  Making making{.model = model};
  std::string reason;
  if (!contained(making, reason) || making.data == nullptr) {
    throw Error(Fault::kMemory, "", "there is not enough memory for a run of this scene");
  }
  return making.data;
}

std::string seconds(double time) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g s", time);
  return text;
}

std::string joint_of(const EngineModel& model, int dof) {
  const mjModel* m = model.raw();
  if (dof < 0 || dof >= m->nv) return "";
  return " of joint '" + model.name(Part::kJoint, m->dof_jntid[dof]) + "'";
}

}  // namespace

EngineRun::EngineRun(EngineModel model)
    : model_(std::move(model)), data_(make_data(model_.raw()), mj_deleteData) {
  data_->time = 0.0;
  forward();
}

void EngineRun::check_usable() const {
  if (!faulted()) return;
  throw Error(Fault::kArgument, "run",
              "the run ended with a fault and can only be freed; the fault was: " + fault_);
}

template <class Call>
void EngineRun::enter(Call call) {
  std::string reason;
  if (contained(call, reason)) return;
  const bool memory = reason.find("tack overflow") != std::string::npos ||
                      reason.find("allocate") != std::string::npos;
  fault_ = "the engine gave up at " + seconds(data_->time) + ": " + reason;
  throw Error(memory ? Fault::kMemory : Fault::kInternal, "", fault_);
}

void EngineRun::reset() {
  check_usable();
  mjData* d = data_.get();
  enter([this, d] { mj_resetData(model_.raw(), d); });
  forward();
}

EngineRun::Out EngineRun::position() { return {data_->qpos, model_.positions()}; }
EngineRun::Out EngineRun::velocity() { return {data_->qvel, model_.velocities()}; }
EngineRun::Out EngineRun::activation() { return {data_->act, model_.activations()}; }
EngineRun::Out EngineRun::control() { return {data_->ctrl, model_.controls()}; }
EngineRun::Out EngineRun::applied() { return {data_->qfrc_applied, model_.velocities()}; }

void EngineRun::fail(int kind, const std::string& reason) {
  const std::string when = " at " + seconds(data_->time);
  Fault fault = Fault::kAnalysis;
  switch (kind) {
    case mjWARN_CONTACTFULL:
    case mjWARN_CNSTRFULL:
      fault = Fault::kUnsupported;
      fault_ = "there are more contacts" + when + " than the scene has room for (" +
               std::to_string(model_.raw()->nconmax) + "): compile it with room for more";
      break;
    case mjWARN_INERTIA:
      fault_ = "the inertia matrix became singular" + when + reason;
      break;
    default:
      fault_ = "the motion" + reason + " diverged" + when + ": a smaller time step may help";
  }
  throw Error(fault, "", fault_);
}

void EngineRun::check_state() {
  for (const int kind : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_CONTACTFULL,
                         mjWARN_CNSTRFULL, mjWARN_INERTIA}) {
    const mjWarningStat& warning = data_->warning[kind];
    if (warning.number == 0) continue;
    const bool dof = kind == mjWARN_BADQVEL || kind == mjWARN_BADQACC || kind == mjWARN_INERTIA;
    fail(kind, dof ? joint_of(model_, warning.lastinfo) : "");
  }
}

// Below the shortest length of its curve (0.5) this engine's muscle does not go slack but pushes,
// with more than its peak force; muscles never push, so the sign of the force shows it.
void EngineRun::check_muscles() {
  const mjModel* m = model_.raw();
  for (int i = 0; i < m->nu; ++i) {
    if (m->actuator_gaintype[i] != mjGAIN_MUSCLE || data_->actuator_force[i] <= 0.0) continue;
    fault_ = "muscle '" + model_.name(Part::kActuator, i) + "' became shorter at " +
             seconds(data_->time) +
             " than half its optimal length, where the engine's muscles push: give it a longer "
             "range";
    throw Error(Fault::kUnsupported, "", fault_, "actuator " + model_.name(Part::kActuator, i));
  }
}

// The engine would put zero in the place of such a control and go on.
void EngineRun::check_inputs() {
  check_usable();
  const auto refuse = [this](const Out& values, const char* what, Part part) {
    for (Index i = 0; i < values.size(); ++i) {
      if (std::isfinite(values[i])) continue;
      const mjModel* m = model_.raw();
      const Index owner = part == Part::kActuator ? i : m->dof_jntid[i];
      const std::string name = model_.name(part, owner);
      throw Error(
          Fault::kData, what,
          std::string("the ") + what + " of " + word(part) + " '" + name + "' is not finite",
          std::string(word(part)) + " " + name);
    }
  };
  refuse(control(), "control", Part::kActuator);
  refuse(applied(), "applied force", Part::kJoint);
  refuse(velocity(), "velocity", Part::kJoint);
  require_finite(position(), "position");
  if (model_.activations() > 0) require_finite(activation(), "activation");
}

void EngineRun::forward() {
  check_inputs();
  const mjModel* m = model_.raw();
  mjData* d = data_.get();
  enter([m, d] { mj_forward(m, d); });
  check_state();
  check_muscles();
}

void EngineRun::step(Index steps) {
  require(steps >= 0, "steps", "steps must not be negative");
  check_inputs();
  for (Index i = 0; i < steps; ++i) {
    coupling_ == nullptr ? advance() : advance_coupled();
    check_state();
    check_muscles();
  }
}

void EngineRun::advance() {
  const mjModel* m = model_.raw();
  mjData* d = data_.get();
  enter([m, d] { mj_step(m, d); });
}

// What mj_step does, with a pause before the forces are final.
void EngineRun::advance_coupled() {
  const mjModel* m = model_.raw();
  mjData* d = data_.get();
  const Vector outside = applied();
  applied() += coupling_force_;
  enter([m, d] {
    mj_checkPos(m, d);
    mj_checkVel(m, d);
    mj_forward(m, d);
  });
  check_state();
  coupling_force_ = coupling_->force(*this, coupling_force_);
  applied() = outside + coupling_force_;
  enter([m, d] {
    mj_forwardSkip(m, d, mjSTAGE_VEL, 1);
    mj_checkAcc(m, d);
    mj_Euler(m, d);
  });
  applied() = outside;
}

void EngineRun::couple(std::unique_ptr<StepCoupling> coupling) {
  coupling_ = std::move(coupling);
  coupling_force_ = Vector::Zero(model_.velocities());
}

Vector EngineRun::net_force() const {
  return In(data_->qfrc_smooth, model_.velocities()) + constraint_force();
}

Matrix EngineRun::point_jacobian(Index body, const Vector3& point) const {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows jacobian(6, model_.velocities());
  mj_jac(model_.raw(), data_.get(), jacobian.data(), jacobian.row(3).data(), point.data(),
         static_cast<int>(body));
  return jacobian;
}

Vector EngineRun::inverse(const VectorRef& acceleration) {
  require(acceleration.size() == model_.velocities(), "acceleration",
          "acceleration must have one number for each degree of freedom");
  require_finite(acceleration, "acceleration");
  check_inputs();
  const mjModel* m = model_.raw();
  mjData* d = data_.get();
  Eigen::Map<Vector>(d->qacc, m->nv) = acceleration;
  enter([m, d] { mj_inverse(m, d); });
  check_state();
  return In(d->qfrc_inverse, m->nv);
}

double EngineRun::time() const { return data_->time; }
EngineRun::In EngineRun::acceleration() const { return {data_->qacc, model_.velocities()}; }
EngineRun::In EngineRun::bias() const { return {data_->qfrc_bias, model_.velocities()}; }
EngineRun::In EngineRun::passive() const { return {data_->qfrc_passive, model_.velocities()}; }
EngineRun::In EngineRun::constraint_force() const {
  return {data_->qfrc_constraint, model_.velocities()};
}
EngineRun::In EngineRun::actuator_torque() const {
  return {data_->qfrc_actuator, model_.velocities()};
}
EngineRun::In EngineRun::actuator_force() const {
  return {data_->actuator_force, model_.controls()};
}
EngineRun::In EngineRun::actuator_length() const {
  return {data_->actuator_length, model_.controls()};
}

Matrix EngineRun::actuator_moment() const {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(data_->actuator_moment, model_.controls(), model_.velocities());
}

Matrix EngineRun::inertia() const {
  Matrix m(model_.velocities(), model_.velocities());
  mj_fullM(model_.raw(), m.data(), data_->qM);  // symmetric: order of storage does not matter
  return m;
}

// The engine's own sums are there only for models that ask for them.
double EngineRun::potential_energy() const {
  const mjModel* m = model_.raw();
  double energy = 0.0;
  for (int b = 1; b < m->nbody; ++b) {
    energy -= m->body_mass[b] * mju_dot3(m->opt.gravity, data_->xipos + 3 * b);
  }
  return energy;
}

double EngineRun::kinetic_energy() const {
  const In rate(data_->qvel, model_.velocities());
  return 0.5 * rate.dot(inertia() * rate);
}

Index EngineRun::contacts() const { return data_->ncon; }
Index EngineRun::constraint_rows() const { return data_->nefc; }

Vector3 EngineRun::body_position(Index body) const { return Vector3(data_->xpos + 3 * body); }

Matrix3 EngineRun::body_orientation(Index body) const {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(data_->xmat + 9 * body);
}

Vector3 EngineRun::site_position(Index site) const { return Vector3(data_->site_xpos + 3 * site); }

}  // namespace ulna
