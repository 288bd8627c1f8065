// The force on a robot's handle from its own motion and motor torques, without a force sensor:
//   F_ext = J^-T (I q'' + C q' + F_r - tau)                    from (5.1) of Dyck 2013
// ((5.2) as printed has the other sign), q'' from an accelerometer at the handle,
//   q'' = J^-1 (x'' - J' q')                                    (5.3)
// or from differentiated angles. All signals pass the same smoother; nothing is differenced twice.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "ident/force_errors.hpp"
#include "ident/prepare.hpp"
#include "plant/planar_robot.hpp"
#include "record/record.hpp"

namespace ulna {

struct VirtualSensorOptions {
  std::string angle;            // words for two channels each: joint angles, rad; "": theta, else q
  std::string torque;           // motor torques, Nm; "": tau
  std::string acceleration;     // of the handle in the robot's frame, m/s^2; "": differentiate
  std::string reference;        // commanded angles, rad, or positions, m; "": none
  PrepareOptions prepare;       // of every signal; lowpass_hz 0: wide open over the motion's band
  double least_quality = 0.05;  // smallest over largest singular value of J; below: an error
  // What is known of the errors. Systematic: covariance of the robot's parameters (empty: exact),
  // relative scale errors of torque and accelerometer. Random, standard deviation per sample:
  Matrix parameter_covariance;
  double torque_scale_error = 0.0;
  double acceleration_scale_error = 0.0;
  double torque_noise = 0.0;        // Nm
  double angle_noise = 0.0;         // rad, beside the quantisation
  double angle_step = 0.0;          // of the encoders, rad: uniform within a step
  double acceleration_noise = 0.0;  // m/s^2
  int threads = 0;
};

// Random parts of the force error, columns of VirtualForce::random.
enum class NoiseSource { kTorque = 0, kAngle = 1, kAcceleration = 2 };
inline constexpr Index kNoiseSources = 3;

struct VirtualForce {
  // Channels x, y (positions, m), F_x, F_y (forces, N), x_ref, y_ref with a reference, then a_x,
  // a_y (the handle's acceleration in use, m/s^2) and, smoothed as well, measured forces of the log
  // as "<name>_measured": ready for an identification by role.
  Record record;
  ForceErrors errors;          // "parameter 1" ..., "torque scale 1", 2, "acceleration scale 1", 2
  Matrix random;               // rows x 6: standard deviation of F_x, F_y from each noise source
  Matrix total;                // rows x 2: of the force, random and systematic together
  bool accelerometer = false;  // q'' came from it
  double worst_quality = 0.0;  // of the Jacobian
  Index worst_row = 0;         // of the source record
  PrepareReport report;
};

// Throws Error: kData for units, NaN and jitter as prepare, and at a pose near a singular one with
// row, time, angles and the condition of J; kArgument for words and options.
VirtualForce sense_force(const Record& record, const PlanarRobot& robot,
                         const VirtualSensorOptions& options, Token* token = nullptr);

}  // namespace ulna
