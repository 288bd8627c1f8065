// Passive mobilisation of an arm by an exoskeleton, as a simulated experiment: settle, contract,
// drive to the start, move, log (20.2; Tesfazgi 2023, section 2.3). Any MobilisedPlant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "plant/mobilised.hpp"
#include "record/record.hpp"
#include "sim/excitation_model.hpp"
#include "sim/reference_motion.hpp"

namespace ulna::sim {

enum class TorqueUpdate { kEveryStep, kHeld, kImplicitDamping };

// tau = kp e + ki int e dt + kd e', clipped to the motors' limits.
struct MobilisationControl {
  double kp = 50.0;  // N m/rad
  double ki = 25.0;  // N m/(rad s)
  double kd = 15.0;  // N m s/rad
  TorqueUpdate mode = TorqueUpdate::kImplicitDamping;
  double hold_s = 0.01;           // of a torque, where it is held
  double reference_hold_s = 0.0;  // of the movement's reference; 0: none beside the torque's
  // The nominal model's weight is added to the torque.
  bool weight = false;
};

struct MovedJoint {
  std::string name;  // of the device
  double end = 0.0;  // rad
};

struct Protocol {
  std::vector<MovedJoint> moved;  // empty: the last joint of the device, to 0 degrees
  Vector start;                   // rad, device joints; empty: the reference, last joint at 110 deg
  // Donned: the run begins at the start with the arm as donned and the motors on. Otherwise it
  // begins in the plant's reference with the motors off: the published way, in which the arm falls.
  bool donned = true;
  double settle_s = 0.5;
  double start_limit_s = 25.0;         // to reach the start
  double start_angle = 1.0 * kDegree;  // how near it must be, rad
  double start_rate = 0.25 * kDegree;  // and how slow, rad/s
  double approach_s = 0.0;             // minimum jerk to the start; 0: the start at once
  MobilisationControl control;
  ReferenceMotion motion;
  ExcitationModel excitation;
  double log_rate_hz = 100.0;
  double rate_limit = 10.0;              // rad/s of a device joint in the movement; above: diverged
  double follow_limit = 20.0 * kDegree;  // between a joint and its reference; above: diverged
  double limit_margin = 0.0;             // rad beyond the range of a moved joint: limit
  double time_limit_s = 0.0;             // of computing, 0: none
  // In the movement only a moved joint that turns faster than 2 rad/s towards positive angles ends
  // a run, in place of the limits above: what the published runs look at. An arm that leaves its
  // strap, and a joint that swings the other way, go unnoticed.
  bool published_flags = false;

  // The published settings: motors off while settling from the reference, torque held 10 ms.
  static Protocol published();

  // Throws Error (kArgument) in one sentence for what cannot be on this plant.
  void check(const MobilisedPlant& plant) const;
};

enum class RunStatus : std::int32_t {
  kOk = 0,
  kFailedInit = 1,  // the start was not reached
  kDiverged = 2,    // too fast, too far from the reference, or the plant gave up
  kLimit = 3,       // a moved joint left its range, or the plant cannot compute what it would need
  kTimeout = 4,     // computing took longer than time_limit_s
  kNonfinite = 5,
};
const char* word(RunStatus status);  // "ok", "failed_init", ...

struct Mobilisation {
  RunStatus status = RunStatus::kOk;
  std::string reason;              // one sentence; "" for ok
  std::optional<Record> record;    // of the movement, as far as it came; none below two rows
  std::vector<std::string> notes;  // what to know of a run that is ok
  double simulated_s = 0.0;
  double start_s = 0.0;       // when the start was reached
  double largest_slip = 0.0;  // between device and arm at a moved joint, since donned, rad; NaN
                              // without record
  Index saturated_rows = 0;   // with a motor at its limit
  Vector levels;              // excitation at rest, one a muscle
};

// Errors of the sensors of a device, white and independent.
struct JointSensors {
  double angle_rad = 0.0;  // rms
  double rate_rad_s = 0.0;
  double acceleration_rad_s2 = 0.0;
  double torque_nm = 0.0;
  double slow_torque_nm =
      0.0;  // rms of an error below slow_hz: drift of a motor constant, friction
  double slow_hz = 0.5;
};

// Channels, one for each joint of the device unless said: theta_<joint>, theta_dot_, theta_ddot_
// (rad, rad/s, rad/s^2), tau_motor_, tau_loss_ (N m: damping and friction of the device as they
// were), tau_hum_ (N m: torque of the muscles by the nominal model), theta_ref_; one for each human
// joint: q_, q_dot_, tau_muscle_ (N m, true); a_<muscle>; the plant's own. Moved joints have the
// roles: theta_ position, tau_hum_ force (by the human on the robot), theta_ref_ reference. Throws
// Error for descriptions that cannot be; what goes wrong in the run is in its status.
Mobilisation mobilise(const MobilisedPlant& plant, const Protocol& protocol,
                      Token* token = nullptr);

// The record with errors of its sensors; tau_loss and tau_hum follow from what is measured then.
// Repetition `run` of a seed is the same whatever else is computed.
Record with_errors(const Record& record, const NominalModel& nominal, const JointSensors& sensors,
                   std::uint64_t seed, std::uint64_t run = 0);

// Impedance of the muscles at one state, K = -d tau / d q (N m/rad) and D = -d tau / d q' (N m
// s/rad), human joints x human joints, at constant activation: central differences.
struct LocalImpedance {
  Matrix k, d;
};
LocalImpedance local_impedance(MuscleProbe& probe, const VectorRef& angle, const VectorRef& rate,
                               const VectorRef& activation);

}  // namespace ulna::sim
