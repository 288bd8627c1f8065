#include "plant/nominal_model.hpp"

#include <cmath>
#include <utility>

#include "base/error.hpp"

namespace ulna {
namespace {

RigidTree held_tree(ExoScene scene) {
  require(scene.has_exo() && scene.has_arm(), "plant",
          "a nominal model needs a device and an arm in it");
  scene.coupling = Coupling::kRigid;
  scene.arm.pronation = false;
  scene.arm.wrist = false;
  return RigidTree(bodies_of(scene), scene.solver.gravity);
}

}  // namespace

NominalModel::NominalModel(const ExoScene& scene, const EngineModel& device)
    : NominalModel(held_tree(scene), device) {}

NominalModel::NominalModel(RigidTree tree, const EngineModel& device)
    : tree_(std::move(tree)), joints_(tree_.joint_names()), damping_(tree_.joints()) {
  const Vector damping = device.joint_damping();
  for (Index j = 0; j < tree_.joints(); ++j) {
    const std::string& joint = joints_[static_cast<std::size_t>(j)];
    damping_[j] = damping[device.velocity_of(joint)];
    friction_.push_back(friction_law(device, joint));
  }
}

Vector NominalModel::loss(const VectorRef& rate, const VectorRef& acceleration,
                          const NominalTerms& terms) const {
  Vector loss = Vector::Zero(rate.size());
  if (terms.damping) loss = damping_.cwiseProduct(rate);
  for (Index j = 0; j < rate.size(); ++j) {
    const FrictionLaw& law = friction_[static_cast<std::size_t>(j)];
    if (terms.friction == NominalFriction::kEngine) {
      loss[j] += law.torque(rate[j], acceleration[j]);
    } else if (terms.friction == NominalFriction::kCoulomb && rate[j] != 0.0) {
      loss[j] += std::copysign(law.limit, rate[j]);
    }
  }
  return loss;
}

Vector NominalModel::torque(const VectorRef& angle, const VectorRef& rate,
                            const VectorRef& acceleration, const NominalTerms& terms) const {
  const Vector none = Vector::Zero(tree_.joints());
  Vector torque = tree_.inverse_dynamics(angle, rate, terms.inertia ? Vector(acceleration) : none);
  torque += loss(rate, acceleration, terms);
  return torque;
}

}  // namespace ulna
