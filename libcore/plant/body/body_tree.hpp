// A body of rigid links on hinges whose first link is free in space: the description that the
// whole-body algorithms and estimators work on. A link is a RigidBody of the fixed-base tree with
// what a human model adds: limits of the hinge and a shape to look at.
//
// Joint k belongs to the link that it carries, so that link i and its joint share an index; link 0
// is the base and has none. The degrees of freedom are the hinges in the order of their links.
#pragma once

#include <string>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

enum class LinkShapeKind { kNone, kBox, kCylinder, kSphere };

// What a link looks like; with uniform density it also gives the inertia.
struct LinkShape {
  LinkShapeKind kind = LinkShapeKind::kNone;
  Vector3 size = Vector3::Zero();  // box: edges x y z; cylinder: radius, length; sphere: radius; m
  Vector3 centre = Vector3::Zero();  // link axes, m
  Vector3 axis = Vector3::UnitZ();   // of a cylinder, link axes, length 1
};

struct BodyLink : RigidBody {
  double lower = -kInfinity;  // rad, as `reference`
  double upper = kInfinity;
  LinkShape shape = {};
};

class BodyTree {
 public:
  // The first link's parent is -1, and its position, orientation and joint say nothing: it is free.
  // A later link without a joint is fixed to its parent. Throws Error (kArgument) that names the
  // link for what RigidTree refuses, for a second link without a parent, for limits that are no
  // range, and for a body without mass.
  explicit BodyTree(std::vector<BodyLink> links, double gravity = 9.81);

  const std::vector<BodyLink>& links() const noexcept { return links_; }
  const BodyLink& link(Index i) const { return links_[static_cast<std::size_t>(i)]; }
  Index size() const noexcept { return static_cast<Index>(links_.size()); }
  Index dofs() const noexcept { return static_cast<Index>(hinges_.size()); }
  double gravity() const noexcept { return gravity_; }  // m/s^2, along -z of the world
  double mass() const noexcept { return mass_; }        // kg

  Index parent(Index link) const { return links_[static_cast<std::size_t>(link)].parent; }
  // Degree of freedom of a link's joint, -1 for a fixed link and for the base.
  Index dof(Index link) const { return dof_[static_cast<std::size_t>(link)]; }
  Index link_of_dof(Index dof) const { return hinges_[static_cast<std::size_t>(dof)]; }
  // True if a force on `link` is felt at the joint of `ancestor`: it is the link or carries it.
  bool carries(Index ancestor, Index link) const;

  std::vector<std::string> link_names() const;
  std::vector<std::string> joint_names() const;
  Index find_link(const std::string& name) const;   // -1 where there is none
  Index find_joint(const std::string& name) const;  // the link that it carries; -1
  Index at_link(const std::string& name) const;     // throws Error (kArgument), with near names
  Index at_joint(const std::string& name) const;    // the link that it carries; likewise
  Matrix limits() const;                            // dofs x 2, rad

 private:
  std::vector<BodyLink> links_;
  double gravity_;
  double mass_ = 0.0;
  std::vector<Index> dof_;     // of each link
  std::vector<Index> hinges_;  // link of each degree of freedom
};

// Something rigid that a link wears or holds: a drill, the frame of a device.
struct Attachment {
  std::string name;                   // for errors
  std::string link;                   // that carries it
  double mass = 0.0;                  // kg, positive
  Vector3 centre = Vector3::Zero();   // of its mass, link axes, m
  Matrix3 inertia = Matrix3::Zero();  // about its centre, link axes, kg m^2; zero: a point
};

// The body with the masses of attachments added to their links. Throws Error (kArgument) naming the
// attachment: unknown links, masses that are not positive, inertias that no body has.
BodyTree with_attachments(const BodyTree& body, const std::vector<Attachment>& attachments);

// The same body told from another base link: torques and wrenches stay what they are. Joints on the
// way between the two bases turn about the same axes, each carrying the other of its links; their
// positive sense and the sign of their torque stay. Links on that way get new frames, at the joint
// that now carries them. Throws Error (kArgument) for an unknown link.
BodyTree rebased(const BodyTree& body, const std::string& base);

}  // namespace ulna
