/* Rigs and sensors: springs of known stiffness, the empty rig taken out of a measurement, strain
 * gauges, the accelerometer against the encoders, and the force on a robot's handle without a force
 * sensor. Dyck 2013, chapter 5 and appendices A, D and E.
 *
 * Units SI and rad. Sign: positions in the frame of the log; forces are those of the human (or the
 * springs) on the robot. Natural parameters of an impedance are M, B and K row by row, then x0. */
#ifndef ULNA_RIG_H
#define ULNA_RIG_H

#include <ulna/base.h>
#include <ulna/ident.h>
#include <ulna/impedance.h>
#include <ulna/plant.h>
#include <ulna/record.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Largest number of springs between a handle and a frame. @since 0.1 */
#define ULNA_SPRINGS_MOST (8)

/** Parameters after the tare. @since 0.1 */
#define ULNA_TARE_PARAMETERS (0)
/** Their covariance, square. @since 0.1 */
#define ULNA_TARE_COVARIANCE (1)

/** Standard deviation of the force, rows x axes: all sources together. @since 0.1 */
#define ULNA_SENSED_TOTAL (0)
/** The part of the noise of the torques, rows x axes. @since 0.1 */
#define ULNA_SENSED_TORQUE (1)
/** The part of the noise and steps of the angles, rows x axes. @since 0.1 */
#define ULNA_SENSED_ANGLE (2)
/** The part of the noise of the accelerometer, rows x axes. @since 0.1 */
#define ULNA_SENSED_ACCELERATION (3)
/** The part of constants that are wrong by the same in every row, rows x axes. @since 0.1 */
#define ULNA_SENSED_SYSTEMATIC (4)
/** Covariance of these constants, square. @since 0.1 */
#define ULNA_SENSED_COVARIANCE (5)

/** Change of the natural parameters per unit of each constant, parameters x constants. @since 0.1
 */
#define ULNA_BUDGET_SENSITIVITY (0)
/** Covariance of the natural parameters from the constants. @since 0.1 */
#define ULNA_BUDGET_SYSTEMATIC (1)
/** The same with the statistical covariance of the fit. @since 0.1 */
#define ULNA_BUDGET_TOTAL (2)

/** Twice integrated accelerometer per encoder, n x n: the identity when both agree. @since 0.1 */
#define ULNA_SENSOR_CHECK_GAIN (0)
/** Standard errors of the gains, n x n. @since 0.1 */
#define ULNA_SENSOR_CHECK_GAIN_ERROR (1)
/** How much later each accelerometer axis is than the encoder, s, n. @since 0.1 */
#define ULNA_SENSOR_CHECK_LAG (2)
/** Standard errors of the lags, s, n. @since 0.1 */
#define ULNA_SENSOR_CHECK_LAG_ERROR (3)
/** Correlation of accelerometer axes (rows) with encoder axes, n x n. @since 0.1 */
#define ULNA_SENSOR_CHECK_CORRELATION (4)
/** Variance accounted for as recorded, percent, n. @since 0.1 */
#define ULNA_SENSOR_CHECK_AGREEMENT (5)
/** Variance accounted for with gain and lag, percent, n. @since 0.1 */
#define ULNA_SENSOR_CHECK_CORRECTED (6)
/** Mean of the accelerometer, m/s^2, n. @since 0.1 */
#define ULNA_SENSOR_CHECK_OFFSET (7)
/** Encoder axis that each accelerometer axis follows, from 0, n. @since 0.1 */
#define ULNA_SENSOR_CHECK_FOLLOWS (8)
/** Time, s, then what is compared, m: accelerometer and encoder axes; rows x (1 + 2 n). @since 0.1
 */
#define ULNA_SENSOR_CHECK_TRACE (9)

/** Both sensors agree. @since 0.1 */
#define ULNA_DISAGREE_NONE (0)
/** An axis of the accelerometer does not follow the motion. @since 0.1 */
#define ULNA_DISAGREE_UNRELATED (1)
/** Its axes are exchanged. @since 0.1 */
#define ULNA_DISAGREE_AXES (2)
/** An axis has the wrong sign. @since 0.1 */
#define ULNA_DISAGREE_SIGN (3)
/** An axis looks as if it were in another unit, as g. @since 0.1 */
#define ULNA_DISAGREE_UNIT (4)
/** Its axes are turned in the plane. @since 0.1 */
#define ULNA_DISAGREE_TURNED (5)
/** The sensitivity of an axis is off. @since 0.1 */
#define ULNA_DISAGREE_SCALE (6)
/** An axis is not simultaneous. @since 0.1 */
#define ULNA_DISAGREE_LAG (7)

/** Names of the accelerometer's channels, one a line. @since 0.1 */
#define ULNA_SENSOR_CHECK_TEXT_ACCELERATIONS (0)
/** Names of the encoder's channels, one a line. @since 0.1 */
#define ULNA_SENSOR_CHECK_TEXT_POSITIONS (1)

/** Estimated parameters, p. @since 0.1 */
#define ULNA_ROBOT_FIT_VALUE (0)
/** Their covariance, p x p. @since 0.1 */
#define ULNA_ROBOT_FIT_COVARIANCE (1)
/** The other estimator's parameters; empty without a reference. @since 0.1 */
#define ULNA_ROBOT_FIT_OTHER (2)
/** Their covariance; empty without a reference. @since 0.1 */
#define ULNA_ROBOT_FIT_OTHER_COVARIANCE (3)
/** Variance of each joint's torque accounted for on held-out data, percent, 2. @since 0.1 */
#define ULNA_ROBOT_FIT_VAF (4)
/** The same on the identification part, 2. @since 0.1 */
#define ULNA_ROBOT_FIT_VAF_TRAIN (5)
/** Root mean square of what the fit leaves of each torque, N m, 2. @since 0.1 */
#define ULNA_ROBOT_FIT_RESIDUAL (6)
/** Root mean square of the torque that each parameter causes, N m, p. @since 0.1 */
#define ULNA_ROBOT_FIT_EXCITATION (7)

/** Names of the parameters, one a line. @since 0.1 */
#define ULNA_ROBOT_FIT_TEXT_NAMES (0)
/** Warnings, one sentence a line; empty when good. @since 0.1 */
#define ULNA_ROBOT_FIT_TEXT_WARNINGS (1)
/** Provenance, one step a line. @since 0.1 */
#define ULNA_ROBOT_FIT_TEXT_PROVENANCE (2)

/** One extension spring: it pulls with rate (length - rest) and hangs slack when shorter.
 * @since 0.1 */
typedef struct ulna_spring {
  double anchor_x_m; /* where it is fixed to the frame */
  double anchor_y_m; /* the same, y */
  double rate_n_m;   /* above 0 */
  double rest_m;     /* relaxed length, above 0 */
} ulna_spring;

/** Where the handle rests between springs, and what it feels there.
 * @since 0.1 */
typedef struct ulna_springs_info {
  int64_t struct_size;       /* set by the caller to sizeof(ulna_springs_info) */
  double x_m;                /* equilibrium */
  double y_m;                /* the same, y */
  double stiffness_n_m[4];   /* -dF/dx row by row; symmetric */
  double eigenvalues_n_m[2]; /* of the stiffness, ascending */
  double slack_radius_m;     /* displacement that leaves every taut spring taut */
  double residual_n;         /* force at the equilibrium: rounding */
  double deviation_n;        /* largest |F + K d| within the radius asked for */
  double deviation_share;    /* largest |F + K d| / |K d| within that radius */
  double linear_radius_m;    /* where that share reaches 0.05; at most 0.1 m */
  int32_t slack[8];          /* 1: this spring hangs slack at the equilibrium */
} ulna_springs_info;

/** A kind of spring to choose from.
 * @since 0.1 */
typedef struct ulna_spring_kind {
  double rate_n_m; /* above 0 */
  double rest_m;   /* relaxed length, above 0 */
  int64_t count;   /* how many there are; 0: enough */
} ulna_spring_kind;

/** What a choice of springs is to reach. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_springs_wish {
  int64_t struct_size;           /* sizeof(ulna_springs_wish) */
  double stiffness_n_m[4];       /* symmetric, positive definite */
  double centre_m[2];            /* of the frame */
  double half_m[2];              /* half sides of the frame; 0: 0.175 and 0.183, the thesis */
  double radius_m;               /* within which every spring stays taut; 0: 0.025 */
  double reach;                  /* share of the half sides within which the handle rests; 0: 1/3 */
  const ulna_spring_kind *kinds; /* to choose from; NULL: continuous rates */
  int64_t kind_count;            /* of kinds */
  double rest_m;                 /* relaxed length for continuous rates; 0: 0.09 */
  double max_rate_n_m;           /* for continuous rates; 0: no limit */
  double offset_m[2];            /* of the equilibrium from the centre, for continuous rates */
  int64_t seed;                  /* of the search; 0 is a seed */
  int32_t threads;               /* 0: one per processor; the choice does not depend on it */
  int32_t reserved;              /* zero */
} ulna_springs_wish;

/** The choice, at the eight places of the frame in the order of ulna_springs_frame.
 * @since 0.1 */
typedef struct ulna_springs_choice {
  int64_t struct_size; /* set by the caller to sizeof(ulna_springs_choice) */
  double rates_n_m[8]; /* 0: an empty place */
  double rests_m[8];   /* relaxed lengths */
  int32_t kinds[8];    /* which of the kinds; -1: empty, or continuous */
  double error;        /* |K - wanted| / |wanted|, Frobenius */
  int64_t evaluations; /* arrangements tried */
  int32_t taut;        /* 1: every spring stays taut within the radius */
  int32_t central;     /* 1: the handle rests within the reach */
  int32_t exhaustive;  /* 1: nothing else does better */
  int32_t reserved;    /* zero */
} ulna_springs_choice;

/** A calibration line, force = slope volts + intercept.
 * @since 0.1 */
typedef struct ulna_gauge_line {
  int64_t struct_size;     /* sizeof(ulna_gauge_line), set by the caller */
  double slope_n_v;        /* N/V */
  double intercept_n;      /* force at zero volts */
  double slope_se;         /* standard error, N/V */
  double intercept_se;     /* standard error, N */
  double covariance;       /* of slope and intercept, N^2/V */
  double r_squared;        /* weighted */
  double residual_n;       /* standard deviation of a point */
  double chi_square;       /* of the residuals in units of the errors given; NaN without */
  double fit_p;            /* chance of such a chi_square for a true line; NaN without */
  double curvature_p;      /* chance of such a curvature for a true line; NaN for three points */
  double largest_residual; /* studentised */
  double outlier_p;        /* chance of so large a residual for a true line; NaN for three points */
  int64_t largest_row;     /* the point that has it */
  int64_t points;          /* of the calibration */
} ulna_gauge_line;

/** How volts become forces. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_gauge_options {
  int64_t struct_size;              /* sizeof(ulna_gauge_options) */
  const ulna_gauge_line *x;         /* line of the sensor's first axis */
  const ulna_gauge_line *y;         /* line of its second axis */
  const char *volts;                /* word for two channels in V: first, then second axis */
  const char *angle;                /* channel in rad that the sensor turns with; NULL: none */
  const char *name;                 /* of the new channels, name_x and name_y; NULL: "F" */
  double calibration_lever_m;       /* lever arm of the calibration; 0: 0.0688 */
  double calibration_lever_error_m; /* its standard error */
  double lever_m;                   /* lever arm of this recording; 0: as calibrated */
  double lever_error_m;             /* its standard error */
  int64_t rest_begin;               /* rows without force that give the zero, first row */
  int64_t rest_end;                 /* one past the last; 0: zero from the intercepts */
  int32_t sign;                     /* -1 turns the force; 0 and 1 leave it */
  int32_t reserved;                 /* zero */
} ulna_gauge_options;

/** How accelerometer and encoders are compared. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_sensor_check_options {
  int64_t struct_size;                 /* sizeof(ulna_sensor_check_options) */
  const char *position;                /* word; NULL: by role */
  const char *acceleration;            /* word for as many channels */
  const ulna_prepare_options *prepare; /* filters of both; NULL: defaults */
  double highpass_hz;                  /* drift is removed below; 0: from the motion */
  double max_lag_s;                    /* looked for in either direction; 0: 0.25 */
} ulna_sensor_check_options;

/** A comparison of accelerometer and encoders.
 * @since 0.1 */
typedef struct ulna_sensor_check_info {
  int64_t struct_size;     /* set by the caller to sizeof(ulna_sensor_check_info) */
  int32_t axes;            /* n */
  int32_t worst;           /* ULNA_DISAGREE_... */
  int64_t findings;        /* in words */
  double turned_rad;       /* of the accelerometer's axes in the plane, n = 2 */
  double turned_error_rad; /* its standard error */
  double highpass_hz;      /* used */
  double lowpass_hz;       /* used; 0: none */
} ulna_sensor_check_info;

/** How robot parameters are identified. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_robot_fit_options {
  int64_t struct_size;                 /* sizeof(ulna_robot_fit_options) */
  const char *angle;                   /* word for the joint angles; NULL: theta, else q */
  const char *torque;                  /* word for the motor torques; NULL: tau */
  const char *reference;               /* word for the commanded angles; NULL: none */
  const char *force;                   /* word for an external force; NULL: none acted */
  const ulna_prepare_options *prepare; /* filters; NULL: defaults */
  int32_t dry_friction;                /* 1: a dry friction of each joint besides */
  int32_t estimator;                   /* ULNA_ESTIMATOR_... */
  double dry_threshold_rad_s;          /* speed within which it turns its sign; 0: 0.02 */
  double train_s;                      /* identify from; 0: 40 s, at most 80 % of a trial */
  double lag_s;                        /* of the Newey-West errors; 0: 0.4 s */
  double condition_limit;              /* above it the call fails; 0: 1000 */
} ulna_robot_fit_options;

/** Identified robot parameters.
 * @since 0.1 */
typedef struct ulna_robot_fit_info {
  int64_t struct_size;         /* set by the caller to sizeof(ulna_robot_fit_info) */
  int32_t parameters;          /* p */
  int32_t estimator;           /* ULNA_ESTIMATOR_LEAST_SQUARES or _INSTRUMENTAL */
  int32_t feasible;            /* 1: a body can have these parameters */
  int32_t reserved;            /* zero */
  double condition;            /* of the regressor, in unit columns */
  double difference_p;         /* test that both estimators agree; NaN with one */
  double least_inertia_kg_m2;  /* smallest eigenvalue of I over all poses */
  double least_friction;       /* smallest friction coefficient */
  double feasible_probability; /* over draws from the covariance */
  double lowpass_hz;           /* of torque and regressor */
  double wide_hz;              /* of the angles that the regressor is formed from */
  double train_s;              /* identified from, of a trial */
  int64_t train_rows;          /* samples of it */
  int64_t held_out_rows;       /* samples validated on */
} ulna_robot_fit_info;

/** How a force is computed from motion and torques, and what is known of the errors. Zero bytes
 * mean the defaults named here; errors are standard deviations.
 * @since 0.1 */
typedef struct ulna_virtual_options {
  int64_t struct_size;                   /* sizeof(ulna_virtual_options) */
  const char *angle;                     /* word for the joint angles; NULL: theta, else q */
  const char *torque;                    /* word for the motor torques; NULL: tau */
  const char *acceleration;              /* word for the accelerometer; NULL: differentiate */
  const char *reference;                 /* word for commanded angles or positions; NULL: none */
  const ulna_prepare_options *prepare;   /* filters; NULL: four times the motion's band */
  const ulna_view *parameter_covariance; /* p x p; NULL: exact */
  double least_quality;                  /* of the Jacobian, below it the call fails; 0: 0.05 */
  double torque_scale_error;             /* relative */
  double acceleration_scale_error;       /* relative */
  double torque_noise_nm;                /* of a sample */
  double angle_noise_rad;                /* of a sample */
  double angle_step_rad;                 /* of the encoders */
  double acceleration_noise_m_s2;        /* of a sample */
} ulna_virtual_options;

/** What a computed force is made of.
 * @since 0.1 */
typedef struct ulna_sensed_info {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_sensed_info) */
  int64_t rows;          /* of its record */
  int32_t axes;          /* of the force */
  int32_t constants;     /* whose errors are known */
  int32_t accelerometer; /* 1: accelerations were measured */
  int32_t reserved;      /* zero */
  double worst_quality;  /* smallest over largest singular value of J; 1 for other sensors */
  int64_t worst_row;     /* of the source record */
  double lowpass_hz;     /* of the signals; 0: none */
} ulna_sensed_info;

/** A record whose forces were computed, with what is known of their errors; immutable.
 * @since 0.1 */
typedef struct ulna_sensed ulna_sensed;

/** What the errors of a computed force do to an impedance; immutable.
 * @since 0.1 */
typedef struct ulna_force_budget ulna_force_budget;

/** A comparison of accelerometer and encoders; immutable.
 * @since 0.1 */
typedef struct ulna_sensor_check ulna_sensor_check;

/** Identified robot parameters with their uncertainty; immutable.
 * @since 0.1 */
typedef struct ulna_robot_fit ulna_robot_fit;

/** Places k1 to k8 of a frame, 8 x 2, m: (-x,-y) (-x,0) (-x,+y) (0,+y) (+x,+y) (+x,0) (+x,-y)
 * (0,-y). half_x_m and half_y_m 0: 0.175 and 0.183, the thesis.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_springs_frame(double half_x_m, double half_y_m, double centre_x_m,
                                        double centre_y_m, double *out, int64_t capacity,
                                        int64_t *out_count);

/** Force of the springs on the handle at each position (rows x 2), N, rows x 2. (D.1), without the
 * push of a slack spring.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_springs_force(const ulna_spring *springs, int64_t count,
                                        const ulna_view *position, double *out, int64_t capacity,
                                        int64_t *out_count);

/** Stiffness -dF/dx at each position (rows x 2), N/m, rows x 4.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_springs_stiffness(const ulna_spring *springs, int64_t count,
                                            const ulna_view *position, double *out,
                                            int64_t capacity, int64_t *out_count);

/** Equilibrium, stiffness and range of linearity within radius_m (0: 0.025). The energy is convex,
 * so an equilibrium with stiffness in every direction is the only one; fails with
 * ULNA_ERROR_ANALYSIS when there is none.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_springs_equilibrium(const ulna_spring *springs, int64_t count,
                                              double radius_m, ulna_springs_info *out_info);

/** Chooses springs for a wanted stiffness: exactly for continuous rates and for few kinds, by a
 * search from several starts for many.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_springs_choose(const ulna_springs_wish *wish, ulna_token *token,
                                         ulna_springs_choice *out_choice);

/** The impedance of the hand: measured less the empty rig, both natural parameters with their
 * covariance; quantity ULNA_TARE_...
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_tare_impedance(const ulna_view *measured,
                                         const ulna_view *measured_covariance, const ulna_view *rig,
                                         const ulna_view *rig_covariance, int32_t quantity,
                                         double *out, int64_t capacity, int64_t *out_count);

/** The record with forces of the hand alone, F + M_r x'' + B_r x' + K_r (x - x_r), the rig given by
 * natural parameters. Rows at the ends where the differentiation starts and stops are left out.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_tare_record(const ulna_record *record,
                                      const ulna_prepare_options *prepare, const ulna_view *rig,
                                      const ulna_view *rig_covariance, ulna_token *token,
                                      ulna_sensed **out_sensed);

/** Calibration line by weighted least squares of forces on volts (columns). errors: standard
 * deviation of every force, NULL for equal ones; relative 1: they are weights only.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_gauge_calibrate(const ulna_view *volts, const ulna_view *forces,
                                          const ulna_view *errors, int32_t relative,
                                          ulna_gauge_line *out_line);

/** The published line (E.2) of axis 0 or 1.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_gauge_published(int32_t axis, ulna_gauge_line *out_line);

/** Force channels from volts: calibration lines, lever arm (E.3), turn to the world (E.4).
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_gauge_apply(const ulna_record *record, const ulna_gauge_options *options,
                                      ulna_sensed **out_sensed);

/** The force on a robot's handle from its motion and torques, F = J^-T (I q'' + C q' + F_r - tau).
 * Fails with ULNA_ERROR_DATA near a singular pose, with its row.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_virtual_sense(const ulna_record *record, const ulna_robot *robot,
                                        const ulna_virtual_options *options, ulna_token *token,
                                        ulna_sensed **out_sensed);

/** Frees a computed force; NULL is allowed.
 * @thread exclusive sensed
 * @since 0.1 */
ULNA_API void ulna_sensed_free(ulna_sensed *sensed);

/** What it is made of.
 * @thread shared sensed
 * @since 0.1 */
ULNA_API ulna_status ulna_sensed_get_info(const ulna_sensed *sensed, ulna_sensed_info *out_info);

/** A record of its own with the computed forces, ready for an identification by role.
 * @thread shared sensed
 * @since 0.1 */
ULNA_API ulna_status ulna_sensed_get_record(const ulna_sensed *sensed, ulna_record **out_record);

/** Standard deviations and covariance, ULNA_SENSED_..., row by row.
 * @thread shared sensed
 * @since 0.1 */
ULNA_API ulna_status ulna_sensed_get_values(const ulna_sensed *sensed, int32_t quantity,
                                            double *out, int64_t capacity, int64_t *out_count);

/** Names of the constants whose errors are known, one a line.
 * @thread shared sensed
 * @since 0.1 */
ULNA_API ulna_status ulna_sensed_get_names(const ulna_sensed *sensed, char *out_text,
                                           int64_t capacity, int64_t *out_size);

/** What these errors do to an impedance that was identified from the sensed record.
 * @thread shared sensed
 * @since 0.1 */
ULNA_API ulna_status ulna_force_budget_new(const ulna_sensed *sensed,
                                           const ulna_impedance *impedance, ulna_token *token,
                                           ulna_force_budget **out_budget);

/** Frees a budget; NULL is allowed.
 * @thread exclusive budget
 * @since 0.1 */
ULNA_API void ulna_force_budget_free(ulna_force_budget *budget);

/** Numbers of a budget, ULNA_BUDGET_..., row by row.
 * @thread shared budget
 * @since 0.1 */
ULNA_API ulna_status ulna_force_budget_get_values(const ulna_force_budget *budget, int32_t quantity,
                                                  double *out, int64_t capacity,
                                                  int64_t *out_count);

/** Compares accelerometer and encoders: the one integrated twice, slow drift removed from both by
 * the same operator.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sensor_check_new(const ulna_record *record,
                                           const ulna_sensor_check_options *options,
                                           ulna_token *token, ulna_sensor_check **out_check);

/** Frees a comparison; NULL is allowed.
 * @thread exclusive check
 * @since 0.1 */
ULNA_API void ulna_sensor_check_free(ulna_sensor_check *check);

/** What was compared and what is worst.
 * @thread shared check
 * @since 0.1 */
ULNA_API ulna_status ulna_sensor_check_get_info(const ulna_sensor_check *check,
                                                ulna_sensor_check_info *out_info);

/** Numbers of a comparison, ULNA_SENSOR_CHECK_..., row by row.
 * @thread shared check
 * @since 0.1 */
ULNA_API ulna_status ulna_sensor_check_get_values(const ulna_sensor_check *check, int32_t quantity,
                                                  double *out, int64_t capacity,
                                                  int64_t *out_count);

/** What disagrees, in words, 0 <= index < findings.
 * @thread shared check
 * @since 0.1 */
ULNA_API ulna_status ulna_sensor_check_get_finding(const ulna_sensor_check *check, int64_t index,
                                                   ulna_finding *out_finding);

/** Names of the channels, ULNA_SENSOR_CHECK_TEXT_...
 * @thread shared check
 * @since 0.1 */
ULNA_API ulna_status ulna_sensor_check_get_text(const ulna_sensor_check *check, int32_t which,
                                                char *out_text, int64_t capacity,
                                                int64_t *out_size);

/** Identifies the parameters of a robot from a recording, (A.5). Fails with ULNA_ERROR_ANALYSIS
 * when the motion does not determine them.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_fit_new(const ulna_record *record, const ulna_robot *robot,
                                        const ulna_robot_fit_options *options, ulna_token *token,
                                        ulna_robot_fit **out_fit);

/** Frees a fit; NULL is allowed.
 * @thread exclusive fit
 * @since 0.1 */
ULNA_API void ulna_robot_fit_free(ulna_robot_fit *fit);

/** What the fit is about.
 * @thread shared fit
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_fit_get_info(const ulna_robot_fit *fit,
                                             ulna_robot_fit_info *out_info);

/** Numbers of a fit, ULNA_ROBOT_FIT_..., row by row.
 * @thread shared fit
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_fit_get_values(const ulna_robot_fit *fit, int32_t quantity,
                                               double *out, int64_t capacity, int64_t *out_count);

/** Text of a fit, ULNA_ROBOT_FIT_TEXT_...
 * @thread shared fit
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_fit_get_text(const ulna_robot_fit *fit, int32_t which,
                                             char *out_text, int64_t capacity, int64_t *out_size);

/** Whether parameters can belong to a body: smallest eigenvalue of the inertia matrix over all
 * poses, kg m^2, which must be above zero, and smallest friction coefficient, at least zero.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_robot_feasible(const ulna_robot *robot, const ulna_view *parameters,
                                         double *out_inertia_kg_m2, double *out_friction);

#ifdef __cplusplus
}
#endif

#endif
