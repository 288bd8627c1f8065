#include "plant/exo_description.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

Matrix3 about_x(double angle) {
  // The published turns are quarter turns: exact, so that no joint is off its axis by rounding.
  const double s = angle > 0.0 ? 1.0 : -1.0;
  Matrix3 turn;
  turn << 1.0, 0.0, 0.0, 0.0, 0.0, -s, 0.0, s, 0.0;
  return turn;
}

Matrix3 base_orientation() {
  Matrix3 columns;
  columns.col(0) = Vector3(0.0, 0.0, 1.0);
  columns.col(1) = Vector3(0.0, -1.0, 0.0);
  columns.col(2) = columns.col(0).cross(columns.col(1));
  return columns;
}

void check_link(const ExoLink& link, std::size_t index) {
  require(!link.name.empty(), "name", "link " + std::to_string(index + 1) + " has no name");
  const std::string what = "link '" + link.name + "' ";
  require(!link.joint.empty(), "joint", what + "has no joint");
  const std::string joint = "joint '" + link.joint + "' ";
  require(std::isfinite(link.lower) && std::isfinite(link.upper) && link.lower < link.upper,
          "range", joint + "must have a range of two finite angles, the lower first");
  require(link.reference >= link.lower - kPi && link.reference <= link.upper + kPi, "reference",
          joint + "has its reference more than half a turn beyond its range");
  require(std::isfinite(link.damping) && link.damping >= 0.0, "damping",
          joint + "must have a damping of 0 or more");
  require(std::isfinite(link.friction) && link.friction >= 0.0, "friction",
          joint + "must have a friction of 0 or more");
  require(std::isfinite(link.motor_limit) && link.motor_limit >= 0.0, "motor",
          joint + "must have a motor limit of 0 or more");
}

std::size_t link_index(const ExoDescription& exo, const std::string& name, const std::string& who) {
  for (std::size_t i = 0; i < exo.links.size(); ++i) {
    if (exo.links[i].name == name) return i;
  }
  throw Error(Fault::kArgument, "link", who + " is on link '" + name + "', which is not there");
}

void check_strap(const ExoStrap& strap, const ExoDescription& exo) {
  const std::string what = "strap '" + strap.name + "'";
  link_index(exo, strap.link, what);
  require(strap.along >= 2 && strap.across >= 1 && strap.along <= 100 && strap.across <= 100,
          "strap", what + " must have between 2 and 100 points along and 1 and 100 across");
  require(std::isfinite(strap.pitch) && strap.pitch > 0.0, "strap",
          what + " must have a positive pitch");
  require(std::isfinite(strap.radius) && strap.radius > 0.0, "strap",
          what + " must have a positive radius");
  require(std::isfinite(strap.mass) && strap.mass > 0.0, "strap",
          what + " must have a positive mass");
}

// Equal spheres in a rectangle.
RigidBody body_of(const ExoStrap& strap, Index parent) {
  const auto spread = [&strap](int count) {  // mean square of the distances from the middle
    return strap.pitch * strap.pitch * (count * count - 1.0) / 12.0;
  };
  RigidBody body{.name = strap.name, .parent = parent};
  body.position = strap.centre;
  body.orientation = strap.orientation;
  body.mass = strap.mass;
  const double u = spread(strap.along);
  const double v = spread(strap.across);
  const double own = 0.4 * strap.radius * strap.radius;
  body.inertia = strap.mass * Vector3(v + own, u + own, u + v + own).asDiagonal();
  return body;
}

}  // namespace

Matrix3 inertia_matrix(const double (&m)[6]) {
  Matrix3 inertia;
  inertia << m[0], m[3], m[4], m[3], m[1], m[5], m[4], m[5], m[2];
  return inertia;
}

ExoDescription ExoDescription::published() {
  const double quarter = 90.0;
  ExoDescription exo;
  exo.links = {{.name = "Link1",
                .orientation = base_orientation(),
                .joint = "J1",
                .lower = -90 * kDegree,
                .upper = 0.0,
                .mass = 6.712,
                .centre = {0, 0.0191, -0.1279},
                .inertia = {0.3787893, 0.192833, 0.1956839, -0.0006556, -0.0006709, 0.0540633},
                .damping = 1.0,
                .motor_limit = 60.0},
               {.name = "Link2",
                .orientation = about_x(quarter),
                .joint = "J2",
                .lower = -90 * kDegree,
                .upper = 0.0,
                .reference = -90 * kDegree,
                .mass = 3.487,
                .centre = {0.0001, 0.0881, -0.1201},
                .inertia = {0.1108677, 0.0689688, 0.0569634, -0.0000977, 0.0000399, 0.0384741},
                .damping = 1.0,
                .motor_limit = 60.0},
               {.name = "Link3",
                .position = {0, 0.25, 0},
                .orientation = about_x(-quarter),
                .joint = "J3",
                .lower = -86 * kDegree,
                .upper = 30 * kDegree,
                .mass = 1.663,
                .centre = {-0.0006, 0.1679, -0.03},
                .inertia = {0.0266938, 0.007941, 0.0235228, 0.0001282, -0.0000556, 0.0038772},
                .damping = 1.0,
                .motor_limit = 60.0},
               {.name = "Link4",
                .orientation = about_x(quarter),
                .joint = "J4",
                .axis = {0, 0, -1},
                .lower = 0.0,
                .upper = 125 * kDegree,
                .mass = 0.494,
                .centre = {0, 0.0707, -0.0803},
                .inertia = {0.0069974, 0.0035498, 0.0037622, -0.0000009, -0.0000004, 0.001812},
                .damping = 1.0,
                .friction = 2.787,
                .motor_limit = 60.0}};
  exo.straps = {{.name = "upper_strap",
                 .link = "Link3",
                 .centre = {0, -0.05, -0.133},
                 .orientation = about_x(quarter)},
                {.name = "fore_strap", .link = "Link4", .centre = {0, 0.12, 0.02}}};
  exo.upper_link = "Link3";
  exo.fore_link = "Link4";
  return exo;
}

void ExoDescription::use_published_straps() {
  for (ExoStrap& strap : straps) {
    strap.mass = 1.2;
    strap.centre += strap.orientation * Vector3(-0.0075, -0.0075, 0.0);
  }
}

void ExoDescription::check() const {
  require(!links.empty(), "links", "the exoskeleton has no links");
  for (std::size_t i = 0; i < links.size(); ++i) check_link(links[i], i);
  for (const ExoStrap& strap : straps) check_strap(strap, *this);
  if (!upper_link.empty()) link_index(*this, upper_link, "the upper arm");
  if (!fore_link.empty()) link_index(*this, fore_link, "the forearm");
  const RigidTree tree(bodies_of(*this));  // masses, inertias, axes, names
}

std::vector<RigidBody> bodies_of(const ExoDescription& exo) {
  std::vector<RigidBody> bodies;
  for (const ExoLink& link : exo.links) {
    bodies.push_back({.name = link.name,
                      .parent = static_cast<Index>(bodies.size()) - 1,
                      .position = link.position,
                      .orientation = link.orientation,
                      .joint = link.joint,
                      .axis = link.axis,
                      .reference = link.reference,
                      .mass = link.mass,
                      .centre = link.centre,
                      .inertia = inertia_matrix(link.inertia)});
  }
  for (const ExoStrap& strap : exo.straps) {
    const std::size_t parent = link_index(exo, strap.link, "strap '" + strap.name + "'");
    bodies.push_back(body_of(strap, static_cast<Index>(parent)));
  }
  return bodies;
}

}  // namespace ulna
