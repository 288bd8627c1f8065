// A whole recording through the estimator: frames in chunks over the pool, each chunk with an
// estimator of its own, so that the result has the same bits whatever the number of threads.
#pragma once

#include "base/token.hpp"
#include "estimate/map_estimator.hpp"
#include "estimate/torque_estimator.hpp"

namespace ulna {

// Frames are rows. Empty matrices: the base lies in the world's axes, at its origin, still.
struct BodyRecording {
  Matrix angle;             // frames x dofs, rad
  Matrix rate;              // frames x dofs, rad/s
  Matrix measured;          // frames x rows of the suite; NaN: missing
  Matrix position;          // frames x 3, of the base origin in the world, m
  Matrix orientation;       // frames x 4, unit quaternion w x y z of the base in the world
  Matrix angular_velocity;  // frames x 3, of the base, world axes, rad/s

  Index frames() const { return angle.rows(); }
};

// What to keep beside torques and what is one number a frame.
struct KeepOptions {
  bool deviations = true;  // standard deviations and innovations
  bool wrenches = false;   // external and joint wrenches
  int threads = 0;         // 0: one per processor
};

struct BodyTorques {
  Matrix torque, torque_deviation;  // frames x dofs
  Matrix joint_acceleration;        // frames x dofs
  Matrix residual;                  // frames x 6, see TorqueFrame
  Matrix residual_deviation;        // frames x 6, as predicted
  Vector balance_nis, motion_nis, motion_freedom;
  Matrix innovation, innovation_deviation;  // frames x rows
  // frames x (6 links), link after link; empty unless asked for.
  Matrix external, external_deviation, joint_wrench, joint_wrench_deviation;
  std::vector<char> bridged;  // of each frame: its state was missing and lies between neighbours
  double log_likelihood = 0.0;
  Index unusable = 0;  // frames without a state: longer gaps, or at an end
};

// Throws Error: kArgument for matrices of other sizes than the suite's, kData for a quaternion that
// is no rotation (with its frame), kCancelled.
//
// A state that is not finite is bridged where the gap is at most `longest_gap` frames: angles and
// rates on the line between the neighbours, the hinges' accelerations missing, so that the result
// is as wide as the accelerometers and the prior leave it. Longer gaps give NaN.
BodyTorques estimate_recording(std::shared_ptr<const SensorSuite> suite,
                               const BodyRecording& recording, const TorqueOptions& options = {},
                               const KeepOptions& keep = {}, Index longest_gap = 12,
                               Token* token = nullptr);

// The same with dynamics that are uncertain themselves: torques, accelerations of hinges and, where
// asked for, wrenches; means only.
BodyTorques estimate_uncertain(std::shared_ptr<const SensorSuite> suite,
                               const BodyRecording& recording, const ModelDeviation& model,
                               const KeepOptions& keep = {}, Index longest_gap = 12,
                               Token* token = nullptr);

// State of one frame of a recording, unchecked.
void state_of(const BodyRecording& recording, Index frame, BodyState& state);

// Throws as estimate_recording for what it is given.
void check_recording(const SensorSuite& suite, const BodyRecording& recording);

}  // namespace ulna
