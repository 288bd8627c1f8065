/* Impedance at the hand and at the joints, with the posture's share:
 *
 *     K_q = J' K J - Gamma,   Gamma_ik = sum_m (d J_mi / d q_k) F_m,   B_q = J' B J,   M_q = J' M J
 *
 * F: force by the human on the robot; torques tau = J' F. The planar arm has
 * hand = shoulder + upper (cos q1, sin q1) + fore (cos(q1 + q2), sin(q1 + q2)), q2 the flexion of
 * the elbow, positive for a right arm. Angles in rad. */
#ifndef ULNA_JOINT_H
#define ULNA_JOINT_H

#include <ulna/base.h>
#include <ulna/ident.h>
#include <ulna/record.h>

#ifdef __cplusplus
extern "C" {
#endif

/** From the hand to the joints. @since 0.1 */
#define ULNA_JOINT_FROM_ENDPOINT (0)
/** From the joints to the hand; J must be square and regular. @since 0.1 */
#define ULNA_JOINT_TO_ENDPOINT (1)

/** A planar arm of two links.
 * @since 0.1 */
typedef struct ulna_arm {
  int64_t struct_size;  /* sizeof(ulna_arm) */
  double upper_m;       /* length of the upper arm; 0: 0.31 */
  double fore_m;        /* length of the forearm, elbow to hand; 0: 0.34 */
  double shoulder_m[2]; /* place of the shoulder, x and y */
  int32_t left;         /* 1: the elbow bends to the other side, q2 negative */
  int32_t reserved;     /* zero */
} ulna_arm;

/** What is carried over. Views may be NULL where a default is named.
 * @since 0.1 */
typedef struct ulna_joint_request {
  int64_t struct_size;               /* sizeof(ulna_joint_request) */
  const ulna_view *m;                /* inertia, square */
  const ulna_view *b;                /* damping */
  const ulna_view *k;                /* stiffness */
  const ulna_view *covariance;       /* of m, b, k row by row, at least so many; NULL: none */
  const ulna_view *jacobian;         /* J at the posture */
  const ulna_view *slope;            /* dJ/dq_1 below dJ/dq_2 and so on: (rows n) x n */
  const ulna_view *force_n;          /* at the posture, a value a row of J; NULL: zero */
  const ulna_view *force_covariance; /* NULL: the force is known */
  double condition_limit;            /* of J, for the way to the hand; 0: 1e4 */
  int32_t direction;                 /* ULNA_JOINT_FROM_ENDPOINT or _TO_ENDPOINT */
  int32_t reserved;                  /* zero */
} ulna_joint_request;

/** Margins of M, B and K over draws from their covariance.
 * @since 0.1 */
typedef struct ulna_joint_margins {
  int64_t struct_size;  /* set by the caller to sizeof(ulna_joint_margins) */
  double m_min;         /* smallest eigenvalue of the symmetric part of M */
  double b_min;         /* of B */
  double k_min;         /* of K */
  double m_interval[2]; /* low, high */
  double b_interval[2]; /* low, high */
  double k_interval[2]; /* low, high */
  double probability;   /* that none is negative */
} ulna_joint_margins;

/** Carries M, B, K and their covariance over. out: M, B, K row by row (3 n^2), then their
 * covariance (9 n^4, only where one was given), then Gamma of the joints. out_condition: of J.
 * Fails with ULNA_ERROR_ANALYSIS at a singular posture, naming the direction that is lost.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_joint_transform(const ulna_joint_request *request, double *out_condition,
                                          double *out, int64_t capacity, int64_t *out_count);

/** Passivity margins of M, B and K with a covariance (NULL: none). draws 0: 4000.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_joint_get_margins(const ulna_view *m, const ulna_view *b,
                                            const ulna_view *k, const ulna_view *covariance,
                                            double level, int64_t draws, int64_t seed,
                                            ulna_joint_margins *out_margins);

/** Place of the hand for angles (rows x 2): rows x 2.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_arm_hand(const ulna_arm *arm, const ulna_view *angles_rad, double *out,
                                   int64_t capacity, int64_t *out_count);

/** Angles for places of the hand (rows x 2): rows x 2. Fails out of reach, with the row.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_arm_angles(const ulna_arm *arm, const ulna_view *hand_m, double *out,
                                     int64_t capacity, int64_t *out_count);

/** J, dJ/dq1 and dJ/dq2 at one posture (2 angles), each row by row: 12 values.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_arm_posture(const ulna_arm *arm, const ulna_view *angles_rad, double *out,
                                      int64_t capacity, int64_t *out_count);

/** Angles from markers at shoulder, elbow and wrist, each rows x 2: rows x 2, unwrapped.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_arm_angles_of_markers(const ulna_view *shoulder_m,
                                                const ulna_view *elbow_m, const ulna_view *wrist_m,
                                                double *out, int64_t capacity, int64_t *out_count);

/** A record at the joints: angles q1, q2 (from the hand's position, or given rows x 2), torques
 * tau1, tau2 = J' F, and references where there are any. prepare names the channels; its filters
 * are not used. condition_limit of J, 0: 1000. Fails with ULNA_ERROR_ANALYSIS and the row where the
 * hand is out of reach or the arm nearly straight.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_record_to_joints(const ulna_record *record, const ulna_arm *arm,
                                           const ulna_prepare_options *prepare,
                                           const ulna_view *angles_rad, double condition_limit,
                                           ulna_record **out_record);

#ifdef __cplusplus
}
#endif

#endif
