// Impedance at the hand and at the joints. With torques tau = J' F (F by the human on the robot,
// tau by the joints) and x = x(q), d tau = -K_q dq gives
//
//     K_q = J' K J - Gamma,   Gamma_ik = sum_m (d J_mi / d q_k) F_m
//     B_q = J' B J,           M_q = J' M J
//
// at rest. Gamma is the Hessian of F . x(q): it is symmetric, so a force that does not change with
// the posture breaks no symmetry and stores or gives no net energy. In motion, x'' = J q'' + J' q'
// adds J' M (dJ/dt) to what multiplies q'.
#pragma once

#include <string>
#include <vector>

#include "base/types.hpp"
#include "ident/prepare.hpp"
#include "impedance/arm.hpp"
#include "record/record.hpp"

namespace ulna {

// Kinematics at one posture: J is m x n, slope[k] = dJ / dq_k, m x n each.
struct Posture {
  Matrix jacobian;
  std::vector<Matrix> slope;
};

// Throws Error (kArgument) for shapes that do not fit or values that are not finite; when the
// slopes are no second derivatives of one x(q): dJ_mi/dq_k = dJ_mk/dq_i.
void check_posture(const Posture& posture);
Posture posture_of(const TwoLink& arm, const Eigen::Vector2d& q);

struct JointImpedance {
  Matrix m, b, k;          // n x n (at the joints) or m x m (at the hand)
  Matrix covariance;       // of M, B, K row by row; empty without one given
  Matrix gamma;            // the posture's share of K_q, n x n
  double condition = 0.0;  // of J
};

// natural: M, B, K row by row (x0 after them is ignored), covariance of at least so many, or empty.
// force: at the posture, m; its uncertainty: force_covariance, m x m or empty.
JointImpedance to_joint(const Vector& natural, const Matrix& covariance, const Posture& posture,
                        const Vector& force, const Matrix& force_covariance);

// The way back, K = J^-T (K_q + Gamma) J^-1. Throws Error (kAnalysis) when J is not square or its
// condition number exceeds the limit: near a singular posture the hand's impedance is unbounded.
JointImpedance to_endpoint(const Vector& natural, const Matrix& covariance, const Posture& posture,
                           const Vector& force, const Matrix& force_covariance,
                           double condition_limit = 1e4);

// Smallest eigenvalues of the symmetric parts over draws from the covariance.
struct JointPassivity {
  double value[3] = {0.0, 0.0, 0.0};  // of M, B, K
  double interval[3][2] = {{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};
  double probability = 0.0;  // that none is negative
};
JointPassivity joint_passivity(const JointImpedance& impedance, double level, Index draws,
                               std::uint64_t seed);

// Cartesian channels of a record to joint ones: angles q1, q2 from the hand's position (or given,
// rows x 2), torques tau1, tau2 = J' F at those angles, references likewise by inverse kinematics.
// Other channels are left out. Throws Error (kAnalysis, detail "row R") where the hand is out of
// reach or J's condition number exceeds the limit.
Record joint_record(const Record& record, const Roles& roles, const TwoLink& arm,
                    const Matrix& angles, double condition_limit = 1e3);

}  // namespace ulna
