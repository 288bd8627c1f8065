/* Mechanisms: planar robots of two joints, their kinematics, dynamics and friction.
 *
 * Frame: the robot's base. Angles rad, torques N m, positions m, forces N. Sign: an external force
 * is that of the human on the robot, so I(q) q'' + C(q, q') q' + F_r(q') = tau + J(q)^T F_ext,
 * (5.1) of Dyck 2013. Arrays hold one pose a row, two columns; results are written row by row, a 2
 * x 2 matrix as 11, 12, 21, 22. */
#ifndef ULNA_PLANT_H
#define ULNA_PLANT_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A planar robot; immutable.
 * @since 0.1 */
typedef struct ulna_robot ulna_robot;

/** Parameters of the capstan robot of Dyck 2013, appendix A. NULL means the published value.
 * @since 0.1 */
typedef struct ulna_capstan_options {
  int64_t struct_size;  /* sizeof(ulna_capstan_options) */
  const double *link_m; /* 2: lengths d1, d2; NULL: 0.254, 0.2667 */
  const double *alpha;  /* 5: Table A.1, kg m^2 and (alpha_4, alpha_5) N m s/rad; NULL: as there */
  const double *dry;    /* 6: for each joint sliding and breakaway friction, N m, and the threshold
                           speed, rad/s; NULL: none */
} ulna_capstan_options;

/** A Cartesian table. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_carriage_options {
  int64_t struct_size;  /* sizeof(ulna_carriage_options) */
  double mass_kg;       /* of each axis; 0: 1 */
  double damping_n_s_m; /* viscous, of each axis; 0: 1; < 0: none */
  double travel_m;      /* to either side; 0: 0.25 */
} ulna_carriage_options;

/** Friction that is continuous in the speed, Ghannadi 2017 (3.25) with the errata.
 * @since 0.1 */
typedef struct ulna_friction {
  int64_t struct_size; /* sizeof(ulna_friction) */
  double sliding;      /* N or N m: level at high speed */
  double breakaway;    /* N or N m: reached at the threshold, at least the sliding level */
  double viscous;      /* N s/m or N m s/rad */
  double threshold;    /* m/s or rad/s: positive where there is dry friction */
} ulna_friction;

/** Do not look at the joint limits. @since 0.1 */
#define ULNA_LIMITS_IGNORE (1)
/** Refuse poses beyond the joint limits. @since 0.1 */
#define ULNA_LIMITS_KEEP (0)

/** Makes Dyck's planar capstan robot. Refuses an inertia that is not positive definite.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_new_capstan(const ulna_capstan_options *options,
                                            ulna_robot **out_robot);

/** Makes a Cartesian table of two independent axes: a robot whose own dynamics are simple, and the
 * one for experiments along one axis. Its "angles" are positions in m, its "torques" forces in N,
 * its parameters mass and damping.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_new_carriage(const ulna_carriage_options *options,
                                             ulna_robot **out_robot);

/** Frees a robot; NULL is allowed.
 * @thread exclusive robot
 * @since 0.1 */
ULNA_API void ulna_robot_free(ulna_robot *robot);

/** Parameters that its dynamics are linear in: for the capstan robot alpha_1 ... alpha_5.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_parameters(const ulna_robot *robot, double *out, int64_t capacity,
                                           int64_t *out_count);

/** Position of the handle, rows x 2.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_forward(const ulna_robot *robot, const ulna_view *angle,
                                        double *out, int64_t capacity, int64_t *out_count);

/** Joint angles for positions of the handle, rows x 2. Refuses, with the row, what is out of reach
 * and, with ULNA_LIMITS_KEEP, what is beyond the joint limits.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_inverse(const ulna_robot *robot, const ulna_view *position,
                                        int32_t limits, double *out, int64_t capacity,
                                        int64_t *out_count);

/** Jacobian d position / d angle, rows x 4.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_jacobian(const ulna_robot *robot, const ulna_view *angle,
                                         double *out, int64_t capacity, int64_t *out_count);

/** Time derivative of the Jacobian at joint rates, rows x 4.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_jacobian_rate(const ulna_robot *robot, const ulna_view *angle,
                                              const ulna_view *rate, double *out, int64_t capacity,
                                              int64_t *out_count);

/** Smallest over largest singular value of the Jacobian, one a row: 0 at a singular pose.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_quality(const ulna_robot *robot, const ulna_view *angle,
                                        double *out, int64_t capacity, int64_t *out_count);

/** Inertia matrix I(q), rows x 4.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_inertia(const ulna_robot *robot, const ulna_view *angle,
                                        double *out, int64_t capacity, int64_t *out_count);

/** Matrix C(q, q') of the Coriolis and centrifugal torques C q', rows x 4; I' - 2 C is
 * skew-symmetric.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_coriolis(const ulna_robot *robot, const ulna_view *angle,
                                         const ulna_view *rate, double *out, int64_t capacity,
                                         int64_t *out_count);

/** Friction torque F_r(q'), rows x 2.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_friction(const ulna_robot *robot, const ulna_view *rate,
                                         double *out, int64_t capacity, int64_t *out_count);

/** Motor torque for a motion under an external force, rows x 2. force: NULL for none.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_inverse_dynamics(const ulna_robot *robot, const ulna_view *angle,
                                                 const ulna_view *rate,
                                                 const ulna_view *acceleration,
                                                 const ulna_view *force, double *out,
                                                 int64_t capacity, int64_t *out_count);

/** Joint acceleration under motor torque and an external force, rows x 2. force: NULL for none.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_forward_dynamics(const ulna_robot *robot, const ulna_view *angle,
                                                 const ulna_view *rate, const ulna_view *torque,
                                                 const ulna_view *force, double *out,
                                                 int64_t capacity, int64_t *out_count);

/** Regressor of (A.5): 2 rows of as many columns as there are parameters for each row given;
 * regressor times parameters is the torque without an external force and without dry friction.
 * @thread shared robot
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_regressor(const ulna_robot *robot, const ulna_view *angle,
                                          const ulna_view *rate, const ulna_view *acceleration,
                                          double *out, int64_t capacity, int64_t *out_count);

/** Friction at each speed of a column.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_friction_force(const ulna_friction *friction, const ulna_view *speed,
                                         double *out, int64_t capacity, int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
