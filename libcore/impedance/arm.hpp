// A planar arm of two links, shoulder and elbow, as a right arm is drawn beside an ellipse:
//
//     hand = shoulder + l1 (cos q1, sin q1) + l2 (cos(q1 + q2), sin(q1 + q2))
//
// q1: upper arm to +x; q2: flexion of the elbow, positive counterclockwise (0: straight).
#pragma once

#include <array>

#include "base/types.hpp"

namespace ulna {

struct TwoLink {
  double upper_m = 0.31;
  double fore_m = 0.34;
  double shoulder_x_m = 0.0;
  double shoulder_y_m = 0.0;
  bool left = false;  // the elbow bends the other way: q2 negative
};

// Throws Error (kArgument) unless both lengths are positive and everything is finite.
void check_arm(const TwoLink& arm);

Eigen::Vector2d hand_of(const TwoLink& arm, const Eigen::Vector2d& q);
Eigen::Matrix2d jacobian_of(const TwoLink& arm, const Eigen::Vector2d& q);
// d J / d q1 and d J / d q2.
std::array<Eigen::Matrix2d, 2> jacobian_slope(const TwoLink& arm, const Eigen::Vector2d& q);
// Throws Error (kAnalysis) for a hand out of reach.
Eigen::Vector2d angles_of(const TwoLink& arm, const Eigen::Vector2d& hand);

// Joint angles from markers at shoulder, elbow and wrist, each rows x 2 (m): rows x 2, unwrapped
// along the rows. Throws Error (kData) with the row for two markers in one place or no number.
Matrix angles_of_markers(MatrixRef shoulder, MatrixRef elbow, MatrixRef wrist);

}  // namespace ulna
