#include "plant/engine/body_links.hpp"

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>

#include "base/error.hpp"

namespace ulna {
namespace {

Vector3 three(const mjtNum* v) { return {v[0], v[1], v[2]}; }

Matrix3 rotation(const mjtNum* q) {
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

struct Hinge {
  std::string name;
  Vector3 axis, anchor;
  double reference, lower, upper;
};

std::string label(const EngineModel& model, Part part, Index i) {
  const std::string name = model.name(part, i);
  return name.empty() ? word(part) + std::to_string(i) : name;
}

// The hinges of a body, in the order in which they turn it.
std::vector<Hinge> hinges_of(const EngineModel& model, int body) {
  const mjModel& m = *model.raw();
  std::vector<Hinge> hinges;
  for (int k = 0; k < m.body_jntnum[body]; ++k) {
    const int j = m.body_jntadr[body] + k;
    const std::string name = label(model, Part::kJoint, j);
    const Vector3 anchor = three(m.jnt_pos + 3 * j);
    if (m.jnt_type[j] == mjJNT_FREE) continue;
    if (m.jnt_type[j] == mjJNT_SLIDE) {
      throw Error(Fault::kFormat, "mjcf",
                  "joint '" + name + "' is a slide; joints of a body are hinges and balls",
                  "joint " + name);
    }
    if (m.jnt_type[j] == mjJNT_BALL) {
      for (int axis = 0; axis < 3; ++axis) {
        hinges.push_back(
            {name + "_rot" + "xyz"[axis], Vector3::Unit(axis), anchor, 0.0, -kInfinity, kInfinity});
      }
      continue;
    }
    const bool limited = m.jnt_limited[j] != 0;
    hinges.push_back({name, three(m.jnt_axis + 3 * j), anchor, m.qpos0[m.jnt_qposadr[j]],
                      limited ? m.jnt_range[2 * j] : -kInfinity,
                      limited ? m.jnt_range[2 * j + 1] : kInfinity});
  }
  return hinges;
}

}  // namespace

BodyTree body_links(const EngineModel& model) {
  const mjModel& m = *model.raw();
  std::vector<BodyLink> links;
  std::vector<Index> place(static_cast<std::size_t>(m.nbody), -1);
  // Where a body's frame is in the frame of its link, which lies at the last anchor.
  std::vector<Vector3> shift(place.size(), Vector3::Zero());
  for (int body = 1; body < m.nbody; ++body) {
    const auto b = static_cast<std::size_t>(body);
    const auto p = static_cast<std::size_t>(m.body_parentid[body]);
    const std::string name = label(model, Part::kBody, body);
    std::vector<Hinge> hinges = hinges_of(model, body);
    if (p == 0 && !links.empty()) {
      throw Error(Fault::kFormat, "mjcf",
                  "bodies '" + links[0].name + "' and '" + name +
                      "' are both on the world; a whole body is one tree");
    }
    if (p == 0 && !hinges.empty()) {  // turns on the world: then the world is the base
      BodyLink world;
      world.name = "world";
      world.massless = true;
      links.push_back(world);
      place[0] = 0;
    }
    const Vector3 position = three(m.body_pos + 3 * body) + shift[p];
    const Matrix3 orientation = rotation(m.body_quat + 4 * body);
    Index before = place[p];
    Vector3 anchor = Vector3::Zero();  // of the link's frame, body axes
    const std::size_t count = std::max<std::size_t>(hinges.size(), 1);
    for (std::size_t k = 0; k < count; ++k) {
      const bool last = k + 1 == count;
      BodyLink link;
      link.name = last ? name : name + "_f" + std::to_string(k + 1);
      link.parent = before;
      link.massless = true;
      const Vector3 next = hinges.empty() ? Vector3(Vector3::Zero()) : hinges[k].anchor;
      if (k == 0) {
        link.position = position + orientation * next;
        link.orientation = orientation;
      } else {
        link.position = next - anchor;
      }
      anchor = next;
      if (!hinges.empty()) {
        link.joint = hinges[k].name;
        link.axis = hinges[k].axis;
        link.reference = hinges[k].reference;
        link.lower = hinges[k].lower;
        link.upper = hinges[k].upper;
      }
      before = static_cast<Index>(links.size());
      links.push_back(std::move(link));
    }
    BodyLink& own = links.back();
    if (own.parent < 0) own.position.setZero();
    const Matrix3 axes = rotation(m.body_iquat + 4 * body);
    own.mass = m.body_mass[body];
    own.centre = three(m.body_ipos + 3 * body) - anchor;
    own.inertia = axes * three(m.body_inertia + 3 * body).asDiagonal() * axes.transpose();
    own.inertia = (0.5 * (own.inertia + own.inertia.transpose())).eval();
    // What the compiler's smallest mass stands for.
    own.massless = own.mass < 1e-9;
    if (own.massless) {
      own.mass = 0.0;
      own.inertia.setZero();
    }
    place[b] = before;
    shift[b] = -anchor;
  }
  if (links.empty()) throw Error(Fault::kFormat, "mjcf", "the scene holds no bodies");
  return BodyTree(std::move(links), -m.opt.gravity[2]);
}

}  // namespace ulna
