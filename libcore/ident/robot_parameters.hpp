// The dynamic parameters of a planar robot from a recording without contact,
//   Y(q, q', q'') alpha + c_j tanh(4 q'_j / w) = tau (+ J^T F),        (A.5) of Dyck 2013,
// by least squares and by instrumental variables from the commanded motion.
//
// Angles are smoothed by a filter that is wide open over the band; the regressor is formed from
// them, and then every column of it and the torque pass the same narrow filter. Filtering the
// angles narrowly and forming the regressor afterwards, as the thesis does, is biased where the
// dynamics are not linear.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "ident/linear.hpp"
#include "ident/prepare.hpp"
#include "plant/planar_robot.hpp"
#include "record/record.hpp"

namespace ulna {

struct RobotFitOptions {
  std::string angle;            // words for two channels each: joint angles, rad; "": theta, else q
  std::string torque;           // motor torques, Nm; "": tau
  std::string reference;        // commanded angles, rad; "": the log holds none
  std::string force;            // external force, N; "": the robot moved freely
  bool dry_friction = false;    // two columns more
  double dry_threshold = 0.02;  // w, rad/s: the friction's sign turns within it
  bool least_squares = false;   // report least squares even where there is a reference
  PrepareOptions prepare;       // the narrow filter; lowpass_hz 0: from the motion
  double train_s = 0.0;         // 0: first 40 s of a trial, at most 80 %
  double lag_s = 0.4;           // of the Newey-West errors
  double condition_limit = 1000.0;  // above: an error that names the direction
  int threads = 0;
};

struct RobotFit {
  std::vector<std::string> names;  // "alpha_1" ..., "dry_1", "dry_2"
  Estimator estimator = Estimator::kLeastSquares;
  Vector value;
  Matrix covariance;
  double condition = 0.0;  // of the regressor in unit columns
  // The other estimator on the same rows; empty without a reference.
  Vector other;
  Matrix other_covariance;
  double difference_p = 1.0;    // Wald test that both agree; NaN without a reference
  Vector vaf, vaf_train;        // percent, per joint, held-out and identification rows
  Vector residual_nm;           // rms per joint, identification rows, within the band
  Vector excitation;            // per parameter: rms of the torque it causes, Nm
  bool feasible = false;        // inertia positive definite, friction not negative, every pose
  double least_inertia = 0.0;   // smallest eigenvalue of I over all poses, kg m^2
  double least_friction = 0.0;  // smallest friction coefficient
  double feasible_probability = 0.0;  // over draws from the covariance
  double lowpass_hz = 0.0;            // narrow
  double wide_hz = 0.0;
  double train_s = 0.0;
  Index train_rows = 0, held_out_rows = 0;  // of the recording
  std::vector<std::string> warnings;        // empty: good
  std::vector<std::string> provenance;
};

// Throws Error: kData for units, NaN and jitter (as prepare), kArgument for words, kAnalysis when
// the motion does not determine the parameters, with the combination in words.
RobotFit identify_robot(const Record& record, const PlanarRobot& robot,
                        const RobotFitOptions& options, Token* token = nullptr);

// Whether parameters can belong to a body: smallest eigenvalue of the inertia matrix and smallest
// friction coefficient over all poses.
struct Feasibility {
  double least_inertia = 0.0;
  double least_friction = 0.0;
  bool feasible() const { return least_inertia > 0.0 && least_friction >= 0.0; }
};
Feasibility feasibility(const PlanarRobot& robot, const Vector& parameters);

}  // namespace ulna
