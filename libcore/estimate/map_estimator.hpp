// The maximum a posteriori estimate with dynamics that are uncertain themselves: the full problem
// of Latella et al. 2021, (5)-(8), with
//
//     Sigma^-1 = D' Sigma_D^-1 D + Sigma_d^-1 + Y' Sigma_y^-1 Y.
//
// Its pattern is the tree of the body, so that one block factorisation from the leaves to the base
// has no fill: each joint is a separator of 12 numbers, the acceleration of the parent and the
// wrench through the joint. The factor is kept as "information about the acceleration, and the
// wrench given the acceleration", which stays well-conditioned when Sigma_D goes to zero, where the
// result is TorqueEstimator's.
//
// update() allocates nothing, takes no lock and cannot fail; see TorqueEstimator.
#pragma once

#include "estimate/body_evidence.hpp"

namespace ulna {

// Standard deviations of what D d + b_D = 0 leaves out, on every link and over every joint.
struct ModelDeviation {
  double force = 1e-3;                 // N
  double moment = 1e-3;                // N m
  double linear_acceleration = 1e-3;   // m/s^2
  double angular_acceleration = 1e-3;  // rad/s^2
};

// As TorqueFrame, means only.
struct MapFrame {
  bool usable = false;
  Vector torque;
  Vector joint_acceleration;
  Vector6 base_acceleration = Vector6::Zero();
  Matrix external;      // 6 x links
  Matrix joint_wrench;  // 6 x links
  Matrix acceleration;  // 6 x links, proper, of the link's origin; angular; link axes
};

class MapEstimator {
 public:
  // Throws Error (kArgument) for deviations that are negative or not finite; zero is exact.
  explicit MapEstimator(std::shared_ptr<const SensorSuite> suite, const ModelDeviation& model = {});

  const SensorSuite& suite() const noexcept { return *suite_; }
  const MapFrame& update(const BodyState& state, const VectorRef& y) noexcept;
  const MapFrame& frame() const noexcept { return frame_; }

 private:
  // One link: its subtree as seen from its own acceleration field a and, a prime further, from the
  // parent's.
  struct Block {
    Matrix6 info = Matrix6::Zero();  // about a, of the subtree: information and its vector
    Vector6 rhs = Vector6::Zero();
    Matrix6 slope = Matrix6::Zero();  // wrench through the joint = slope a + offset + noise
    Vector6 offset = Vector6::Zero();
    Matrix6 noise = Matrix6::Zero();  // its covariance
    Matrix6 gain = Matrix6::Zero();   // a = gain (parent's a) + shift + step noise
    Vector6 shift = Vector6::Zero();
    Matrix6 step = Matrix6::Zero();    // its covariance
    Vector6 pull = Vector6::Zero();    // what the rest of the body asks of wrenches here
    Vector6 field = Vector6::Zero();   // estimate of a
    Vector6 wrench = Vector6::Zero();  // through the joint, without a model's error
  };
  // A measured component of a joint's wrench, seen from the parent's field.
  struct Row {
    Vector6 spread = Vector6::Zero();  // noise x direction
    double variance = 1.0;
    Vector6 slope = Vector6::Zero();  // of the component
    double offset = 0.0;              // predicted - measured at a zero field
    double innovation = 0.0;          // at the estimated field
  };

  void upwards();
  void step_to_parent(Index i);
  void measure_joint(Index i, Matrix6& slope, Vector6& offset, Matrix6& noise, Matrix6& info,
                     Vector6& rhs);
  void downwards();

  std::shared_ptr<const SensorSuite> suite_;
  ModelDeviation model_;
  BodyMotion motion_;
  BodyEvidence evidence_;
  std::vector<Block> blocks_;
  std::vector<Row> rows_;
  MapFrame frame_;
};

}  // namespace ulna
