#include <tinyxml2.h>

#include <Eigen/Geometry>
#include <charconv>
#include <cmath>
#include <map>

#include "base/error.hpp"
#include "plant/body/body_file.hpp"

namespace ulna {
namespace {

using tinyxml2::XMLDocument;
using tinyxml2::XMLElement;

// Numbers that give themselves back exactly, whatever the locale.
std::string urdf_numbers(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) {
    char digits[32];
    const auto [end, failure] = std::to_chars(digits, digits + sizeof digits, value);
    static_cast<void>(failure);  // 32 characters hold every double
    if (!text.empty()) text += ' ';
    text.append(digits, end);
  }
  return text;
}

void urdf_set(XMLElement* element, const char* name, std::initializer_list<double> values) {
  element->SetAttribute(name, urdf_numbers(values).c_str());
}

// Fixed-axis roll, pitch, yaw.
Vector3 roll_pitch_yaw(const Matrix3& r) {
  const double pitch = std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0)));
  if (std::hypot(r(0, 0), r(1, 0)) < 1e-12) {  // roll and yaw turn about one axis
    return {0.0, pitch, std::atan2(-r(0, 1), r(1, 1))};
  }
  return {std::atan2(r(2, 1), r(2, 2)), pitch, std::atan2(r(1, 0), r(0, 0))};
}

void urdf_origin(XMLElement* parent, const Vector3& position, const Matrix3& orientation) {
  XMLElement* origin = parent->InsertNewChildElement("origin");
  const Vector3 rpy = roll_pitch_yaw(orientation);
  urdf_set(origin, "xyz", {position.x(), position.y(), position.z()});
  urdf_set(origin, "rpy", {rpy.x(), rpy.y(), rpy.z()});
}

void urdf_shape(XMLElement* link, const LinkShape& shape) {
  if (shape.kind == LinkShapeKind::kNone) return;
  XMLElement* visual = link->InsertNewChildElement("visual");
  const Matrix3 axes =
      Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), shape.axis).toRotationMatrix();
  urdf_origin(visual, shape.centre, axes);
  XMLElement* geometry = visual->InsertNewChildElement("geometry");
  const Vector3& s = shape.size;
  if (shape.kind == LinkShapeKind::kBox) {
    urdf_set(geometry->InsertNewChildElement("box"), "size", {s.x(), s.y(), s.z()});
  } else if (shape.kind == LinkShapeKind::kSphere) {
    urdf_set(geometry->InsertNewChildElement("sphere"), "radius", {s.x()});
  } else {
    XMLElement* cylinder = geometry->InsertNewChildElement("cylinder");
    urdf_set(cylinder, "radius", {s.x()});
    urdf_set(cylinder, "length", {s.y()});
  }
}

void urdf_link(XMLElement* robot, const BodyLink& link) {
  XMLElement* element = robot->InsertNewChildElement("link");
  element->SetAttribute("name", link.name.c_str());
  if (!link.massless) {
    XMLElement* inertial = element->InsertNewChildElement("inertial");
    urdf_origin(inertial, link.centre, Matrix3::Identity());
    urdf_set(inertial->InsertNewChildElement("mass"), "value", {link.mass});
    XMLElement* inertia = inertial->InsertNewChildElement("inertia");
    const Matrix3& m = link.inertia;
    urdf_set(inertia, "ixx", {m(0, 0)});
    urdf_set(inertia, "ixy", {m(0, 1)});
    urdf_set(inertia, "ixz", {m(0, 2)});
    urdf_set(inertia, "iyy", {m(1, 1)});
    urdf_set(inertia, "iyz", {m(1, 2)});
    urdf_set(inertia, "izz", {m(2, 2)});
  }
  urdf_shape(element, link.shape);
}

void urdf_joint(XMLElement* robot, const BodyTree& body, const BodyLink& link) {
  XMLElement* joint = robot->InsertNewChildElement("joint");
  const bool fixed = link.joint.empty();
  const bool limited = std::isfinite(link.lower) && std::isfinite(link.upper);
  joint->SetAttribute("name", fixed ? (link.name + "_fixed").c_str() : link.joint.c_str());
  joint->SetAttribute("type", fixed ? "fixed" : limited ? "revolute" : "continuous");
  joint->InsertNewChildElement("parent")->SetAttribute("link", body.link(link.parent).name.c_str());
  joint->InsertNewChildElement("child")->SetAttribute("link", link.name.c_str());
  // URDF's angle is zero in the pose that is written.
  const Matrix3 back = Eigen::AngleAxisd(-link.reference, link.axis).toRotationMatrix();
  urdf_origin(joint, link.position, fixed ? link.orientation : Matrix3(link.orientation * back));
  if (fixed) return;
  urdf_set(joint->InsertNewChildElement("axis"), "xyz",
           {link.axis.x(), link.axis.y(), link.axis.z()});
  if (!limited) return;
  XMLElement* limit = joint->InsertNewChildElement("limit");
  urdf_set(limit, "lower", {link.lower});
  urdf_set(limit, "upper", {link.upper});
  urdf_set(limit, "effort", {1e4});  // required by the format; no limit is known
  urdf_set(limit, "velocity", {1e3});
}

}  // namespace

std::string to_urdf(const BodyTree& body, const std::string& name) {
  XMLDocument document;
  document.InsertEndChild(document.NewDeclaration());
  XMLElement* robot = document.NewElement("robot");
  robot->SetAttribute("name", name.c_str());
  document.InsertEndChild(robot);
  XMLElement* compiler = robot->InsertNewChildElement("mujoco")->InsertNewChildElement("compiler");
  compiler->SetAttribute("boundmass", "1e-12");
  compiler->SetAttribute("boundinertia", "1e-14");
  compiler->SetAttribute("fusestatic", "false");
  for (const BodyLink& link : body.links()) urdf_link(robot, link);
  for (Index i = 1; i < body.size(); ++i) urdf_joint(robot, body, body.link(i));
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  return printer.CStr();
}

// Reading -----------------------------------------------------------------------------------------

namespace {

[[noreturn]] void urdf_fail(const std::string& message, const std::string& where = {}) {
  throw Error(Fault::kFormat, "urdf", message, where);
}

std::string urdf_text(const XMLElement* element, const char* name, const std::string& what) {
  const char* text = element == nullptr ? nullptr : element->Attribute(name);
  if (text == nullptr) urdf_fail(what + " has no " + name, what);
  return text;
}

template <int kCount>
Eigen::Matrix<double, kCount, 1> urdf_values(const XMLElement* element, const char* name,
                                             const std::string& what) {
  const std::string text = urdf_text(element, name, what);
  Eigen::Matrix<double, kCount, 1> values;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  for (int k = 0; k < kCount; ++k) {
    while (at < end && (blank(*at) || *at == '+')) ++at;
    const auto [next, failure] = std::from_chars(at, end, values[k]);
    if (failure != std::errc() || !std::isfinite(values[k])) {
      urdf_fail(what + " has " + name + "=\"" + text + "\", which is not " +
                    std::to_string(kCount) + (kCount == 1 ? " number" : " numbers"),
                what);
    }
    at = next;
  }
  while (at < end && blank(*at)) ++at;
  if (at != end) {
    urdf_fail(what + " has " + name + "=\"" + text + "\" with more than " + std::to_string(kCount) +
                  (kCount == 1 ? " number" : " numbers"),
              what);
  }
  return values;
}

double urdf_value(const XMLElement* element, const char* name, const std::string& what) {
  return urdf_values<1>(element, name, what)[0];
}

// The pose in <origin>; none is the identity.
void read_origin(const XMLElement* parent, const std::string& what, Vector3& position,
                 Matrix3& orientation) {
  position.setZero();
  orientation.setIdentity();
  const XMLElement* origin = parent->FirstChildElement("origin");
  if (origin == nullptr) return;
  if (origin->Attribute("xyz") != nullptr) position = urdf_values<3>(origin, "xyz", what);
  if (origin->Attribute("rpy") == nullptr) return;
  const Vector3 rpy = urdf_values<3>(origin, "rpy", what);
  orientation =
      (Eigen::AngleAxisd(rpy.z(), Vector3::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vector3::UnitY()) *
       Eigen::AngleAxisd(rpy.x(), Vector3::UnitX()))
          .toRotationMatrix();
}

LinkShape read_shape(const XMLElement* element, const std::string& what) {
  LinkShape shape;
  const XMLElement* visual = element->FirstChildElement("visual");
  const XMLElement* geometry = visual == nullptr ? nullptr : visual->FirstChildElement("geometry");
  if (geometry == nullptr) return shape;
  Matrix3 axes;
  read_origin(visual, what, shape.centre, axes);
  shape.axis = axes.col(2);
  if (const XMLElement* box = geometry->FirstChildElement("box")) {
    shape.kind = LinkShapeKind::kBox;
    shape.size = urdf_values<3>(box, "size", what);
  } else if (const XMLElement* sphere = geometry->FirstChildElement("sphere")) {
    shape.kind = LinkShapeKind::kSphere;
    shape.size.x() = urdf_value(sphere, "radius", what);
  } else if (const XMLElement* cylinder = geometry->FirstChildElement("cylinder")) {
    shape.kind = LinkShapeKind::kCylinder;
    shape.size.x() = urdf_value(cylinder, "radius", what);
    shape.size.y() = urdf_value(cylinder, "length", what);
  }
  return shape;  // a mesh is none
}

BodyLink read_link(const XMLElement* element) {
  BodyLink link;
  link.name = urdf_text(element, "name", "a <link>");
  const std::string what = "link '" + link.name + "'";
  link.shape = read_shape(element, what);
  link.massless = true;
  const XMLElement* inertial = element->FirstChildElement("inertial");
  if (inertial == nullptr) return link;
  Matrix3 axes;
  read_origin(inertial, what, link.centre, axes);
  link.mass = urdf_value(inertial->FirstChildElement("mass"), "value", what + " in <mass>");
  const XMLElement* inertia = inertial->FirstChildElement("inertia");
  const auto entry = [&](const char* name) {
    return urdf_value(inertia, name, what + " in <inertia>");
  };
  Matrix3 m;
  m << entry("ixx"), entry("ixy"), entry("ixz"), entry("ixy"), entry("iyy"), entry("iyz"),
      entry("ixz"), entry("iyz"), entry("izz");
  link.inertia = axes * m * axes.transpose();
  link.inertia = (0.5 * (link.inertia + link.inertia.transpose())).eval();
  link.massless = link.mass == 0.0 && m.isZero(0.0);
  return link;
}

struct UrdfJoint {
  BodyLink carried;  // what the joint says of its child
  std::string parent, child;
};

UrdfJoint read_joint(const XMLElement* element) {
  UrdfJoint joint;
  joint.carried.joint = urdf_text(element, "name", "a <joint>");
  const std::string what = "joint '" + joint.carried.joint + "'";
  const std::string type = urdf_text(element, "type", what);
  joint.parent = urdf_text(element->FirstChildElement("parent"), "link", what + " in <parent>");
  joint.child = urdf_text(element->FirstChildElement("child"), "link", what + " in <child>");
  read_origin(element, what, joint.carried.position, joint.carried.orientation);
  if (type == "fixed") {
    joint.carried.joint.clear();
    return joint;
  }
  if (type != "revolute" && type != "continuous") {
    urdf_fail(
        what + " is of type '" + type + "'; joints of a body are revolute, continuous or fixed",
        what);
  }
  const XMLElement* axis = element->FirstChildElement("axis");
  const Vector3 given = axis == nullptr ? Vector3::UnitX() : urdf_values<3>(axis, "xyz", what);
  if (given.norm() < 1e-9) urdf_fail(what + " has an axis of no length", what);
  joint.carried.axis = given.normalized();
  const XMLElement* limit = element->FirstChildElement("limit");
  if (type == "continuous" || limit == nullptr) return joint;
  if (limit->Attribute("lower") != nullptr) {
    joint.carried.lower = urdf_value(limit, "lower", what);
  }
  if (limit->Attribute("upper") != nullptr) {
    joint.carried.upper = urdf_value(limit, "upper", what);
  }
  return joint;
}

}  // namespace

BodyTree from_urdf(const std::string& text) {
  XMLDocument document;
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    urdf_fail("the text is no XML: " + std::string(document.ErrorStr()));
  }
  const XMLElement* robot = document.FirstChildElement("robot");
  if (robot == nullptr) urdf_fail("the text is no URDF: it has no <robot>");

  std::vector<BodyLink> links;
  std::map<std::string, std::size_t> place;
  for (const XMLElement* e = robot->FirstChildElement("link"); e != nullptr;
       e = e->NextSiblingElement("link")) {
    links.push_back(read_link(e));
    if (!place.emplace(links.back().name, links.size() - 1).second) {
      urdf_fail("two links have the name '" + links.back().name + "'");
    }
  }
  if (links.empty()) urdf_fail("the robot has no links");
  const auto at = [&](const std::string& name, const std::string& joint) {
    const auto found = place.find(name);
    if (found == place.end()) {
      urdf_fail("joint '" + joint + "' names link '" + name + "', which is not there");
    }
    return found->second;
  };
  std::vector<Index> parent(links.size(), -1);
  for (const XMLElement* e = robot->FirstChildElement("joint"); e != nullptr;
       e = e->NextSiblingElement("joint")) {
    const UrdfJoint joint = read_joint(e);
    const std::string name = e->Attribute("name");
    const std::size_t child = at(joint.child, name);
    if (parent[child] >= 0) urdf_fail("link '" + joint.child + "' is carried by two joints");
    parent[child] = static_cast<Index>(at(joint.parent, name));
    BodyLink& link = links[child];
    link.joint = joint.carried.joint;
    link.position = joint.carried.position;
    link.orientation = joint.carried.orientation;
    link.axis = joint.carried.axis;
    link.lower = joint.carried.lower;
    link.upper = joint.carried.upper;
  }

  // Parents first, otherwise in the order of the file.
  std::vector<BodyLink> sorted;
  std::vector<Index> new_place(links.size(), -1);
  bool moved = true;
  while (moved) {
    moved = false;
    for (std::size_t i = 0; i < links.size(); ++i) {
      const Index p = parent[i];
      if (new_place[i] >= 0 || (p >= 0 && new_place[static_cast<std::size_t>(p)] < 0)) continue;
      if (p < 0 && !sorted.empty()) {
        urdf_fail("links '" + sorted[0].name + "' and '" + links[i].name +
                  "' are both carried by no joint; a body is one tree");
      }
      links[i].parent = p < 0 ? -1 : new_place[static_cast<std::size_t>(p)];
      new_place[i] = static_cast<Index>(sorted.size());
      sorted.push_back(links[i]);
      moved = true;
    }
  }
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (new_place[i] < 0) {
      urdf_fail("link '" + links[i].name + "' hangs in a ring of joints; a body is a tree");
    }
  }
  return BodyTree(std::move(sorted));
}

}  // namespace ulna
