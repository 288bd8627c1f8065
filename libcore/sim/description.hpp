// What a simulated experiment is made of: an arm, the human behind it, a robot's controller and
// sensors. Descriptions are immutable while a run uses them and are shared by threads.
//
// Frame: that of the record. Force: by the human on the robot.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "plant/planar_robot.hpp"
#include "plant/spring_array.hpp"

namespace ulna::sim {

// M x'' + B x' + K (x - x0) = -F, (3.2) of Dyck 2013, n = 1 or 2; M need not be symmetric, as
// identified ones are not.
struct Arm {
  Matrix m, b, k;           // n x n: kg, N s/m, N/m
  Vector x0;                // n, m; empty: the centre of the experiment
  double payload_kg = 0.0;  // between force sensor and hand: handle or wrist support
  // A rig in place of the arm: its force is evaluated exactly and k is not used. n = 2.
  std::shared_ptr<const SpringArray> springs;
};

// A force of the human's own, stationary and independent on every axis: white noise through
// w^2 / (s^2 + 2 z w s + w^2). z = 0.7: low-pass; z = 0.05 at 10 Hz: a physiological tremor.
struct Tremor {
  double rms_n = 0.0;
  double natural_hz = 2.0;
  double damping = 0.7;
};

// The voluntary position controller C_h of Fig. 4.2b: from the displacement that was felt or seen
// delay_s ago, through the muscles' lag. It holds the hand at the target.
struct CnsController {
  bool on = false;
  double delay_s = 0.15;        // reaction time; at least one step of the control
  double lag_s = 0.0;           // first-order activation of the muscles
  double stiffness_n_m = 0.0;   // on the displacement
  double damping_n_s_m = 0.0;   // on the velocity
  double integral_n_m_s = 0.0;  // on its integral
  Vector target;                // n, m; empty: the centre
};

// Co-contraction stiffens the arm: at level 1, K and B are multiplied by their factors. Part of it
// may be a reaction: a leaky memory of how fast the hand was moved,
//   r' = (|v(t - delay)| / speed_m_s - r) / memory_s,   r in [0, 1],
// which adds to the level and takes the voluntary controller back by 1 - r: who cannot follow a
// perturbation stiffens instead (section 4.4.1).
struct Cocontraction {
  double level = 0.0;  // 0 to 1
  double stiffness_factor = 1.0;
  double damping_factor = 1.0;
  double speed_m_s = 0.0;  // 0: no reaction
  double memory_s = 1.0;
};

struct Human {
  Tremor tremor;
  CnsController cns;
  Cocontraction cocontraction;
};

enum class ControlMode {
  kPosition,  // F = kp (x_ref - x) + kd (x_ref' - x'), tau = J^T F: relaxed loop, Fig. 4.2a
  kForce,     // tau = J^T F_ref, open loop: rigid loop, Fig. 4.2b
};

struct Controller {
  ControlMode mode = ControlMode::kPosition;
  double kp_n_m = 3000.0;
  double kd_n_s_m = 120.0;
  double rate_hz = 1000.0;     // raised to a multiple of the record's rate
  double delay_s = 0.0;        // from reading to torque, in whole steps of the control
  double force_limit_n = 0.0;  // of the commanded force; 0: none
  int hold_axis = -1;          // force control: this axis (0, 1) is held at the centre by kp, kd
  // Where the robot stands in the frame of the record.
  Vector2 base_m = Vector2::Zero();
  double base_angle_rad = 0.0;
};

struct Sensors {
  double position_resolution_m = 2e-6;  // 0: not quantised
  double position_noise_m = 2e-6;       // rms, white
  double force_resolution_n = 1.0 / 24.0;
  double force_noise_n = 1.0 / 24.0;  // rms, white
  double force_delay_s = 0.0;         // how much later the force channel is
  double acceleration_noise_m_s2 = 0.0;
  double acceleration_resolution_m_s2 = 0.0;
};

// Channels beside x, y, F_x, F_y and the references.
struct Extras {
  bool acceleration = false;  // a_x, a_y: accelerometer at the handle
  bool robot = false;         // q_1, q_2, tau_1, tau_2
  bool truth = false;         // x_true, v_x, F_x_true, F_x_cns, F_x_tremor, ..., cocontraction
};

struct Experiment {
  std::shared_ptr<const PlanarRobot> robot;
  Arm arm;
  Human human;
  Controller controller;
  Sensors sensors;
  Extras extras;
  Matrix reference;         // rows x n: m relative to the centre, or N on the human
  double rate_hz = 1000.0;  // of the reference and the record
  Vector centre;            // n, m
  double settle_s = 2.0;    // held at the first row of the reference before the record starts
  std::vector<std::pair<Index, Index>> segments;  // rows of the perturbations; empty: all
  std::vector<std::string> notes;                 // lines of provenance
  std::string frame;                              // name for the channels

  Index axes() const noexcept { return arm.m.rows(); }
};

// Throws Error, naming the argument, unless the description can be simulated: shapes, finite and
// plausible numbers, a reachable centre, an effective inertia that is positive definite.
void check_experiment(const Experiment& experiment);

// How the parts are described in the provenance.
std::vector<std::string> provenance_of(const Experiment& experiment);

}  // namespace ulna::sim
