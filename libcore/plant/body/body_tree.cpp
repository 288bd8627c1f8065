#include "plant/body/body_tree.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

std::vector<RigidBody> bodies_of(const std::vector<BodyLink>& links) {
  return {links.begin(), links.end()};
}

void check_links(const std::vector<BodyLink>& links) {
  require(!links.empty(), "links", "a body needs a link");
  require(links[0].parent == -1, "parent",
          "link '" + links[0].name + "' comes first, so it is the base and has no parent");
  require(links[0].joint.empty(), "joint",
          "link '" + links[0].name + "' is the base, which no joint carries");
  for (std::size_t i = 1; i < links.size(); ++i) {
    require(links[i].parent >= 0, "parent",
            "link '" + links[i].name + "' has no parent; only the first link has none");
  }
  // Every other rule is the same as for a tree on the world.
  const RigidTree checked(bodies_of(links));
  for (const BodyLink& link : links) {
    require(!std::isnan(link.lower) && !std::isnan(link.upper) && link.lower <= link.upper,
            "limits", "joint '" + link.joint + "' has limits that are no range");
  }
}

// Names that a person may have meant: those that hold the given one or begin alike.
std::string near_names(const std::vector<std::string>& names, const std::string& wanted) {
  std::vector<std::string> near;
  for (const std::string& name : names) {
    const bool alike = !wanted.empty() && (name.find(wanted) != std::string::npos ||
                                           name.compare(0, 3, wanted, 0, 3) == 0);
    if (alike) near.push_back(name);
  }
  if (near.empty()) near = names;
  if (near.size() > 12) {
    near.resize(12);
    near.push_back("…");
  }
  return join(near);
}

}  // namespace

BodyTree::BodyTree(std::vector<BodyLink> links, double gravity)
    : links_(std::move(links)), gravity_(gravity) {
  check_links(links_);
  require(std::isfinite(gravity) && gravity >= 0.0, "gravity",
          "gravity must be finite and not negative");
  for (Index i = 0; i < size(); ++i) {
    mass_ += link(i).mass;
    dof_.push_back(link(i).joint.empty() ? -1 : static_cast<Index>(hinges_.size()));
    if (!link(i).joint.empty()) hinges_.push_back(i);
  }
  require(mass_ > 0.0, "mass", "the body has no mass");
}

bool BodyTree::carries(Index ancestor, Index link) const {
  while (link > ancestor) link = parent(link);
  return link == ancestor;
}

std::vector<std::string> BodyTree::link_names() const {
  std::vector<std::string> names;
  for (const BodyLink& link : links_) names.push_back(link.name);
  return names;
}

std::vector<std::string> BodyTree::joint_names() const {
  std::vector<std::string> names;
  for (const Index i : hinges_) names.push_back(link(i).joint);
  return names;
}

Index BodyTree::find_link(const std::string& name) const {
  for (Index i = 0; i < size(); ++i) {
    if (link(i).name == name) return i;
  }
  return -1;
}

Index BodyTree::find_joint(const std::string& name) const {
  for (const Index i : hinges_) {
    if (link(i).joint == name) return i;
  }
  return -1;
}

Index BodyTree::at_link(const std::string& name) const {
  const Index i = find_link(name);
  if (i >= 0) return i;
  throw Error(Fault::kArgument, "link",
              "the body has no link '" + name + "'; there are: " + near_names(link_names(), name),
              "link " + name);
}

Index BodyTree::at_joint(const std::string& name) const {
  const Index i = find_joint(name);
  if (i >= 0) return i;
  throw Error(Fault::kArgument, "joint",
              "the body has no joint '" + name + "'; there are: " + near_names(joint_names(), name),
              "joint " + name);
}

Matrix BodyTree::limits() const {
  Matrix range(dofs(), 2);
  for (Index k = 0; k < dofs(); ++k) {
    range(k, 0) = link(link_of_dof(k)).lower;
    range(k, 1) = link(link_of_dof(k)).upper;
  }
  return range;
}

namespace {

// Two rigid parts as one (parallel axes theorem).
void join_mass(RigidBody& body, double mass, const Vector3& centre, const Matrix3& inertia) {
  const double total = body.mass + mass;
  const Vector3 common = (body.mass * body.centre + mass * centre) / total;
  const auto about = [&](double m, const Vector3& c, const Matrix3& own) -> Matrix3 {
    const Vector3 d = c - common;
    return own + m * (d.squaredNorm() * Matrix3::Identity() - d * d.transpose());
  };
  body.inertia = about(body.mass, body.centre, body.inertia) + about(mass, centre, inertia);
  body.mass = total;
  body.centre = common;
  body.massless = false;
}

}  // namespace

BodyTree with_attachments(const BodyTree& body, const std::vector<Attachment>& attachments) {
  std::vector<BodyLink> links = body.links();
  for (const Attachment& part : attachments) {
    const std::string what = "attachment '" + part.name + "' ";
    const Index link = body.find_link(part.link);
    require(link >= 0, "link",
            what + "is for link '" + part.link + "', which the body has not; there are: " +
                near_names(body.link_names(), part.link));
    require(std::isfinite(part.mass) && part.mass > 0.0, "mass",
            what + "must have a positive mass");
    require(part.centre.allFinite() && part.inertia.allFinite(), "attachment",
            what + "holds a number that is not finite");
    if (part.inertia.norm() > 0.0) check_inertia(part.inertia, what);
    BodyLink& carrier = links[static_cast<std::size_t>(link)];
    require(!carrier.massless || part.inertia.norm() > 0.0, "inertia",
            what + "is a point on a massless link, which then has no inertia to turn");
    join_mass(carrier, part.mass, part.centre, part.inertia);
  }
  return BodyTree(std::move(links), body.gravity());
}

namespace {

// The link told in a frame at `position` with `axes`, both in the link's present frame.
void move_frame(BodyLink& link, const Vector3& position, const Matrix3& axes) {
  const Matrix3 turn = axes.transpose();
  link.centre = turn * (link.centre - position);
  link.inertia = turn * link.inertia * axes;
  link.inertia = (0.5 * (link.inertia + link.inertia.transpose())).eval();
  link.shape.centre = turn * (link.shape.centre - position);
  link.shape.axis = turn * link.shape.axis;
}

}  // namespace

BodyTree rebased(const BodyTree& body, const std::string& base) {
  const Index wanted = body.at_link(base);
  std::vector<BodyLink> links = body.links();
  // Each link of the way moves its frame to the joint that will carry it, and hangs on the link
  // that it carried.
  std::vector<Index> parent(links.size());
  for (std::size_t i = 0; i < links.size(); ++i) parent[i] = links[i].parent;
  for (Index i = wanted; body.parent(i) >= 0; i = body.parent(i)) {
    const Index p = body.parent(i);
    const BodyLink& was = body.link(i);
    for (std::size_t c = 0; c < links.size(); ++c) {
      if (body.parent(static_cast<Index>(c)) != p || static_cast<Index>(c) == i) continue;
      links[c].position = was.orientation.transpose() * (links[c].position - was.position);
      links[c].orientation = was.orientation.transpose() * links[c].orientation;
    }
    BodyLink& turned = links[static_cast<std::size_t>(p)];
    move_frame(turned, was.position, was.orientation);
    turned.joint = was.joint;
    turned.axis = -was.axis;
    turned.reference = was.reference;
    turned.lower = was.lower;
    turned.upper = was.upper;
    turned.position = Vector3::Zero();
    turned.orientation = Matrix3::Identity();
    parent[static_cast<std::size_t>(p)] = i;
  }
  // The joint between p and i sits at i's frame, unless i itself moved its frame: then it is where
  // i's old origin is seen from the new frame.
  for (Index i = wanted; body.parent(i) >= 0; i = body.parent(i)) {
    if (i == wanted) continue;
    const Index below = parent[static_cast<std::size_t>(i)];  // i hangs on it now
    const BodyLink& joint = body.link(below);
    BodyLink& turned = links[static_cast<std::size_t>(body.parent(i))];
    turned.position = joint.orientation.transpose() * -joint.position;
    turned.orientation = joint.orientation.transpose();
  }
  BodyLink& first = links[static_cast<std::size_t>(wanted)];
  first.joint.clear();
  parent[static_cast<std::size_t>(wanted)] = -1;

  // Parents first again.
  std::vector<BodyLink> sorted;
  std::vector<Index> place(links.size(), -1);
  while (sorted.size() < links.size()) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      const Index p = parent[i];
      if (place[i] >= 0 || (p >= 0 && place[static_cast<std::size_t>(p)] < 0)) continue;
      place[i] = static_cast<Index>(sorted.size());
      sorted.push_back(links[i]);
      sorted.back().parent = p < 0 ? -1 : place[static_cast<std::size_t>(p)];
    }
  }
  return BodyTree(std::move(sorted), body.gravity());
}

}  // namespace ulna
