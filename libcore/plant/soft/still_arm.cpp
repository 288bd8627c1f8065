#include "plant/soft/still_arm.hpp"

#include <Eigen/LU>
#include <algorithm>

#include "base/error.hpp"

namespace ulna {
namespace {

constexpr int kPushRounds = 30;  // of finding which contacts push

}  // namespace

StillArm::StillArm(const SoftPlant& full, const VectorRef& device_angle)
    : plant_(full), run_(full.model()) {
  require(!full.is_reduced(), "plant", "the plant is reduced already");
  run_.position() = full.donned(device_angle);
  run_.forward();
  const EngineModel& m = full.model();
  std::vector<Index> device;
  for (const ExoLink& link : full.plant().scene().exo.links) {
    device.push_back(m.velocity_of(link.joint));
  }
  for (Index dof = 0; dof < m.velocities(); ++dof) {
    if (std::find(device.begin(), device.end(), dof) == device.end()) arm_.push_back(dof);
  }
  for (std::size_t i = 0; i < full.interfaces().size(); ++i) {
    places_.emplace_back(full.interfaces()[i]->options(), m);
    interfaces_.emplace_back(full.interfaces()[i], full.steps()[i]);
    interfaces_[i].don(pose(i));
    interfaces_[i].come_to_rest(pose(i), full.slow_steps()[i]);
    interfaces_[i].use(full.slow_steps()[i]);
  }
}

void StillArm::activate(double level) {
  const EngineModel& m = run_.model();
  for (const Muscle& muscle : plant_.plant().scene().arm.muscles) {
    if (muscle.group == MuscleGroup::kShoulder) continue;
    // Actuators without dynamics come first.
    const Index state = m.at(Part::kActuator, muscle.name) - (m.controls() - m.activations());
    run_.activation()[state] = level;
  }
}

void StillArm::bend(double angle) {
  const EngineModel& m = run_.model();
  const std::string& joint = plant_.plant().scene().exo.links.back().joint;
  const double by = angle - run_.position()[m.position_of(joint)];
  Vector turned = Vector::Zero(m.velocities());
  turned[m.velocity_of(joint)] = turned[m.velocity_of("elbow_flexion")] = by;
  step(turned);
}

void StillArm::balance(int steps) {
  for (int s = 0; s < steps; ++s) step(Vector::Zero(run_.model().velocities()));
}

// One long step: the joints turn by what is given and the arm's by what
// balances the forces.
void StillArm::step(const Vector& turned) {
  const auto n = static_cast<Index>(arm_.size());
  const double dt = interfaces_.front().timestep();
  run_.forward();
  const Vector force = run_.net_force() - run_.constraint_force();
  std::vector<Matrix> jacobian;
  std::vector<Twist> given;
  for (std::size_t i = 0; i < interfaces_.size(); ++i) {
    interfaces_[i].begin(pose(i));
    const Matrix whole = places_[i].jacobian(run_);
    Matrix of_arm(6, n);
    for (Index k = 0; k < n; ++k) of_arm.col(k) = whole.col(arm_[static_cast<std::size_t>(k)]);
    jacobian.push_back(std::move(of_arm));
    given.emplace_back(whole * turned / dt);
  }
  Vector rate;
  bool changed = true;
  for (int round = 0; changed && round < kPushRounds; ++round) {
    Matrix system = Matrix::Zero(n, n);
    Vector right(n);
    for (Index k = 0; k < n; ++k) right[k] = force[arm_[static_cast<std::size_t>(k)]];
    for (std::size_t i = 0; i < interfaces_.size(); ++i) {
      Wrench bias;
      Matrix6 resistance;
      interfaces_[i].condense(bias, resistance);
      system += jacobian[i].transpose() * resistance * jacobian[i];
      right += jacobian[i].transpose() * (bias - resistance * given[i]);
    }
    rate = system.partialPivLu().solve(right);
    changed = false;
    for (std::size_t i = 0; i < interfaces_.size(); ++i) {
      changed = interfaces_[i].settle(given[i] + jacobian[i] * rate) || changed;
    }
  }
  for (std::size_t i = 0; i < interfaces_.size(); ++i) {
    interfaces_[i].finish(given[i] + jacobian[i] * rate);
  }
  run_.position() += turned;
  for (Index k = 0; k < n; ++k) {
    run_.position()[arm_[static_cast<std::size_t>(k)]] += dt * rate[k];
  }
  run_.forward();
}

StillArm::Resistance StillArm::resistance(std::size_t i,
                                          std::shared_ptr<const TissueStep> step) const {
  InterfaceRun still = interfaces_[i];
  still.use(std::move(step));
  still.begin(pose(i));
  for (int round = 0; round < kPushRounds && still.settle(Twist::Zero()); ++round) {
  }
  Wrench bias;
  Matrix6 all;
  still.condense(bias, all);
  const Matrix6 cuff = still.cuff_resistance();
  return {cuff, all - cuff};
}

StillArm::Resistance StillArm::stiffness(std::size_t i) const {
  const double dt = plant_.slow_steps()[i]->timestep();
  const Resistance slow = resistance(i, plant_.slow_steps()[i]);
  return {slow.cuff / dt, slow.strap / dt};
}

StillArm::Resistance StillArm::damping(std::size_t i) const {
  const Resistance stiff = stiffness(i);
  const Resistance quick = resistance(i, plant_.steps()[i]);
  const double dt = plant_.steps()[i]->timestep();
  return {quick.cuff - dt * stiff.cuff, quick.strap - dt * stiff.strap};
}

}  // namespace ulna
