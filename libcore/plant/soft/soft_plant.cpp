#include "plant/soft/soft_plant.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "plant/engine/friction_law.hpp"
#include "plant/soft/interface_place.hpp"

namespace ulna {
namespace {

constexpr int kRounds = 30;  // of finding which contacts push
// Tissue comes to rest within 0.1 s: steps of this length are free of its
// motion.
constexpr double kSlowStep = 50.0;  // s

// Dry friction of the device's joints. The engine finds it after the interfaces
// have answered, and what they answer depends on it: the step is solved with
// both, by the engine's own law.
class DeviceFriction {
 public:
  DeviceFriction(const ExoScene& scene, const EngineModel& model) : dt_(model.timestep()) {
    for (const ExoLink& link : scene.exo.links) {
      const FrictionLaw law = friction_law(model, link.joint);
      if (law.limit > 0.0) joints_.push_back({model.velocity_of(link.joint), law, 0.0, 0});
    }
  }

  // Takes the engine's guess out of the net force.
  void begin(const EngineRun& run, const VectorRef& velocity, Vector& impulse) {
    for (Joint& j : joints_) {
      j.rate = velocity[j.dof];
      const double guess = j.law.torque(j.rate, run.acceleration()[j.dof]);
      impulse[j.dof] += guess;
      j.side = guess >= j.law.limit ? 1 : guess <= -j.law.limit ? -1 : 0;
    }
  }

  void add(Matrix& system, Vector& right) const {
    for (const Joint& j : joints_) {
      if (j.side != 0) {
        right[j.dof] -= j.side * j.law.limit;
        continue;
      }
      const double inertia = j.law.acceleration_slope / dt_;
      system(j.dof, j.dof) += inertia;
      right[j.dof] += (inertia - j.law.rate_slope) * j.rate;
    }
  }

  bool settle(const VectorRef& velocity) {
    bool changed = false;
    for (Joint& j : joints_) {
      const double torque =
          j.law.rate_slope * j.rate + j.law.acceleration_slope * (velocity[j.dof] - j.rate) / dt_;
      const int side = torque > j.law.limit ? 1 : torque < -j.law.limit ? -1 : 0;
      changed = changed || side != j.side;
      j.side = side;
    }
    return changed;
  }

 private:
  struct Joint {
    Index dof;
    FrictionLaw law;
    double rate;  // at the beginning of the step
    int side;     // at which limit, 0: at none
  };
  double dt_;
  std::vector<Joint> joints_;
};

class InterfaceCoupling : public StepCoupling {
 public:
  InterfaceCoupling(const SoftPlant& plant, const EngineRun& run)
      : friction_(plant.plant().scene(), run.model()) {
    for (const auto& interface : plant.interfaces()) {
      names_.push_back(interface->options().name);
      places_.emplace_back(interface->options(), run.model());
      donned_.push_back(places_.back().pose(run));
      poses_.push_back(donned_.back());
    }
  }

  std::size_t size() const { return places_.size(); }
  LimbPose pose(const EngineRun& run, std::size_t i) const { return places_[i].pose(run); }
  virtual std::vector<InterfaceReport> reports() const = 0;
  virtual double energy(const EngineRun& run) const = 0;

 protected:
  struct Held {
    LimbPose pose;
    Matrix jacobian;
  };

  std::vector<Held> held(const EngineRun& run) {
    std::vector<Held> all;
    for (std::size_t i = 0; i < places_.size(); ++i) {
      poses_[i] = places_[i].pose(run);
      all.push_back({poses_[i], places_[i].jacobian(run)});
    }
    return all;
  }

  // M/dt and forces without the coupling's, so that M/dt (v - v0) = forces +
  // coupling. The engine takes joint damping at the end of the step, which adds
  // it to the inertia.
  struct Smooth {
    Matrix inertia;
    Vector impulse;
  };
  Smooth smooth(EngineRun& run, const VectorRef& before) {
    const double dt = run.model().timestep();
    Smooth s{run.inertia() / dt, run.net_force() - before};
    s.inertia.diagonal() += run.model().joint_damping();
    s.impulse += s.inertia * run.velocity();
    friction_.begin(run, run.velocity(), s.impulse);
    return s;
  }

  InterfaceReport report(std::size_t i) const {
    const Twist moved = coordinates(donned_[i], poses_[i]);
    return {.name = names_[i],
            .cuff = {},
            .strap = {},
            .tension = kNaN,
            .displacement = moved.head<3>(),
            .sliding = Vector3::Zero(),
            .turn = moved.tail<3>().norm()};
  }

  std::vector<std::string> names_;
  std::vector<InterfacePlace> places_;
  std::vector<LimbPose> donned_;
  std::vector<LimbPose> poses_;
  DeviceFriction friction_;
};

class FullCoupling final : public InterfaceCoupling {
 public:
  FullCoupling(const SoftPlant& plant, const EngineRun& run,
               const std::vector<std::shared_ptr<const TissueStep>>& steps,
               const std::vector<std::shared_ptr<const TissueStep>>& slow)
      : InterfaceCoupling(plant, run) {
    for (std::size_t i = 0; i < places_.size(); ++i) {
      interfaces_.emplace_back(plant.interfaces()[i], steps[i]);
      interfaces_.back().don(donned_[i]);
      interfaces_.back().come_to_rest(donned_[i], slow[i]);
    }
  }

  Vector force(EngineRun& run, const VectorRef& before) override {
    const std::vector<Held> all = held(run);
    const Smooth s = smooth(run, before);
    for (std::size_t i = 0; i < all.size(); ++i) interfaces_[i].begin(all[i].pose);
    Vector rate;
    std::vector<Wrench> bias(all.size());
    std::vector<Matrix6> resistance(all.size());
    bool changed = true;
    for (int round = 0; changed && round < kRounds; ++round) {
      Matrix system = s.inertia;
      Vector right = s.impulse;
      for (std::size_t i = 0; i < all.size(); ++i) {
        interfaces_[i].condense(bias[i], resistance[i]);
        system += all[i].jacobian.transpose() * resistance[i] * all[i].jacobian;
        right += all[i].jacobian.transpose() * bias[i];
      }
      friction_.add(system, right);
      rate = system.partialPivLu().solve(right);
      changed = friction_.settle(rate);
      for (std::size_t i = 0; i < all.size(); ++i) {
        changed = interfaces_[i].settle(all[i].jacobian * rate) || changed;
      }
    }
    Vector force = Vector::Zero(rate.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Twist twist = all[i].jacobian * rate;
      interfaces_[i].finish(twist);
      force += all[i].jacobian.transpose() * (bias[i] - resistance[i] * twist);
    }
    return force;
  }

  std::vector<InterfaceReport> reports() const override {
    std::vector<InterfaceReport> all;
    for (std::size_t i = 0; i < interfaces_.size(); ++i) {
      all.push_back(report(i));
      all.back().cuff = interfaces_[i].cuff();
      all.back().strap = interfaces_[i].strap();
      all.back().tension = interfaces_[i].tension();
      all.back().sliding = interfaces_[i].sliding();
    }
    return all;
  }

  double energy(const EngineRun& run) const override {
    double energy = 0.0;
    for (std::size_t i = 0; i < interfaces_.size(); ++i) {
      energy += interfaces_[i].energy(places_[i].pose(run));
    }
    return energy;
  }

  const InterfaceRun& interface(std::size_t i) const { return interfaces_[i]; }
  std::size_t count() const { return interfaces_.size(); }

 private:
  std::vector<InterfaceRun> interfaces_;
};

class ReducedCoupling final : public InterfaceCoupling {
 public:
  ReducedCoupling(const SoftPlant& plant, const EngineRun& run)
      : InterfaceCoupling(plant, run), bushings_(plant.bushings()) {
    wrenches_.resize(bushings_.size(), Wrench::Zero());
  }

  Vector force(EngineRun& run, const VectorRef& before) override {
    const double dt = run.model().timestep();
    const std::vector<Held> all = held(run);
    Smooth s = smooth(run, before);
    for (const Bushing& b : bushings_) {
      const Held& h = all[static_cast<std::size_t>(b.interface)];
      s.inertia += h.jacobian.transpose() * (b.damping + dt * b.stiffness) * h.jacobian;
      s.impulse += h.jacobian.transpose() * b.wrench(at(b), Twist::Zero());
    }
    Vector rate;
    bool changed = true;
    for (int round = 0; changed && round < kRounds; ++round) {
      Matrix system = s.inertia;
      Vector right = s.impulse;
      friction_.add(system, right);
      rate = system.partialPivLu().solve(right);
      changed = friction_.settle(rate);
    }
    Vector force = Vector::Zero(rate.size());
    for (std::size_t k = 0; k < bushings_.size(); ++k) {
      const Bushing& b = bushings_[k];
      const Held& h = all[static_cast<std::size_t>(b.interface)];
      const Twist twist = h.jacobian * rate;
      wrenches_[k] = b.wrench(at(b) + dt * twist, twist);
      force += h.jacobian.transpose() * wrenches_[k];
    }
    return force;
  }

  std::vector<InterfaceReport> reports() const override {
    std::vector<InterfaceReport> all;
    for (std::size_t i = 0; i < places_.size(); ++i) all.push_back(report(i));
    for (std::size_t k = 0; k < bushings_.size(); ++k) {
      InterfaceReport& r = all[static_cast<std::size_t>(bushings_[k].interface)];
      (bushings_[k].strap ? r.strap : r.cuff).wrench += wrenches_[k];
    }
    return all;
  }

  double energy(const EngineRun& run) const override {
    double energy = 0.0;
    for (const Bushing& b : bushings_) {
      const auto i = static_cast<std::size_t>(b.interface);
      const Twist moved = coordinates(donned_[i], places_[i].pose(run)) - b.origin;
      energy += 0.5 * moved.dot(b.stiffness * moved) - b.preload.dot(moved);
    }
    return energy;
  }

 private:
  Twist at(const Bushing& b) const {
    const auto i = static_cast<std::size_t>(b.interface);
    return coordinates(donned_[i], poses_[i]);
  }

  std::vector<Bushing> bushings_;
  std::vector<Wrench> wrenches_;
};

const SoftScene& checked_soft(const SoftScene& soft) {
  require(soft.donning.shoulder_offset.allFinite() && soft.donning.elbow_offset.allFinite() &&
              soft.donning.shoulder_offset.norm() < 0.2 && soft.donning.elbow_offset.norm() < 0.2,
          "offset", "the offsets of shoulder and elbow must be finite and below 0.2 m");
  require(std::isfinite(soft.donning.rotation) && std::fabs(soft.donning.rotation) < 0.5 * kPi,
          "rotation", "the donning rotation must be less than a quarter of a turn");
  require(!soft.interfaces.empty(), "interfaces", "nothing holds the arm in the device");
  return soft;
}

// The arm stays at the world's origin and the device moves: only where they are
// to each other counts.
ExoScene placed(const SoftScene& soft) {
  checked_soft(soft);
  ExoScene scene = soft.scene;
  scene.coupling = Coupling::kApart;
  require(!scene.exo.links.empty(), "links", "the exoskeleton has no links");
  scene.exo.links.front().position -= soft.donning.shoulder_offset;
  scene.arm.elbow += soft.donning.elbow_offset / scene.arm.upper_scale;
  return scene;
}

}  // namespace

SoftScene SoftScene::of(const ExoScene& scene, const Donning& donning, CuffDesign design) {
  return {scene,
          {SoftInterfaceOptions::upper_arm(scene.arm.upper_scale, design),
           SoftInterfaceOptions::forearm(scene.arm.fore_scale, design)},
          donning};
}

SoftPlant::SoftPlant(const SoftScene& soft) : soft_(soft), plant_(placed(soft)) {
  for (const SoftInterfaceOptions& options : soft.interfaces) {
    interfaces_.push_back(std::make_shared<const SoftInterface>(options));
    steps_.push_back(std::make_shared<const TissueStep>(interfaces_.back()->tissue(),
                                                        plant_.model().timestep()));
    slow_steps_.push_back(
        std::make_shared<const TissueStep>(interfaces_.back()->tissue(), kSlowStep));
    InterfacePlace(options, plant_.model());  // the bodies are there
  }
}

SoftPlant SoftPlant::reduced(std::vector<Bushing> bushings) const {
  require(!bushings.empty(), "bushings", "a reduced plant needs bushings");
  for (const Bushing& b : bushings) {
    b.check();
    require(b.interface >= 0 && b.interface < static_cast<int>(interfaces_.size()), "bushings",
            "bushing '" + b.name + "' belongs to no interface");
  }
  SoftPlant plant = *this;
  plant.bushings_ = std::move(bushings);
  return plant;
}

Vector SoftPlant::donned(const VectorRef& device_angle) const {
  const ExoScene& scene = plant_.scene();
  const EngineModel& m = model();
  const auto links = static_cast<Index>(scene.exo.links.size());
  require(device_angle.size() == links && device_angle.allFinite(), "start",
          "the start must have one finite angle for each joint of the device");
  EngineRun run(m);
  const Index upper = m.at(Part::kBody, scene.exo.upper_link);
  const Matrix3 written = run.body_orientation(upper);
  for (Index j = 0; j < links; ++j) {
    run.position()[m.position_of(scene.exo.links[static_cast<std::size_t>(j)].joint)] =
        device_angle[j];
  }
  run.forward();
  // Humerus axes in the world, as far as the link has turned since the scene
  // was written: Ry(flexion + 90 degrees) Rz(abduction) Rx(rotation).
  const Matrix3 turn =
      run.body_orientation(upper) * written.transpose() *
      Eigen::AngleAxisd(soft_.donning.rotation, Vector3::UnitX()).toRotationMatrix();
  const double abduction = std::asin(std::clamp(turn(1, 0), -1.0, 1.0));
  const double flexion = std::atan2(-turn(2, 0), turn(0, 0)) - 0.5 * kPi;
  const double rotation = std::atan2(-turn(1, 2), turn(1, 1));
  const auto put = [&](const char* joint, double angle) {
    run.position()[m.position_of(joint)] = angle;
  };
  put("shoulder_flexion", flexion);
  put("shoulder_abduction", abduction);
  put("shoulder_rotation", rotation);
  put("elbow_flexion", device_angle[links - 1]);
  lay_in_cuffs(run);
  plant_.check_start(run.position());
  return run.position();
}

// Newton's method on flexion, abduction and elbow for the places of the limbs
// across their cuffs: the upper arm on the bottom of its cuff, the forearm with
// its bone in the middle, so that an arm that is perfectly aligned has the
// device's angles. The forearm's height over its cuff's bottom follows from the
// rotation.
void SoftPlant::lay_in_cuffs(EngineRun& run) const {
  if (interfaces_.size() != 2) return;
  const InterfacePlace upper(interfaces_[0]->options(), model());
  const InterfacePlace fore(interfaces_[1]->options(), model());
  const SoftInterfaceOptions& o = interfaces_[0]->options();
  const double bottom = o.tissue.semi_axes.z() - o.cuff.face();
  const double aside = fore.cuff_orientation.col(0).dot(fore.cuff_position);
  const Index joint[] = {model().position_of("shoulder_flexion"),
                         model().position_of("shoulder_abduction"),
                         model().position_of("elbow_flexion")};
  const auto apart = [&] {
    run.forward();
    const Vector3 u = upper.pose(run).position;
    return Vector3(u.x(), u.y() - bottom, fore.pose(run).position.x() + aside - fore.centre.z());
  };
  constexpr double kProbe = 1e-5;
  for (int round = 0; round < 10; ++round) {
    const Vector3 here = apart();
    if (here.norm() < 1e-7) break;
    Matrix3 slope;
    for (int k = 0; k < 3; ++k) {
      run.position()[joint[k]] += kProbe;
      slope.col(k) = (apart() - here) / kProbe;
      run.position()[joint[k]] -= kProbe;
    }
    const Vector3 step = slope.partialPivLu().solve(here);
    if (!step.allFinite()) break;
    const double limit = 0.3 / std::max(0.3, step.cwiseAbs().maxCoeff());
    for (int k = 0; k < 3; ++k) run.position()[joint[k]] -= limit * step[k];
  }
  run.forward();
}

void SoftPlant::attach(EngineRun& run, const VectorRef& device_angle) const {
  require(run.model().velocities() == model().velocities(), "run",
          "the run belongs to another plant");
  run.couple(nullptr);
  run.reset();
  run.position() = donned(device_angle);
  run.forward();
  if (is_reduced()) {
    run.couple(std::make_unique<ReducedCoupling>(*this, run));
  } else {
    run.couple(std::make_unique<FullCoupling>(*this, run, steps_, slow_steps_));
  }
}

void fit_device(SoftScene& soft, double upper_factor, double fore_factor) {
  for (ExoLink& link : soft.scene.exo.links) {
    if (link.name != soft.scene.exo.upper_link) continue;
    const Vector3 longer = (upper_factor - 1.0) * link.position;
    link.position += longer;
    for (SoftInterfaceOptions& o : soft.interfaces) {
      if (o.cuff.link != link.name) continue;
      // From the shoulder the cuff is at link.position + orientation *
      // cuff.position.
      const Vector3 from_shoulder = link.position - longer + link.orientation * o.cuff.position;
      const Vector3 axis = link.position.normalized();
      o.cuff.position += link.orientation.transpose() *
                         ((upper_factor - 1.0) * axis.dot(from_shoulder) * axis - longer);
    }
  }
  for (SoftInterfaceOptions& o : soft.interfaces) {
    if (o.cuff.link != soft.scene.exo.fore_link) continue;
    const Vector3 axis = o.cuff.orientation.col(2);
    o.cuff.position += (fore_factor - 1.0) * axis.dot(o.cuff.position) * axis;
  }
}

std::vector<InterfaceReport> interface_reports(const EngineRun& run) {
  const auto* coupling = dynamic_cast<const InterfaceCoupling*>(run.coupling());
  return coupling == nullptr ? std::vector<InterfaceReport>() : coupling->reports();
}

double interface_energy(EngineRun& run) {
  const auto* coupling = dynamic_cast<const InterfaceCoupling*>(run.coupling());
  return coupling == nullptr ? 0.0 : coupling->energy(run);
}

LimbPose interface_pose(EngineRun& run, std::size_t index) {
  const auto* coupling = dynamic_cast<const InterfaceCoupling*>(run.coupling());
  require(coupling != nullptr && index < coupling->size(), "interface",
          "the run has no such interface");
  run.forward();
  return coupling->pose(run, index);
}

const InterfaceRun& interface_run(const EngineRun& run, std::size_t index) {
  const auto* coupling = dynamic_cast<const FullCoupling*>(run.coupling());
  require(coupling != nullptr && index < coupling->count(), "interface",
          "the run has no such interface in full");
  return coupling->interface(index);
}

}  // namespace ulna
