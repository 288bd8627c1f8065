#include "plant/engine_mobilised.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

using Places = std::vector<Index>;

Vector at_places(const VectorRef& values, const Places& places) {
  Vector picked(static_cast<Index>(places.size()));
  for (Index i = 0; i < picked.size(); ++i) {
    picked[i] = values[places[static_cast<std::size_t>(i)]];
  }
  return picked;
}

// Length of a muscle over its optimal one, from the length of its path.
struct MuscleScale {
  double path = 1.0;      // optimal length, m of path
  double shortest = 0.0;  // of the path, m
  double begin = 0.0;     // normalised length there

  double length(double actual) const { return begin + (actual - shortest) / path; }
};

struct WiredParts {
  explicit WiredParts(EngineModel compiled) : model(std::move(compiled)) {}

  EngineModel model;
  EngineWiring wiring;
  std::shared_ptr<const NominalModel> nominal;
  Places device_position, device_dof, human_position, human_dof;
  Places motor;   // actuator of each device joint, -1
  Places muscle;  // actuators
  Places state;   // activation of each muscle
  std::vector<MuscleScale> scale;
  std::vector<FrictionLaw> friction;  // of each device joint
};

class WiredRun final : public MobilisedRun {
 public:
  WiredRun(std::shared_ptr<const WiredParts> parts, const EngineModel& model,
           const VectorRef& angle, const VectorRef& added_damping)
      : p_(std::move(parts)), run_(model), damping_(added_damping) {
    if (p_->wiring.attach) {
      p_->wiring.attach(run_, angle);
    } else {
      for (Index j = 0; j < angle.size(); ++j) {
        run_.position()[p_->device_position[static_cast<std::size_t>(j)]] = angle[j];
      }
    }
    run_.forward();
    left_rate_ = left_acceleration_ = device_rate();
    left_activation_ = run_.activation();
    own_damping_ = at_places(p_->model.joint_damping(), p_->device_dof);
  }

  Vector device_angle() override { return at_places(run_.position(), p_->device_position); }
  Vector device_rate() override { return at_places(run_.velocity(), p_->device_dof); }
  Vector human_angle() override { return at_places(run_.position(), p_->human_position); }
  Vector human_rate() override { return at_places(run_.velocity(), p_->human_dof); }

  void command(const VectorRef& motor_torque, const VectorRef& excitation) override {
    commanded_ = motor_torque;
    EngineRun::Out control = run_.control();
    for (std::size_t j = 0; j < p_->motor.size(); ++j) {
      if (p_->motor[j] >= 0) control[p_->motor[j]] = motor_torque[static_cast<Index>(j)];
    }
    for (std::size_t k = 0; k < p_->muscle.size(); ++k) {
      control[p_->muscle[k]] = excitation[static_cast<Index>(k)];
    }
  }

  void step() override {
    left_rate_ = device_rate();
    left_velocity_ = run_.velocity();
    left_activation_ = run_.activation();
    run_.step();
    now_rate_ = device_rate();
    left_acceleration_ = (now_rate_ - left_rate_) / p_->model.timestep();
  }

  // The engine's damping is implicit: it acts with the rate at the end of the step. Its own
  // acceleration is that without this, which the motion never has; friction answers to it.
  Vector device_acceleration() const override { return left_acceleration_; }
  Vector motor_torque() const override { return commanded_ - damping_.cwiseProduct(now_rate_); }
  Vector device_loss() const override {
    const Vector free = at_places(run_.acceleration(), p_->device_dof);
    Vector loss = own_damping_.cwiseProduct(now_rate_);
    for (Index j = 0; j < loss.size(); ++j) {
      loss[j] += p_->friction[static_cast<std::size_t>(j)].torque(left_rate_[j], free[j]);
    }
    return loss;
  }

  Vector muscle_torque() const override {
    const Matrix moment = run_.actuator_moment();
    const Vector force = run_.actuator_force();
    Vector torque = Vector::Zero(static_cast<Index>(p_->human_dof.size()));
    for (const Index i : p_->muscle) {
      for (Index j = 0; j < torque.size(); ++j) {
        torque[j] += moment(i, p_->human_dof[static_cast<std::size_t>(j)]) * force[i];
      }
    }
    return torque;
  }

  Vector activation() const override {
    Vector values(static_cast<Index>(p_->state.size()));
    for (Index k = 0; k < values.size(); ++k) {
      values[k] = left_activation_[p_->state[static_cast<std::size_t>(k)]];
    }
    return values;
  }

  Vector muscle_length() const override {
    Vector length = at_places(run_.actuator_length(), p_->muscle);
    for (Index k = 0; k < length.size(); ++k) {
      length[k] = p_->scale[static_cast<std::size_t>(k)].length(length[k]);
    }
    return length;
  }

  Vector muscle_rate() const override {
    if (left_velocity_.size() == 0) return Vector::Zero(static_cast<Index>(p_->muscle.size()));
    const Vector path = run_.actuator_moment() * left_velocity_;
    Vector rate = at_places(path, p_->muscle);
    for (Index k = 0; k < rate.size(); ++k) rate[k] /= p_->scale[static_cast<std::size_t>(k)].path;
    return rate;
  }

  Vector extras() const override {
    return p_->wiring.read_extras ? p_->wiring.read_extras(run_) : Vector();
  }

 private:
  std::shared_ptr<const WiredParts> p_;
  EngineRun run_;
  Vector damping_;
  Vector commanded_;
  Vector own_damping_;
  Vector left_rate_, now_rate_, left_acceleration_, left_velocity_, left_activation_;
};

class WiredProbe final : public MuscleProbe {
 public:
  explicit WiredProbe(std::shared_ptr<const WiredParts> parts)
      : p_(std::move(parts)), run_(p_->model) {}

  Vector torque(const VectorRef& angle, const VectorRef& rate,
                const VectorRef& activation) override {
    require(angle.size() == static_cast<Index>(p_->human_position.size()) &&
                rate.size() == angle.size(),
            "angle", "there must be one angle and one rate for each human joint");
    require(activation.size() == static_cast<Index>(p_->muscle.size()), "activation",
            "there must be one activation for each muscle");
    for (std::size_t j = 0; j < p_->human_position.size(); ++j) {
      run_.position()[p_->human_position[j]] = angle[static_cast<Index>(j)];
      run_.velocity()[p_->human_dof[j]] = rate[static_cast<Index>(j)];
    }
    for (std::size_t k = 0; k < p_->state.size(); ++k) {
      run_.activation()[p_->state[k]] = activation[static_cast<Index>(k)];
    }
    run_.forward();
    const Matrix moment = run_.actuator_moment();
    const Vector force = run_.actuator_force();
    Vector torque = Vector::Zero(angle.size());
    for (const Index i : p_->muscle) {
      for (Index j = 0; j < torque.size(); ++j) {
        torque[j] += moment(i, p_->human_dof[static_cast<std::size_t>(j)]) * force[i];
      }
    }
    return torque;
  }

 private:
  std::shared_ptr<const WiredParts> p_;
  EngineRun run_;
};

class WiredPlant final : public MobilisedPlant {
 public:
  explicit WiredPlant(std::shared_ptr<const WiredParts> parts) : p_(std::move(parts)) {}

  const std::vector<std::string>& device_joints() const override {
    return p_->wiring.device_joints;
  }
  const std::vector<std::string>& human_joints() const override { return p_->wiring.human_joints; }
  const std::vector<std::string>& muscles() const override { return p_->wiring.muscles; }
  const std::vector<MuscleGroup>& groups() const override { return p_->wiring.groups; }
  const std::vector<PlantChannel>& extras() const override { return p_->wiring.extras; }
  const std::vector<Index>& counterparts() const override { return p_->wiring.counterparts; }
  double timestep() const override { return p_->model.timestep(); }
  Vector reference() const override {
    return at_places(p_->model.reference(), p_->device_position);
  }
  Matrix device_range() const override { return ranges(p_->wiring.device_joints); }
  Matrix human_range() const override { return ranges(p_->wiring.human_joints); }

  Vector motor_limit() const override {
    Vector limit = Vector::Zero(static_cast<Index>(p_->motor.size()));
    for (Index j = 0; j < limit.size(); ++j) {
      const Index i = p_->motor[static_cast<std::size_t>(j)];
      if (i >= 0) limit[j] = control_limit(p_->model, i);
    }
    return limit;
  }

  const NominalModel& nominal() const override {
    if (p_->nominal != nullptr) return *p_->nominal;
    throw Error(Fault::kUnsupported, "plant", "the plant has no nominal model");
  }

  std::unique_ptr<MobilisedRun> start(const VectorRef& angle,
                                      const VectorRef& added_damping) const override {
    const auto joints = static_cast<Index>(p_->device_dof.size());
    require(angle.size() == joints && added_damping.size() == joints, "start",
            "there must be one angle and one damping for each joint of the device");
    EngineModel model = p_->model;
    if ((added_damping.array() != 0.0).any()) {
      std::vector<Change> changes;
      const Vector own = model.joint_damping();
      for (Index j = 0; j < joints; ++j) {
        const Index dof = p_->device_dof[static_cast<std::size_t>(j)];
        changes.push_back({ModelQuantity::kJointDamping,
                           p_->wiring.device_joints[static_cast<std::size_t>(j)],
                           {own[dof] + added_damping[j]}});
      }
      model = model.changed(changes);
    }
    return std::make_unique<WiredRun>(p_, model, angle, added_damping);
  }

  std::unique_ptr<MuscleProbe> probe() const override { return std::make_unique<WiredProbe>(p_); }

 private:
  Matrix ranges(const std::vector<std::string>& joints) const {
    const Matrix all = p_->model.joint_range();
    Matrix range(static_cast<Index>(joints.size()), 2);
    for (Index j = 0; j < range.rows(); ++j) {
      range.row(j) = all.row(p_->model.at(Part::kJoint, joints[static_cast<std::size_t>(j)]));
    }
    return range;
  }

  std::shared_ptr<const WiredParts> p_;
};

// Whose names the parts of a plant have: its own description's; that of the nominal model where the
// plant was read from a file or changed.
const ExoScene& naming_scene(const ExoPlant& plant, const ExoScene* nominal) {
  if (nominal == nullptr && !plant.has_nominal()) {
    throw Error(Fault::kUnsupported, "plant",
                "the plant has no nominal model, because it was read from a scene file or changed: "
                "give a plant that is described as nominal");
  }
  if (plant.described() == nullptr) return *nominal;
  const ExoScene& scene = *plant.described();
  require(scene.coupling == Coupling::kRigid, "plant",
          "the plant's device does not hold the arm: an assessment needs "
          "coupling rigid or soft");
  return scene;
}

// What a file says of itself is too little to trust: its actuators must be those of the nominal
// model, and its muscles turn joints of the device.
void check_read(const EngineModel& model, const EngineWiring& w) {
  const auto is_there = [](const std::string& motor) { return !motor.empty(); };
  const auto motors = std::count_if(w.motors.begin(), w.motors.end(), is_there);
  const auto expected = static_cast<Index>(motors) + static_cast<Index>(w.muscles.size());
  require(model.controls() == expected, "plant",
          sentence(6, "the scene has ", model.controls(), " actuators, the nominal model ",
                   expected, ": both must have the same motors and muscles"));
  EngineRun run(model);
  run.forward();
  const Matrix moment = run.actuator_moment();
  for (const std::string& muscle : w.muscles) {
    for (const std::string& joint : w.device_joints) {
      const Index i = model.at(Part::kActuator, muscle);
      if (std::fabs(moment(i, model.velocity_of(joint))) > 1e-6) return;
    }
  }
  require(w.muscles.empty(), "plant",
          "no muscle of the scene turns a joint of its device: an assessment of a scene that was "
          "read needs an arm that the device holds rigidly");
}

MuscleScale scale_of(const EngineModel& model, const std::string& muscle) {
  const std::vector<double> length = model.values(ModelQuantity::kLengthRange, muscle);
  const std::vector<double> numbers = model.values(ModelQuantity::kMuscle, muscle);
  return {(length[1] - length[0]) / (numbers[2] - numbers[1]), length[0], numbers[1]};
}

}  // namespace

std::shared_ptr<const MobilisedPlant> mobilised(const EngineModel& model, EngineWiring wiring,
                                                std::shared_ptr<const NominalModel> nominal) {
  require(wiring.motors.size() == wiring.device_joints.size() &&
              wiring.counterparts.size() == wiring.device_joints.size(),
          "wiring", "each joint of the device needs its motor and its human joint, or none");
  require(wiring.groups.size() == wiring.muscles.size(), "wiring",
          "each muscle must belong to a group");
  auto parts = std::make_shared<WiredParts>(model);
  parts->wiring = std::move(wiring);
  parts->nominal = std::move(nominal);
  const EngineWiring& w = parts->wiring;
  for (const std::string& joint : w.device_joints) {
    parts->device_position.push_back(model.position_of(joint));
    parts->device_dof.push_back(model.velocity_of(joint));
    parts->friction.push_back(friction_law(model, joint));
  }
  for (const std::string& joint : w.human_joints) {
    parts->human_position.push_back(model.position_of(joint));
    parts->human_dof.push_back(model.velocity_of(joint));
  }
  for (const std::string& motor : w.motors) {
    parts->motor.push_back(motor.empty() ? -1 : model.at(Part::kActuator, motor));
  }
  for (const std::string& muscle : w.muscles) {
    const Index i = model.at(Part::kActuator, muscle);
    parts->scale.push_back(scale_of(model, muscle));
    parts->muscle.push_back(i);
    // Actuators without dynamics come first.
    parts->state.push_back(i - (model.controls() - model.activations()));
  }
  return std::make_shared<WiredPlant>(parts);
}

std::shared_ptr<const MobilisedPlant> mobilised(const ExoPlant& plant, const ExoScene* nominal) {
  const ExoScene& scene = naming_scene(plant, nominal);
  EngineWiring wiring;
  for (const ExoLink& link : scene.exo.links) {
    wiring.device_joints.push_back(link.joint);
    wiring.motors.push_back(link.motor_limit > 0.0 ? link.joint + "_motor" : "");
    wiring.counterparts.push_back(static_cast<Index>(wiring.counterparts.size()));
  }
  wiring.human_joints = wiring.device_joints;
  for (const Muscle& muscle : scene.arm.muscles) {
    wiring.muscles.push_back(muscle.name);
    wiring.groups.push_back(muscle.group);
  }
  auto own =
      std::make_shared<const NominalModel>(nominal == nullptr ? scene : *nominal, plant.model());
  if (plant.described() == nullptr) check_read(plant.model(), wiring);
  return mobilised(plant.model(), std::move(wiring), std::move(own));
}

}  // namespace ulna
