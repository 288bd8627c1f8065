#include "plant/parity_scene.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "base/error.hpp"
#include "plant/arm_muscles.hpp"
#include "plant/engine/mjcf.hpp"
#include "plant/parity_interface.hpp"
#include "plant/parity_muscles.hpp"

namespace ulna {
namespace {

// Of equality constraints: d0, d at the width, width, midpoint, power.
constexpr double kTissueImpedance[] = {0.9, 0.9, 0.001, 0.5, 2.0};
constexpr double kFirmImpedance[] = {0.99, 0.99, 0.001, 0.5, 2.0};  // volume, straps
constexpr double kWeldImpedance[] = {0.96, 0.99, 0.001, 0.5, 2.0};
constexpr double kStrapReference[] = {0.01, 1.0};  // time constant s, damping ratio
constexpr double kWeldReference[] = {0.02, 1.0};

constexpr double kWidened = 10.0 * kDegree;

// Who touches whom: kinds meet where one's type is in the other's affinity.
struct ContactBits {
  double type, affinity;
};

class ParityWriter {
 public:
  explicit ParityWriter(const ParityOptions& options)
      : options_(options),
        scene_(parity_bodies(options)),
        bodies_(bodies_of(scene_)),
        document_("published simulation") {}

  std::string text() {
    write_head();
    write_bodies();
    tendons_ = document_.root().child("tendon");
    equalities_ = document_.root().child("equality");
    const ParityCentres centres = parity_centres(scene_.arm);
    write_shell(ParityShell::upper_arm(), "humerus", centres.upper, 2.0, options_.upper_stiffness);
    write_shell(ParityShell::forearm(), "ulna", centres.fore, 4.0, options_.fore_stiffness);
    write_cuff(ParityCuff::upper_arm(), 2.0);
    write_cuff(ParityCuff::forearm(), 4.0);
    write_strap(ParityStrap::upper_arm(), 2.0);
    write_strap(ParityStrap::forearm(), 4.0);
    write_paths();
    write_actuators();
    return document_.text();
  }

 private:
  void write_head() {
    const SolverOptions& s = scene_.solver;
    MjcfElement root = document_.root();
    root.child("compiler").set("angle", "radian");
    root.child("size")
        .set("njmax", static_cast<double>(kParityRows))
        .set("nconmax", static_cast<double>(kParityContacts));
    root.child("option")
        .set("timestep", s.timestep)
        .set("solver", "Newton")
        .set("iterations", s.iterations)
        .set("tolerance", s.tolerance)
        .set("impratio", s.impratio)
        .set("cone", "pyramidal")
        .set("jacobian", "sparse");
    world_ = root.child("worldbody");
  }

  MjcfElement body(const std::string& name) { return elements_.at(name); }

  void write_joint(MjcfElement element, const RigidBody& b) {
    MjcfElement joint = element.named("joint", b.joint);
    joint.set("type", "hinge").set("axis", b.axis).set("ref", b.reference).set("limited", "true");
    for (const ExoLink& link : scene_.exo.links) {
      if (link.joint != b.joint) continue;
      joint.set("range", {link.lower, link.upper})
          .set("damping", link.damping)
          .set("frictionloss", link.friction);
      return;
    }
    const ArmDescription& arm = scene_.arm;
    const JointRange& range = b.joint == "shoulder_flexion"     ? arm.flexion
                              : b.joint == "shoulder_abduction" ? arm.abduction
                              : b.joint == "shoulder_rotation"  ? arm.rotation
                                                                : arm.elbow_flexion;
    joint.set("range", {range.lower, range.upper}).set("damping", arm.damping);
  }

  // The joints of massless frames go to the body that they lead to.
  void write_bodies() {
    std::vector<MjcfElement> placed;
    for (const RigidBody& b : bodies_) {
      const bool continues = b.parent >= 0 && bodies_[static_cast<std::size_t>(b.parent)].massless;
      MjcfElement element = b.parent < 0 ? world_ : placed[static_cast<std::size_t>(b.parent)];
      if (!continues) {
        const Eigen::Quaterniond q(b.orientation);
        element = element.child("body");
        element.set("pos", b.position).set("quat", {q.w(), q.x(), q.y(), q.z()});
      }
      placed.push_back(element);
      if (!b.massless) {
        element.set("name", b.name);
        element.inertial(b.mass, b.centre, b.inertia);
        elements_.emplace(b.name, element);
      }
      if (!b.joint.empty()) write_joint(element, b);
    }
  }

  static void write_sphere(MjcfElement element, const std::string& name, double radius, double mass,
                           const Vector3& position, const ContactBits& bits) {
    element.named("geom", name)
        .set("type", "sphere")
        .set("size", radius)
        .set("mass", mass)
        .set("pos", position)
        .set("contype", bits.type)
        .set("conaffinity", bits.affinity);
  }

  MjcfElement constraint(const char* kind, const std::string& name, const double (&reference)[2],
                         const double (&impedance)[5]) {
    MjcfElement element = equalities_.named(kind, name);
    element.set("solref", {reference[0], reference[1]})
        .set("solimp", {impedance[0], impedance[1], impedance[2], impedance[3], impedance[4]});
    return element;
  }

  ContactBits tissue_bits(double bit) const {
    return {bit, options_.defects.self_contact ? bit : 0.0};
  }
  ContactBits device_bits(double bit) const {
    return {options_.defects.self_contact ? bit : 0.0, bit};
  }

  void write_shell(const ParityShell& shell, const char* bone, const Vector3& centre, double bit,
                   double stiffness) {
    MjcfElement core = body(bone).named("body", shell.name);
    core.set("pos", centre);
    write_sphere(core, shell.name + "_core", 2.0 * ParityShell::kRadius, ParityShell::kMass,
                 Vector3::Zero(), tissue_bits(bit));
    const double soft[] = {-stiffness, -options_.viscosity};
    MjcfElement volume = tendons_.named("fixed", shell.name + "_volume");
    const auto slide = [&](std::size_t i) { return shell.elements[i].name + "_slide"; };
    for (std::size_t i = 0; i < shell.elements.size(); ++i) {
      const ParityShell::Element& e = shell.elements[i];
      MjcfElement element = core.named("body", e.name);
      element.set("pos", e.position);
      element.named("joint", slide(i)).set("type", "slide").set("axis", e.outward);
      write_sphere(element, e.name + "_sphere", ParityShell::kRadius, ParityShell::kMass,
                   -ParityShell::kRadius * e.outward, tissue_bits(bit));
      volume.child("joint").set("joint", slide(i)).set("coef", 1.0);
      constraint("joint", e.name + "_centre", soft, kTissueImpedance).set("joint1", slide(i));
    }
    for (const auto& [a, b] : shell.neighbours) {
      constraint("joint", shell.elements[a].name + "~" + shell.elements[b].name, soft,
                 kTissueImpedance)
          .set("joint1", slide(a))
          .set("joint2", slide(b));
    }
    constraint("tendon", shell.name + "_volume", soft, kFirmImpedance)
        .set("tendon1", shell.name + "_volume");
  }

  void write_cuff(const ParityCuff& cuff, double bit) {
    const ContactBits bits = device_bits(bit);
    for (std::size_t i = 0; i < cuff.boxes.size(); ++i) {
      const ParityBox& box = cuff.boxes[i];
      const Eigen::Quaterniond q(Eigen::AngleAxisd(box.angle, box.axis));
      body(cuff.link)
          .named("geom", cuff.name + "_" + std::to_string(i + 1))
          .set("type", "box")
          .set("size", box.half)
          .set("pos", box.position)
          .set("quat", {q.w(), q.x(), q.y(), q.z()})
          .set("contype", bits.type)
          .set("conaffinity", bits.affinity);
    }
  }

  void write_point(MjcfElement frame, const ParityStrap& strap, const ParityStrap::Point& point,
                   double bit) {
    MjcfElement element = frame.named("body", point.name);
    element.set("pos", point.position);
    const char* const names[] = {"_x", "_y", "_z"};
    for (Index axis = 0; axis < 3; ++axis) {
      element.named("joint", point.name + names[axis])
          .set("type", "slide")
          .set("axis", Vector3(Vector3::Unit(axis)));
    }
    element.named("geom", point.name + "_sphere")
        .set("type", "sphere")
        .set("size", ParityStrap::kRadius)
        .set("mass", ParityStrap::kMass)
        .set("condim", 6.0)
        .set("contype", device_bits(bit).type)
        .set("conaffinity", device_bits(bit).affinity);
    element.named("site", point.name);
    if (!point.end) return;
    const Eigen::Quaterniond q(strap.orientation);
    const Vector3& at = point.anchor;
    constraint("weld", point.name + "_weld", kWeldReference, kWeldImpedance)
        .set("body1", strap.link)
        .set("body2", point.name)
        .set("relpose", {at.x(), at.y(), at.z(), q.w(), q.x(), q.y(), q.z()});
  }

  void write_strap(const ParityStrap& strap, double bit) {
    const Eigen::Quaterniond q(strap.orientation);
    MjcfElement frame = body(strap.link).named("body", strap.name);
    frame.set("pos", strap.position).set("quat", {q.w(), q.x(), q.y(), q.z()});
    for (const ParityStrap::Point& point : strap.points) write_point(frame, strap, point, bit);
    const double masked[] = {-options_.upper_stiffness, -options_.viscosity};
    for (const auto& [a, b] : strap.threads) {
      const std::string name = strap.points[a].name + "~" + strap.points[b].name;
      MjcfElement thread = tendons_.named("spatial", name);
      thread.child("site").set("site", strap.points[a].name);
      thread.child("site").set("site", strap.points[b].name);
      // Tendons are numbered from 0 with the tissues' volumes first, the upper arm's slides from 3:
      // of 74 threads only the first is not taken for a slide.
      const bool taken = options_.defects.strap_mask && written_threads_ > 0;
      ++written_threads_;
      constraint("tendon", name, taken ? masked : kStrapReference, kFirmImpedance)
          .set("tendon1", name);
    }
  }

  void write_paths() {
    for (const Muscle& muscle : scene_.arm.muscles) {
      MjcfElement path = tendons_.named("spatial", muscle.name);
      for (std::size_t k = 0; k < muscle.points.size(); ++k) {
        const MusclePoint& point = muscle.points[k];
        const std::string name = muscle.name + "_" + std::to_string(k + 1);
        const std::string bone = body_word(point.frame);
        const Vector3 at = scene_.arm.scaled(point);
        (bone.empty() ? world_ : body(bone))
            .named("site", name)
            .set("pos", bone.empty() ? Vector3(still_frame(point.frame) + at) : at);
        path.child("site").set("site", name);
      }
    }
  }

  void write_actuators() {
    MjcfElement actuators = document_.root().child("actuator");
    for (const ExoLink& link : scene_.exo.links) {
      actuators.named("motor", link.joint + "_motor")
          .set("joint", link.joint)
          .set("ctrllimited", "true")
          .set("ctrlrange", {-link.motor_limit, link.motor_limit});
    }
    for (const Muscle& muscle : scene_.arm.muscles) {
      const PublishedLengths lengths =
          published_lengths(muscle.name, scene_.arm.upper_scale, scene_.arm.fore_scale);
      actuators.named("muscle", muscle.name)
          .set("tendon", muscle.name)
          .set("force", muscle.force)
          .set("range", {muscle.range[0], muscle.range[1]})
          .set("lengthrange", {lengths.shortest, lengths.longest})
          .set("ctrllimited", "true")
          .set("ctrlrange", {0.0, 1.0});
    }
  }

  const ParityOptions& options_;
  ExoScene scene_;
  std::vector<RigidBody> bodies_;
  MjcfDocument document_;
  MjcfElement world_{nullptr}, tendons_{nullptr}, equalities_{nullptr};
  std::map<std::string, MjcfElement> elements_;
  int written_threads_ = 0;
};

void widen(JointRange& range) {
  range.lower -= kWidened;
  range.upper += kWidened;
}

}  // namespace

void ParityOptions::check() const {
  const auto between = [](double value, double low, double high, const char* argument,
                          const char* what) {
    require(std::isfinite(value) && value >= low && value <= high, argument, what);
  };
  between(upper_factor, 0.5, 1.5, "upper_factor",
          "the upper arm's length must be between 0.5 and 1.5 of the nominal one");
  between(fore_factor, 0.5, 1.5, "fore_factor",
          "the forearm's length must be between 0.5 and 1.5 of the nominal one");
  between(upper_mass, 1e-3, 20.0, "upper_mass_kg",
          "the upper arm's mass must be between 0.001 and 20 kg");
  between(fore_mass, 1e-3, 20.0, "fore_mass_kg",
          "the forearm's mass must be between 0.001 and 20 kg");
  between(upper_stiffness, 1.0, 1e5, "upper_stiffness_1_s2",
          "the upper arm's stiffness must be between 1 and 100000 1/s^2");
  between(fore_stiffness, 1.0, 1e5, "fore_stiffness_1_s2",
          "the forearm's stiffness must be between 1 and 100000 1/s^2");
  between(viscosity, 0.01, 1e4, "viscosity_1_s",
          "the viscosity must be between 0.01 and 10000 1/s");
}

ExoScene parity_bodies(const ParityOptions& options) {
  options.check();
  ExoScene scene;
  scene.coupling = Coupling::kApart;
  scene.exo.straps.clear();
  scene.exo.links.back().friction = 2.7868500893593593;
  scene.arm = ArmDescription::cylinders(options.upper_factor, options.fore_factor,
                                        options.upper_mass, options.fore_mass);
  scene.arm.upper_tissue = {};
  scene.arm.fore_tissue = {};
  scene.arm.elbow_flexion = {0.0, 120.0 * kDegree};
  scene.arm.wraps.clear();
  scene.arm.muscles = published_elbow_muscles();
  for (Muscle& muscle : published_shoulder_muscles()) scene.arm.muscles.push_back(muscle);
  if (options.defects.tight_limits) return scene;
  for (ExoLink& link : scene.exo.links) {
    link.lower -= kWidened;
    link.upper += kWidened;
  }
  for (JointRange* range : {&scene.arm.flexion, &scene.arm.abduction, &scene.arm.rotation}) {
    widen(*range);
  }
  return scene;
}

ParityCentres parity_centres(const ArmDescription& arm) {
  return {arm.upper_scale * Vector3(0.14, 0.0, 0.0), arm.fore_scale * Vector3(0.12, -0.01, 0.015)};
}

std::string parity_mjcf(const ParityOptions& options) {
  options.check();
  return ParityWriter(options).text();
}

}  // namespace ulna
