#include "plant/exo_scene.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.hpp"
#include "base/words.hpp"
#include "plant/engine/mjcf.hpp"

namespace ulna {
namespace {

// What the engine knows of a joint beside its place.
struct JointDetail {
  JointRange range;
  double damping;
  double friction;
};

using JointDetails = std::map<std::string, JointDetail>;

JointDetails joints_of(const ArmDescription& arm) {
  JointDetails joints;
  const auto add = [&](const char* name, JointRange range) {
    joints[name] = {range, arm.damping, 0.0};
  };
  add("shoulder_flexion", arm.flexion);
  add("shoulder_abduction", arm.abduction);
  add("shoulder_rotation", arm.rotation);
  add("elbow_flexion", arm.elbow_flexion);
  add("forearm_pronation", {-85 * kDegree, 85 * kDegree});
  add("wrist_flexion", {-70 * kDegree, 70 * kDegree});
  add("wrist_abduction", {-20 * kDegree, 20 * kDegree});
  return joints;
}

JointDetails joints_of(const ExoScene& scene) {
  JointDetails joints;
  if (scene.has_arm()) joints = joints_of(scene.arm);
  if (!scene.has_exo()) return joints;
  for (const ExoLink& link : scene.exo.links) {
    joints[link.joint] = {{link.lower, link.upper}, link.damping, link.friction};
  }
  return joints;
}

// Also those that the arm has not in this coupling: they mean something else in a log.
void check_joint_names(const ExoScene& scene) {
  const JointDetails arm = joints_of(scene.arm);
  for (const ExoLink& link : scene.exo.links) {
    const std::string& name = link.joint;
    require(arm.count(name) == 0, "joint",
            "joint '" + name + "' of the device has the name of a joint of the arm: call it 'exo_" +
                name + "'");
  }
}

Index index_of(const std::vector<RigidBody>& bodies, const std::string& name) {
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].name == name) return static_cast<Index>(i);
  }
  throw Error(Fault::kArgument, "link", "the arm's link '" + name + "' is not there");
}

// The arm in its modelling pose inside the links in theirs: the shoulder at the world's origin, the
// elbow where the forearm's link has its joint.
ArmMount mount_on(const ExoScene& scene, const std::vector<RigidBody>& device) {
  const RigidTree tree(device);
  const std::vector<RigidTree::Pose> pose = tree.poses(tree.reference());
  ArmMount mount{.fixed = true};
  mount.upper_parent = index_of(device, scene.exo.upper_link);
  mount.fore_parent = index_of(device, scene.exo.fore_link);
  const RigidTree::Pose& upper = pose[static_cast<std::size_t>(mount.upper_parent)];
  const RigidTree::Pose& fore = pose[static_cast<std::size_t>(mount.fore_parent)];
  const Matrix3 back = upper.orientation.transpose();
  mount.upper = {Vector3(-(back * upper.position)), back};
  mount.fore.orientation = fore.orientation.transpose();
  return mount;
}

constexpr double kElbowMisfit = 0.06;  // m

// Held rigidly, an arm of any length is stretched onto the device's joint. Further off than its
// length explains, the joint is not at an elbow.
void check_elbow(const ExoScene& scene) {
  const std::vector<RigidBody> device = bodies_of(scene.exo);
  const RigidTree tree(device);
  const Index fore = index_of(device, scene.exo.fore_link);
  const Vector3 joint = tree.poses(tree.reference())[static_cast<std::size_t>(fore)].position;
  const ArmDescription& arm = scene.arm;
  const auto [shorter, longer] =
      std::minmax({arm.upper_scale, ArmDescription::cylinders().upper_scale});
  const double scale = std::clamp(arm.elbow.dot(joint) / arm.elbow.squaredNorm(), shorter, longer);
  const double away = (joint - scale * arm.elbow).norm();
  require(away <= kElbowMisfit, "position",
          sentence(3, "joint '", device[static_cast<std::size_t>(fore)].joint,
                   "' of the device is ", 1e3 * away,
                   " mm from the elbow of an arm that points forward from the shoulder "
                   "in the reference; it must be within ",
                   1e3 * kElbowMisfit,
                   " mm: correct the positions of the links or give the arm's length"));
}

void set_orientation(MjcfElement& element, const Matrix3& orientation) {
  const Eigen::Quaterniond q(orientation);
  element.set("quat", {q.w(), q.x(), q.y(), q.z()});
}

class Writer {
 public:
  explicit Writer(const ExoScene& scene)
      : scene_(scene),
        bodies_(bodies_of(scene)),
        joints_(joints_of(scene)),
        document_(scene.exo.name) {}

  std::string text() {
    write_head();
    write_bodies();
    if (scene_.has_arm()) write_paths();
    write_actuators();
    return document_.text();
  }

 private:
  void write_head() {
    const SolverOptions& s = scene_.solver;
    MjcfElement root = document_.root();
    root.child("compiler").set("angle", "radian");
    root.child("option")
        .set("timestep", s.timestep)
        .set("solver", "Newton")
        .set("iterations", s.iterations)
        .set("tolerance", s.tolerance)
        .set("impratio", s.impratio)
        .set("cone", s.elliptic ? "elliptic" : "pyramidal")
        .set("gravity", s.gravity);
  }

  void write_joint(MjcfElement body, const RigidBody& b) {
    const JointDetail& detail = joints_.at(b.joint);
    body.named("joint", b.joint)
        .set("type", "hinge")
        .set("axis", b.axis)
        .set("limited", "true")
        .set("range", {detail.range.lower, detail.range.upper})
        .set("ref", b.reference)
        .set("damping", detail.damping)
        .set("frictionloss", detail.friction);
  }

  // Children hold their parents' elements; the joints of massless frames go to the body that they
  // lead to.
  void write_bodies() {
    MjcfElement world = document_.root().child("worldbody");
    elements_.assign(bodies_.size(), world);
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const RigidBody& b = bodies_[i];
      const bool in_world = b.parent < 0;
      const bool continues = !in_world && bodies_[static_cast<std::size_t>(b.parent)].massless;
      MjcfElement element = in_world ? world : elements_[static_cast<std::size_t>(b.parent)];
      if (!continues) {
        element = element.child("body");
        element.set("pos", b.position);
        set_orientation(element, b.orientation);
      }
      elements_[i] = element;
      if (!b.massless) write_mass(element, b);
      if (!b.joint.empty()) write_joint(element, b);
    }
    for (const Muscle& muscle : muscles()) {
      for (std::size_t k = 0; k < muscle.points.size(); ++k) write_point(world, muscle, k);
    }
    if (scene_.has_arm()) {
      for (const WrapCylinder& wrap : scene_.arm.wraps) write_wrap(wrap);
    }
  }

  static void write_mass(MjcfElement element, const RigidBody& b) {
    element.set("name", b.name);
    element.inertial(b.mass, b.centre, b.inertia);
  }

  static std::string point_name(const Muscle& muscle, std::size_t k) {
    return muscle.name + "_" + std::to_string(k + 1);
  }

  MjcfElement element_of(const std::string& body) {
    return elements_[static_cast<std::size_t>(index_of(bodies_, body))];
  }

  void write_point(MjcfElement world, const Muscle& muscle, std::size_t k) {
    const MusclePoint& point = muscle.points[k];
    const std::string body = body_word(point.frame);
    const Vector3 at = scene_.arm.scaled(point);
    const Vector3 placed = body.empty() ? Vector3(still_frame(point.frame) + at) : at;
    (body.empty() ? world : element_of(body))
        .named("site", point_name(muscle, k))
        .set("pos", placed);
  }

  // Along y through the elbow, fixed to the humerus, and a site outside that names the side.
  void write_wrap(const WrapCylinder& wrap) {
    const bool rigid = scene_.coupling == Coupling::kRigid;
    const Vector3 elbow =
        rigid ? rigid_elbow() : Vector3(scene_.arm.upper_scale * scene_.arm.elbow);
    MjcfElement humerus = element_of("humerus");
    humerus.named("geom", wrap.name)
        .set("type", "cylinder")
        .set("pos", elbow)
        .set("zaxis", {0.0, 1.0, 0.0})
        .set("size", {wrap.radius, 0.03})
        .set("contype", 0.0)
        .set("conaffinity", 0.0);
    humerus.named("site", wrap.name + "_side")
        .set("pos", Vector3(elbow + 3.0 * wrap.radius * wrap.side.normalized()));
  }

  // Where the forearm's joint is, in the humerus' frame, on the device in its reference.
  Vector3 rigid_elbow() const {
    const RigidTree tree(bodies_);
    const auto pose = tree.poses(tree.reference());
    const auto& humerus = pose[static_cast<std::size_t>(index_of(bodies_, "humerus"))];
    const auto& ulna = pose[static_cast<std::size_t>(index_of(bodies_, "ulna"))];
    return humerus.orientation.transpose() * (ulna.position - humerus.position);
  }

  const std::vector<Muscle>& muscles() const {
    static const std::vector<Muscle> none;
    return scene_.has_arm() ? scene_.arm.muscles : none;
  }

  void write_paths() {
    if (muscles().empty()) return;
    MjcfElement tendons = document_.root().child("tendon");
    for (const Muscle& muscle : muscles()) {
      MjcfElement path = tendons.named("spatial", muscle.name);
      for (std::size_t k = 0; k < muscle.points.size(); ++k) {
        if (k + 1 == muscle.points.size() && !muscle.wrap.empty()) {
          path.child("geom").set("geom", muscle.wrap).set("sidesite", muscle.wrap + "_side");
        }
        path.child("site").set("site", point_name(muscle, k));
      }
    }
  }

  void write_actuators() {
    MjcfElement actuators = document_.root().child("actuator");
    for (std::size_t i = 0; scene_.has_exo() && i < scene_.exo.links.size(); ++i) {
      const ExoLink& link = scene_.exo.links[i];
      if (link.motor_limit == 0.0) continue;
      actuators.named("motor", link.joint + "_motor")
          .set("joint", link.joint)
          .set("ctrllimited", "true")
          .set("ctrlrange", {-link.motor_limit, link.motor_limit});
    }
    for (const Muscle& muscle : muscles()) {
      actuators.named("muscle", muscle.name)
          .set("tendon", muscle.name)
          .set("force", muscle.force)
          .set("range", {muscle.range[0], muscle.range[1]})
          .set("lengthrange", {0.1, 0.2})
          .set("ctrllimited", "true")
          .set("ctrlrange", {0.0, 1.0});
    }
  }

  const ExoScene& scene_;
  std::vector<RigidBody> bodies_;
  std::map<std::string, JointDetail> joints_;
  MjcfDocument document_;
  std::vector<MjcfElement> elements_;
};

}  // namespace

void ExoScene::check() const {
  if (has_exo()) exo.check();
  if (has_arm()) arm.check();
  if (has_exo() && has_arm()) check_joint_names(*this);
  require(std::isfinite(solver.timestep) && solver.timestep > 0.0 && solver.timestep <= 0.1,
          "timestep_s", "the time step must be between 0 and 0.1 s");
  require(solver.iterations >= 1 && solver.iterations <= 10000, "iterations",
          "the solver must have between 1 and 10000 iterations");
  require(std::isfinite(solver.tolerance) && solver.tolerance >= 0.0, "tolerance",
          "the solver's tolerance must be 0 or more");
  require(std::isfinite(solver.impratio) && solver.impratio > 0.0, "impratio",
          "impratio must be positive");
  require(solver.gravity.allFinite(), "gravity", "gravity must be finite");
  if (coupling != Coupling::kRigid) return;
  require(!exo.upper_link.empty() && !exo.fore_link.empty(), "link",
          "an arm that is held needs the links of the upper arm and the forearm");
}

std::vector<RigidBody> bodies_of(const ExoScene& scene) {
  scene.check();
  std::vector<RigidBody> bodies;
  if (scene.has_exo()) bodies = bodies_of(scene.exo);
  if (!scene.has_arm()) return bodies;
  const bool rigid = scene.coupling == Coupling::kRigid;
  append_arm(scene.arm, rigid ? mount_on(scene, bodies) : ArmMount{}, bodies);
  return bodies;
}

std::string mjcf_of(const ExoScene& scene) {
  Writer writer(scene);
  if (scene.coupling == Coupling::kRigid) check_elbow(scene);
  return writer.text();
}

}  // namespace ulna
