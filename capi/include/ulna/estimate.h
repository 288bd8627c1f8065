/* Joint torques of a body with their standard deviations, from its motion and what touches it: the
 * maximum a posteriori estimate of Latella et al. 2021, in closed form for dynamics that hold
 * exactly, and with dynamics that are uncertain themselves.
 *
 * Conventions as in body.h. Measurements are rows of y in the order of the sensors; NaN is a
 * missing sample: it widens the result and is never read as zero. */
#ifndef ULNA_ESTIMATE_H
#define ULNA_ESTIMATE_H

#include <ulna/base.h>
#include <ulna/body.h>

#ifdef __cplusplus
extern "C" {
#endif

/** What is measured on a body, and what is assumed where nothing is: immutable.
 * @since 0.1 */
typedef struct ulna_sensors ulna_sensors;

/** Torques of a recording: immutable.
 * @since 0.1 */
typedef struct ulna_torques ulna_torques;

/** Torques frame by frame as they come.
 * @since 0.1 */
typedef struct ulna_torque_stream ulna_torque_stream;

/** 3 rows: proper acceleration of the sensor's place, sensor axes, m/s^2. @since 0.1 */
#define ULNA_SENSOR_ACCELEROMETER (0)
/** 3 rows: angular acceleration of the link, sensor axes, rad/s^2. @since 0.1 */
#define ULNA_SENSOR_ANGULAR_ACCELERATION (1)
/** 1 row: acceleration of a hinge, rad/s^2. @since 0.1 */
#define ULNA_SENSOR_JOINT_ACCELERATION (2)
/** 6 rows: external force and moment about the sensor's place, sensor axes. @since 0.1 */
#define ULNA_SENSOR_EXTERNAL_WRENCH (3)
/** 3 rows: external force at the sensor's place, without a moment. @since 0.1 */
#define ULNA_SENSOR_EXTERNAL_FORCE (4)
/** No rows: something touches the link, nobody knows how. @since 0.1 */
#define ULNA_SENSOR_FREE_WRENCH (5)
/** No rows: likewise, as a force at one place. @since 0.1 */
#define ULNA_SENSOR_FREE_FORCE (6)
/** 1 row: torque of a hinge, N m. @since 0.1 */
#define ULNA_SENSOR_JOINT_TORQUE (7)
/** 6 rows: wrench of the parent on the link, about the joint, link axes. @since 0.1 */
#define ULNA_SENSOR_JOINT_WRENCH (8)

/** Place and axes of a sensor are the link's. @since 0.1 */
#define ULNA_SENSOR_FRAME_LINK (0)
/** The place is the link's, the axes are the world's. @since 0.1 */
#define ULNA_SENSOR_FRAME_WORLD_AXES (1)
/** Place and axes are the world's: a force plate. @since 0.1 */
#define ULNA_SENSOR_FRAME_WORLD (2)

/** Numbers that describe a sensor, one row a sensor: kind, link (for joints the one that the joint
 * carries), frame, position (3), orientation (9, rows of the matrix whose columns are the sensor's
 * axes), standard deviations (6: as many as rows, then NaN; one for all rows; two for force and
 * moment; none for a free wrench of the prior's size). @since 0.1 */
#define ULNA_SENSOR_VALUES (21)

/** Solver: closed form, dynamics exact, standard deviations. @since 0.1 */
#define ULNA_SOLVER_CLOSED_FORM (0)
/** Solver: dynamics uncertain, one block factorisation along the tree; means only. @since 0.1 */
#define ULNA_SOLVER_SPARSE (1)

/** Torques, frames x hinges, N m. @since 0.1 */
#define ULNA_TORQUES_TORQUE (0)
/** Their standard deviations. @since 0.1 */
#define ULNA_TORQUES_TORQUE_DEVIATION (1)
/** Accelerations of the hinges, frames x hinges, rad/s^2. @since 0.1 */
#define ULNA_TORQUES_ACCELERATION (2)
/** What the measured wrenches lack at the base origin, frames x 6, world axes. @since 0.1 */
#define ULNA_TORQUES_RESIDUAL (3)
/** Standard deviation of the residual that the sensors explain, frames x 6. @since 0.1 */
#define ULNA_TORQUES_RESIDUAL_DEVIATION (4)
/** A frame: squared normalised innovation of the balance; of the motion; what the latter is on
 * average; 1 where the state was bridged. frames x 4. @since 0.1 */
#define ULNA_TORQUES_TESTS (5)
/** Measured less estimated, frames x rows; NaN where missing. @since 0.1 */
#define ULNA_TORQUES_INNOVATION (6)
/** Standard deviation of the innovations. @since 0.1 */
#define ULNA_TORQUES_INNOVATION_DEVIATION (7)
/** Net external wrenches, frames x 6 links, link axes, link origin; when kept. @since 0.1 */
#define ULNA_TORQUES_EXTERNAL (8)
/** Their standard deviations. @since 0.1 */
#define ULNA_TORQUES_EXTERNAL_DEVIATION (9)
/** Wrenches of parents on links, frames x 6 links, likewise. @since 0.1 */
#define ULNA_TORQUES_JOINT_WRENCH (10)
/** Their standard deviations. @since 0.1 */
#define ULNA_TORQUES_JOINT_WRENCH_DEVIATION (11)

/** Standard deviations of what is assumed before anything is measured: rest, nothing touches. Zero
 * bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_prior_options {
  int64_t struct_size;                     /* sizeof(ulna_prior_options) */
  double base_acceleration_m_s2;           /* 0: 100 */
  double base_angular_acceleration_rad_s2; /* 0: 300 */
  double joint_acceleration_rad_s2;        /* 0: 300 */
  double force_n;                          /* of a free or missing component; 0: 1000 */
  double moment_nm;                        /* 0: 300 */
  double untouched_force_n;                /* on every link; 0: 0.001 */
  double untouched_moment_nm;              /* 0: 0.0001 */
} ulna_prior_options;

/** How torques are estimated. Zero bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_torque_options {
  int64_t struct_size;              /* sizeof(ulna_torque_options) */
  int32_t solver;                   /* ULNA_SOLVER_... */
  int32_t stack;                    /* 1: task 1 and task 2 as published; 0: in one shot */
  int32_t means_only;               /* 1: no standard deviations, no innovations */
  int32_t wrenches;                 /* 1: external and joint wrenches are kept */
  int32_t threads;                  /* 0: one a processor */
  int32_t no_bridges;               /* 1: frames without a state stay without torques */
  int64_t longest_gap;              /* frames that are bridged; 0: 12 */
  double momentum_rate_force_n;     /* trust of task 1, standard deviation; 0: 1 */
  double momentum_rate_moment_nm;   /* 0: 1 */
  double model_force_n;             /* of uncertain dynamics; 0: 0.001; < 0: exact */
  double model_moment_nm;           /* 0: 0.001; < 0: exact */
  double model_acceleration_m_s2;   /* 0: 0.001; < 0: exact */
  double model_acceleration_rad_s2; /* 0: 0.001; < 0: exact */
} ulna_torque_options;

/** Of a whole recording.
 * @since 0.1 */
typedef struct ulna_torques_summary {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_torques_summary) */
  int64_t frames;        /* of the recording */
  int64_t unusable;      /* frames without a state */
  int64_t bridged;       /* frames whose state lies between neighbours */
  double log_likelihood; /* of the accelerations and the balance */
} ulna_torques_summary;

/** How variances are estimated. Zero bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_variance_options {
  int64_t struct_size;     /* sizeof(ulna_variance_options) */
  const ulna_view *groups; /* of each row, -1: kept; NULL: by sensor, forces and moments apart */
  int64_t steps;           /* at most; 0: 60 */
  int64_t frames;          /* at most, evenly over the recording; 0: 2000 */
  double tolerance;        /* relative change at which it stops; 0: 0.001 */
  double least;            /* smallest part of a given deviation; 0: 0.03 */
  int32_t threads;         /* 0: one a processor */
  int32_t reserved;        /* zero */
} ulna_variance_options;

/** What a set of sensors can tell at one pose.
 * @since 0.1 */
typedef struct ulna_identifiability {
  int64_t struct_size;     /* set by the caller to sizeof(ulna_identifiability) */
  int64_t wrench_unknowns; /* components of free wrenches */
  int64_t wrench_rank;     /* combinations of them that the balance of the body tells */
  int64_t force_unknowns;  /* components if all of them were forces without moments */
  int64_t force_rank;      /* combinations of those */
  int64_t motion_unknowns; /* accelerations of base and hinges */
  int64_t motion_rank;     /* combinations that the sensors tell */
} ulna_identifiability;

/** Sensors on a body. sensors: ULNA_SENSOR_VALUES columns; names: one a sensor. prior may be NULL.
 * Refuses (ULNA_ERROR_ARGUMENT) with the sensor's name what cannot be.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_sensors_new(const ulna_body *body, const ulna_view *sensors,
                                      const char *const *names, int64_t name_count,
                                      const ulna_prior_options *prior, ulna_sensors **out_sensors);

/** Frees sensors; NULL is accepted.
 * @thread exclusive sensors
 * @since 0.1 */
ULNA_API void ulna_sensors_free(ulna_sensors *sensors);

/** Names of the rows of y, one a line: "shoe.force_x".
 * @thread shared sensors
 * @since 0.1 */
ULNA_API ulna_status ulna_sensors_row_names(const ulna_sensors *sensors, char *out_text,
                                            int64_t capacity, int64_t *out_size);

/** Standard deviations, one a row of y.
 * @thread shared sensors
 * @since 0.1 */
ULNA_API ulna_status ulna_sensors_deviations(const ulna_sensors *sensors, double *out,
                                             int64_t capacity, int64_t *out_count);

/** The same sensors with other standard deviations, one a row of y.
 * @thread shared sensors
 * @since 0.1 */
ULNA_API ulna_status ulna_sensors_with_deviations(const ulna_sensors *sensors,
                                                  const ulna_view *deviation,
                                                  ulna_sensors **out_sensors);

/** Standard deviations from a recording by maximum likelihood: rows of deviation and freedom
 * (pieces of information about its variance). out_log_likelihood: at the end.
 * @thread shared sensors
 * @since 0.1 */
ULNA_API ulna_status ulna_sensors_fit(const ulna_sensors *sensors, const ulna_body_motion *motion,
                                      const ulna_view *measured,
                                      const ulna_variance_options *options, ulna_token *token,
                                      double *out_log_likelihood, int32_t *out_converged,
                                      double *out, int64_t capacity, int64_t *out_count);

/** What the sensors can tell at the first frame of a motion; measured (1 x rows, NaN: missing) may
 * be NULL. The text is for a person.
 * @thread shared sensors
 * @since 0.1 */
ULNA_API ulna_status ulna_sensors_identify(const ulna_sensors *sensors,
                                           const ulna_body_motion *motion,
                                           const ulna_view *measured,
                                           ulna_identifiability *out_result, char *out_text,
                                           int64_t capacity, int64_t *out_size);

/** Torques of a recording; measured: frames x rows. motion's angles, rates, orientation, angular
 * velocity and position may hold NaN: short gaps are bridged. Its accelerations are not read: they
 * are measurements.
 * @thread shared sensors
 * @since 0.1 */
ULNA_API ulna_status ulna_torques_estimate(const ulna_sensors *sensors,
                                           const ulna_body_motion *motion,
                                           const ulna_view *measured,
                                           const ulna_torque_options *options, ulna_token *token,
                                           ulna_torques **out_torques);

/** Frees torques; NULL is accepted.
 * @thread exclusive torques
 * @since 0.1 */
ULNA_API void ulna_torques_free(ulna_torques *torques);

/** What can be said of all frames.
 * @thread shared torques
 * @since 0.1 */
ULNA_API ulna_status ulna_torques_summarise(const ulna_torques *torques,
                                            ulna_torques_summary *out_summary);

/** An array of the result (ULNA_TORQUES_...), row after row; empty when it was not kept.
 * @thread shared torques
 * @since 0.1 */
ULNA_API ulna_status ulna_torques_array(const ulna_torques *torques, int32_t which, double *out,
                                        int64_t capacity, int64_t *out_count);

/** A stream: all memory that its updates need is made here. options: solver, stack and their
 * deviations count.
 * @thread shared sensors
 * @since 0.1 */
ULNA_API ulna_status ulna_torque_stream_new(const ulna_sensors *sensors,
                                            const ulna_torque_options *options,
                                            ulna_torque_stream **out_stream);

/** Frees a stream; NULL is accepted.
 * @thread exclusive stream
 * @since 0.1 */
ULNA_API void ulna_torque_stream_free(ulna_torque_stream *stream);

/** One frame. base: position (3), unit quaternion w x y z (4), angular velocity (3), world; angle
 * and rate: one a hinge; measured: one a row, NaN where missing. Writes torque and deviation (one a
 * hinge; NULL: not wanted) and residual (6; NULL: not wanted). A state that is not finite gives
 * NaN. Numbers of a sparse solver have no deviation and no residual: NaN. Fails only for NULL.
 * @thread exclusive stream
 * @realtime
 * @since 0.1 */
ULNA_API ulna_status ulna_torque_stream_update(ulna_torque_stream *stream, const double *base,
                                               const double *angle, const double *rate,
                                               const double *measured, double *out_torque,
                                               double *out_deviation, double *out_residual);

#ifdef __cplusplus
}
#endif

#endif
