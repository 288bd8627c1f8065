// An arm and the robot that perturbs it as one linear system, to foresee an experiment:
//
//     robot  Mr x'' + Br x' + Kr x = u + F_h,   u = Kr r + Br r'  or  the commanded force
//     arm    F_h = d - [ M x'' + B x' + K (x - x0) ]                 (3.2) of Dyck 2013
//
// F_h: force by the human on the robot; d: what the human adds; Fig. 4.2 of Dyck 2013.
#pragma once

#include <Eigen/Core>

#include "base/token.hpp"
#include "base/types.hpp"
#include "signal/excitation.hpp"

namespace ulna {

// n x n, SI; x0 counts from where the robot starts (reference 0).
struct ArmModel {
  Matrix m, b, k;
  Vector x0;
};

// n x n, SI. A position-controlled robot tracks with stiffness (Kp) and damping (Kd); a
// force-controlled one exerts the design, and stiffness and damping are what it has of its own.
struct RobotModel {
  Matrix stiffness, damping, mass;
};

// What the human does beside being moved: Gaussian force, the same on every axis and independent,
// of flat density between two frequencies.
struct Tremor {
  double sigma = 0.0;  // N or N m
  double low_hz = 0.0;
  double high_hz = 5.0;

  // Two-sided density at a frequency of any sign, N^2 / Hz.
  double density(double freq_hz) const noexcept;
};

// Throws Error (kArgument) for a negative or infinite number or an empty band.
void check_tremor(const Tremor& tremor);

class ArmLoop {
 public:
  // Throws Error: kArgument for shapes and numbers, kAnalysis when arm and robot together are
  // unstable.
  ArmLoop(ArmModel arm, RobotModel robot, Drive drive);

  Index axes() const noexcept { return arm_.m.rows(); }
  const ArmModel& arm() const noexcept { return arm_; }

  // Where hand and force rest while the reference is 0 (of all such places the nearest to x0's pull
  // where the loop has no stiffness).
  const Vector& rest_position() const noexcept { return rest_position_; }
  const Vector& rest_force() const noexcept { return rest_force_; }

  // Away from rest, rows x n.
  struct Response {
    Matrix position, velocity, acceleration, force;
  };
  // From rest, exact for an input that is linear between samples: one step of the matrix
  // exponential a row.
  Response respond(const Excitation& excitation, Token* token = nullptr) const;

  // At s = j 2 pi f: the arm's own impedance (force over position) and the motion that a force of
  // the human causes.
  Eigen::MatrixXcd impedance(double freq_hz) const;
  Eigen::MatrixXcd compliance(double freq_hz) const;

  // Covariances of position, velocity and force that the tremor causes, n x n each.
  struct Spread {
    Matrix position, velocity, force;
  };
  Spread spread(const Tremor& tremor) const;

 private:
  ArmModel arm_;
  RobotModel robot_;
  Drive drive_;
  Matrix mass_, damping_, stiffness_;  // of both
  Vector rest_position_, rest_force_;
};

}  // namespace ulna
