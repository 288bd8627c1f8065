// Joint torques of a body from its motion and what touches it: the maximum a posteriori estimate of
// Latella et al. 2021, (5)-(8), with dynamics that hold exactly. Then d has only the base's and the
// hinges' accelerations and the external wrenches as unknowns, and in the common frame of
// BodyMotion everything is a sum along the tree:
//
//   1. leaves to base: the information of the accelerometers about each link's acceleration, one
//      hinge after the other eliminated;
//   2. one 6 x 6 system: the wrenches of inertia less the external wrenches must vanish at the
//      base; what is missing is divided between accelerations and wrenches by their covariances;
//   3. base to leaves: accelerations; leaves to base: torques.
//
// Measured torques and wrenches of joints are further rows of the system of step 2. Standard
// deviations come from the same tree in one pass down and one pass up.
//
// An estimator is the state of one thread. update() allocates nothing, takes no lock and cannot
// fail: what is not finite in the measurements is missing and widens the result; a state that is
// not finite gives a frame that is not usable.
#pragma once

#include "estimate/body_evidence.hpp"

namespace ulna {

enum class TorqueScheme {
  kOneShot,  // all measurements at once
  kStack,    // published: task 1 finds the external wrenches from the rate of the momentum, task 2
             // takes them as measured and finds the rest
};

struct TorqueOptions {
  TorqueScheme scheme = TorqueScheme::kOneShot;
  // Task 1 of the stack trusts the rate of change of the momentum from the accelerations this far,
  // (10) with its angular part.
  double momentum_rate_force = 1.0;   // N
  double momentum_rate_moment = 1.0;  // N m
};

// Result of one frame. Link axes unless stated; wrenches are force (N) and moment about the link's
// origin (N m), one column a link; what joint k exerts is the parent's wrench on link k.
struct TorqueFrame {
  bool usable = false;        // false: the state was not finite; all numbers are then NaN
  Vector torque;              // of each hinge, N m
  Vector joint_acceleration;  // rad/s^2
  Vector6 base_acceleration;  // proper, of the base link's origin; angular; world axes
  Matrix external;            // 6 x links, net wrench from outside
  Matrix joint_wrench;        // 6 x links; the base's column is what is missing: zero
  // What the measured wrenches lack at the base link's origin for the measured motion, world axes;
  // its covariance; their squared normalised innovation, chi^2 with 6 + rows of joint sensors.
  Vector6 residual;
  Matrix6 residual_covariance;
  double balance_nis = 0.0;
  Index balance_rows = 0;
  // Squared normalised innovation of the accelerations among themselves, before the balance. Its
  // mean is motion_freedom: rows that were there less what they determined.
  double motion_nis = 0.0;
  Index motion_rows = 0;
  double log_likelihood = 0.0;  // of the motion's rows and the balance

  // Only when asked for.
  double motion_freedom = 0.0;
  Vector torque_deviation;
  Vector joint_acceleration_deviation;
  Matrix external_deviation;
  Matrix joint_wrench_deviation;
  // Of each row of y: measured - estimated (NaN where missing), and the deviation that the noise
  // gives it. A row that nothing else can check has the deviation 0.
  Vector innovation;
  Vector innovation_deviation;
};

class TorqueEstimator {
 public:
  explicit TorqueEstimator(std::shared_ptr<const SensorSuite> suite,
                           const TorqueOptions& options = {});
  ~TorqueEstimator();
  TorqueEstimator(TorqueEstimator&&) noexcept;
  TorqueEstimator& operator=(TorqueEstimator&&) noexcept;

  const SensorSuite& suite() const noexcept { return *suite_; }
  const BodyMotion& motion() const noexcept { return motion_; }

  // One frame. y: one number a row of the suite, NaN where missing. With `deviations` also the
  // standard deviations and innovations. The result is valid until the next call. Sizes must be
  // those of the body and the suite (unchecked: check_state and the callers do).
  const TorqueFrame& update(const BodyState& state, const VectorRef& y, bool deviations) noexcept;
  const TorqueFrame& frame() const noexcept { return frame_; }

 private:
  struct Node;

  void eliminate();
  void collect_wrenches();
  template <int kRows>
  void balance();
  template <int kRows>
  void spread(const VectorRef& y);
  void first_task();
  void resolve();
  void write_result();
  void write_likelihood();
  void write_missing() noexcept;
  void write_innovations(const VectorRef& y);
  void innovations_of_motion(const VectorRef& y, Index link);
  Vector6 pull(Index link) const;  // what the balance asks of a wrench on a link

  std::shared_ptr<const SensorSuite> suite_;
  TorqueOptions options_;
  BodyMotion motion_;
  BodyEvidence evidence_;
  TorqueFrame frame_;
  std::vector<Node> nodes_;
  Index rows_ = 6;     // of the balance, with the joint sensors'
  Matrix columns_;     // 6 x (rows * links): H, response of each link's wrench to the rows
  Matrix responses_;   // likewise: covariance of the link's acceleration with the rows
  Matrix sums_;        // likewise: covariance of the wrench through the link with the rows
  Matrix hinge_rows_;  // rows x links: g
  Matrix system_;      // rows x rows: S, then its Cholesky factor
  Vector missing_;     // r
  Vector pull_;        // S^-1 r
  Matrix6 root_;       // Cholesky factor of the base's information
  Matrix6 first_ = Matrix6::Identity();   // of task 1
  Vector6 first_pull_ = Vector6::Zero();  // of task 1
  std::vector<char> has_field_sensor_;    // of each link
};

}  // namespace ulna
