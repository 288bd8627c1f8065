
#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <sstream>

#include "base/error.hpp"
#include "plant/body/body_file.hpp"
#include "plant/engine/body_links.hpp"
#include "plant/engine/mjcf.hpp"

namespace ulna {
namespace {

// A massless link whose one child turns about the same point: both are joints of one body.
bool merges(const BodyTree& body, Index link) {
  if (!body.link(link).massless || link == 0) return false;
  Index child = -1;
  for (Index i = link + 1; i < body.size(); ++i) {
    if (body.parent(i) != link) continue;
    if (child >= 0) return false;
    child = i;
  }
  return child >= 0 && body.link(child).position.isZero(0.0) &&
         body.link(child).orientation.isIdentity(0.0) && !body.link(child).joint.empty();
}

void mjcf_shape(MjcfElement element, const LinkShape& shape) {
  if (shape.kind == LinkShapeKind::kNone) return;
  MjcfElement geom = element.child("geom");
  geom.set("pos", shape.centre).set("contype", "0").set("conaffinity", "0").set("mass", "0");
  if (shape.kind == LinkShapeKind::kBox) {
    geom.set("type", "box").set("size", Vector3(0.5 * shape.size));
  } else if (shape.kind == LinkShapeKind::kSphere) {
    geom.set("type", "sphere").set("size", shape.size.x());
  } else {
    geom.set("type", "cylinder").set("size", {shape.size.x(), 0.5 * shape.size.y()});
    geom.set("zaxis", shape.axis);
  }
}

void mjcf_joint(MjcfElement element, const BodyLink& link) {
  if (link.joint.empty()) return;
  MjcfElement joint = element.named("joint", link.joint);
  joint.set("type", "hinge").set("axis", link.axis).set("ref", link.reference);
  if (!std::isfinite(link.lower) || !std::isfinite(link.upper)) return;
  joint.set("limited", "true").set("range", {link.lower, link.upper});
}

void mjcf_link(MjcfElement parent, const BodyTree& body, Index link, bool free_base) {
  // The last link of those that merge has the name and the mass.
  std::vector<Index> together = {link};
  while (merges(body, together.back())) {
    for (Index i = together.back() + 1; i < body.size(); ++i) {
      if (body.parent(i) == together.back()) {
        together.push_back(i);
        break;
      }
    }
  }
  const BodyLink& first = body.link(link);
  const BodyLink& last = body.link(together.back());
  const Eigen::Quaterniond q(first.orientation);
  MjcfElement element = parent.named("body", last.name);
  element.set("pos", link == 0 ? Vector3(Vector3::Zero()) : first.position);
  if (link > 0) element.set("quat", {q.w(), q.x(), q.y(), q.z()});
  if (link == 0 && free_base) element.child("freejoint");
  for (const Index i : together) mjcf_joint(element, body.link(i));
  if (!last.massless) element.inertial(last.mass, last.centre, last.inertia);
  mjcf_shape(element, last.shape);
  for (Index i = together.back() + 1; i < body.size(); ++i) {
    if (body.parent(i) == together.back()) mjcf_link(element, body, i, free_base);
  }
}

}  // namespace

std::string to_mjcf(const BodyTree& body, const std::string& name, bool free_base) {
  MjcfDocument document(name);
  document.root()
      .child("compiler")
      .set("angle", "radian")
      .set("boundmass", 1e-12)
      .set("boundinertia", 1e-14);
  document.root().child("option").set("gravity", {0.0, 0.0, -body.gravity()});
  mjcf_link(document.root().child("worldbody"), body, 0, free_base);
  return document.text();
}

BodyTree from_mjcf(const std::string& text) { return body_links(EngineModel::from_text(text)); }

namespace {

// Which of the two formats begins first; URDF may hold an element for the engine inside.
bool is_mjcf(const std::string& text) { return text.find("<mujoco") < text.find("<robot"); }

}  // namespace

BodyTree body_from_text(const std::string& text) {
  if (is_mjcf(text)) return from_mjcf(text);
  if (text.find("<robot") == std::string::npos) {
    throw Error(Fault::kFormat, "text", "the text is neither URDF (<robot>) nor MJCF (<mujoco>)");
  }
  return from_urdf(text);
}

BodyTree read_body(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  if (!file || !(content << file.rdbuf())) {
    throw Error(Fault::kFile, "path", "there is no file " + path + " that can be read");
  }
  const std::string text = content.str();
  // MJCF may include files beside it, which the engine finds by the path.
  if (is_mjcf(text)) return body_links(EngineModel::from_file(path));
  if (text.find("<robot") == std::string::npos) {
    throw Error(Fault::kFormat, "path", path + " is neither URDF (<robot>) nor MJCF (<mujoco>)");
  }
  return from_urdf(text);
}

}  // namespace ulna
