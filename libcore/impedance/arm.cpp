#include "impedance/arm.hpp"

#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {

void check_arm(const TwoLink& arm) {
  require(std::isfinite(arm.upper_m) && arm.upper_m > 0.0, "upper_arm_m",
          "the length of the upper arm must be positive");
  require(std::isfinite(arm.fore_m) && arm.fore_m > 0.0, "forearm_m",
          "the length of the forearm must be positive");
  require(std::isfinite(arm.shoulder_x_m) && std::isfinite(arm.shoulder_y_m), "shoulder_m",
          "the place of the shoulder must be two numbers");
}

Eigen::Vector2d hand_of(const TwoLink& arm, const Eigen::Vector2d& q) {
  const double sum = q[0] + q[1];
  return {arm.shoulder_x_m + arm.upper_m * std::cos(q[0]) + arm.fore_m * std::cos(sum),
          arm.shoulder_y_m + arm.upper_m * std::sin(q[0]) + arm.fore_m * std::sin(sum)};
}

Eigen::Matrix2d jacobian_of(const TwoLink& arm, const Eigen::Vector2d& q) {
  const double sum = q[0] + q[1];
  const double fx = -arm.fore_m * std::sin(sum);
  const double fy = arm.fore_m * std::cos(sum);
  Eigen::Matrix2d j;
  j << -arm.upper_m * std::sin(q[0]) + fx, fx, arm.upper_m * std::cos(q[0]) + fy, fy;
  return j;
}

std::array<Eigen::Matrix2d, 2> jacobian_slope(const TwoLink& arm, const Eigen::Vector2d& q) {
  const double sum = q[0] + q[1];
  const double fx = -arm.fore_m * std::cos(sum);
  const double fy = -arm.fore_m * std::sin(sum);
  std::array<Eigen::Matrix2d, 2> out;
  out[0] << -arm.upper_m * std::cos(q[0]) + fx, fx, -arm.upper_m * std::sin(q[0]) + fy, fy;
  out[1] << fx, fx, fy, fy;
  return out;
}

Eigen::Vector2d angles_of(const TwoLink& arm, const Eigen::Vector2d& hand) {
  const double x = hand[0] - arm.shoulder_x_m;
  const double y = hand[1] - arm.shoulder_y_m;
  const double square = x * x + y * y;
  const double cosine = (square - arm.upper_m * arm.upper_m - arm.fore_m * arm.fore_m) /
                        (2.0 * arm.upper_m * arm.fore_m);
  if (!(std::abs(cosine) <= 1.0)) {
    throw Error(Fault::kAnalysis, "arm",
                sentence(4, "the hand is ", std::sqrt(square),
                         " m from the shoulder, out of reach of an arm of ", arm.upper_m, " and ",
                         arm.fore_m, " m: check shoulder_m and the lengths"));
  }
  const double sine = (arm.left ? -1.0 : 1.0) * std::sqrt(1.0 - cosine * cosine);
  const double elbow = std::atan2(sine, cosine);
  const double shoulder =
      std::atan2(y, x) - std::atan2(arm.fore_m * sine, arm.upper_m + arm.fore_m * cosine);
  return {std::remainder(shoulder, 2.0 * kPi), elbow};
}

Matrix angles_of_markers(MatrixRef shoulder, MatrixRef elbow, MatrixRef wrist) {
  require(shoulder.cols() == 2 && elbow.cols() == 2 && wrist.cols() == 2, "markers",
          "markers of a planar arm have two columns, x and y");
  require(shoulder.rows() == elbow.rows() && wrist.rows() == elbow.rows(), "markers",
          "shoulder, elbow and wrist must have as many rows as each other");
  Matrix out(shoulder.rows(), 2);
  double before[2] = {0.0, 0.0};
  for (Index i = 0; i < out.rows(); ++i) {
    const double ux = elbow(i, 0) - shoulder(i, 0);
    const double uy = elbow(i, 1) - shoulder(i, 1);
    const double fx = wrist(i, 0) - elbow(i, 0);
    const double fy = wrist(i, 1) - elbow(i, 1);
    const double upper = std::hypot(ux, uy);
    const double fore = std::hypot(fx, fy);
    const std::string row = "row " + std::to_string(i);
    if (!std::isfinite(upper) || !std::isfinite(fore)) {
      throw Error(Fault::kData, "markers",
                  "a marker has no number at " + row + ": repair the gap first", row);
    }
    if (upper == 0.0 || fore == 0.0) {
      throw Error(Fault::kData, "markers",
                  std::string(upper == 0.0 ? "shoulder and elbow" : "elbow and wrist") +
                      " markers are in one place at " + row + ": were they swapped?",
                  row);
    }
    double angle[2] = {std::atan2(uy, ux), std::atan2(ux * fy - uy * fx, ux * fx + uy * fy)};
    for (Index k = 0; k < 2; ++k) {
      if (i > 0) angle[k] = before[k] + std::remainder(angle[k] - before[k], 2.0 * kPi);
      before[k] = angle[k];
      out(i, k) = angle[k];
    }
  }
  return out;
}

}  // namespace ulna
