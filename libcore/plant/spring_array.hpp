// Linear extension springs between a handle and points of a rigid frame: the mass-spring rig of
// Dyck 2013, appendix D, whose stiffness is known in closed form.
//
// Positions are in the plane of the rig, m; forces are those of the springs on the handle (what a
// force sensor between robot and handle would call the force of the human), N.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "base/types.hpp"

namespace ulna {

using Vector2 = Eigen::Vector2d;
using Matrix2 = Eigen::Matrix2d;

// One spring: it pulls with rate (length - rest) towards its anchor, and hangs slack when shorter
// than its rest length (an extension spring does not push).
struct Spring {
  Vector2 anchor = Vector2::Zero();  // m
  double rate = 0.0;                 // N/m
  double rest = 0.0;                 // relaxed length, m
};

// Where the handle comes to rest, and what it feels around that place.
struct SpringEquilibrium {
  Vector2 position = Vector2::Zero();     // m
  Matrix2 stiffness = Matrix2::Zero();    // -dF/dR there, N/m; symmetric
  Vector2 eigenvalues = Vector2::Zero();  // of the stiffness, ascending
  std::vector<bool> slack;                // springs that hang slack there
  // Largest displacement in any direction that leaves every taut spring taut: min (length - rest).
  double slack_radius = 0.0;
  double residual_n = 0.0;  // |F| there: rounding
  int iterations = 0;
};

// How far the law F = -K (R - R0) holds.
struct Linearity {
  double radius = 0.0;       // m
  double deviation_n = 0.0;  // largest |F(R0 + d) + K d| over |d| <= radius
  double share = 0.0;        // largest |F(R0 + d) + K d| / |K d| over |d| <= radius
  bool slack = false;        // a spring that is taut at rest goes slack within the radius
};

class SpringArray {
 public:
  static constexpr Index kMost = 8;
  static constexpr double kHalfX = 0.175;  // half sides of the frame of the thesis, m
  static constexpr double kHalfY = 0.183;

  // At most kMost springs with finite anchors, positive rates and rest lengths above zero; throws
  // Error (kArgument) naming the spring, counted from 1.
  explicit SpringArray(std::vector<Spring> springs);

  // Corners and mid-sides of a 2 half_x by 2 half_y frame around `centre` in the order k1 ... k8 of
  // the thesis: (-x,-y) (-x,0) (-x,+y) (0,+y) (+x,+y) (+x,0) (+x,-y) (0,-y).
  static std::array<Vector2, 8> frame_anchors(double half_x = kHalfX, double half_y = kHalfY,
                                              const Vector2& centre = Vector2::Zero());

  // Eight places on the frame; a rate of zero leaves a place empty.
  static SpringArray on_frame(const std::vector<double>& rates, const std::vector<double>& rests,
                              const Vector2& centre = Vector2::Zero(), double half_x = kHalfX,
                              double half_y = kHalfY);

  const std::vector<Spring>& springs() const noexcept { return springs_; }

  // (D.1), without the push of a slack spring. F(R) = -sum k (|R - Ri| - l) (R - Ri)/|R - Ri|.
  Vector2 force(const Vector2& position) const noexcept;

  // -dF/dR: sum over taut springs of k [(1 - l/L)(I - u u') + u u'].
  Matrix2 stiffness(const Vector2& position) const noexcept;

  // Stored energy, sum k (L - l)^2 / 2 over taut springs, J. Convex: L is convex and the square of
  // what exceeds l grows, so that an equilibrium with a positive definite stiffness is the only
  // one.
  double energy(const Vector2& position) const noexcept;

  // Newton's method on the convex energy with Armijo's guard. Throws Error (kAnalysis) when the
  // springs do not hold the handle: no equilibrium of positive definite stiffness.
  SpringEquilibrium equilibrium() const;

  // The same without an exception: false when the springs do not hold the handle.
  bool find_equilibrium(SpringEquilibrium& out) const;

  // The worst displacement of at most `radius` by a polar search refined along the angle.
  Linearity linearity(const SpringEquilibrium& at, double radius) const;

  // Largest radius within which the share of linearity() stays at or below `share`, up to `most`.
  double linear_radius(const SpringEquilibrium& at, double share, double most = 0.1) const;

 private:
  std::vector<Spring> springs_;
};

}  // namespace ulna
