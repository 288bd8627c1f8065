/* Mechanical impedance of a limb, at a hand (n = 2, 3, ...) or a joint (n = 1), from a perturbation
 * experiment:
 *
 *     M x'' + B x' + K (x - x0) = -F        (3.2) of Dyck 2013
 *
 * x: position of the hand or joint, m or rad. F: force or torque by the human on the robot, N or
 * Nm. M kg or kg m^2, B N s/m or N m s/rad, K N/m or N m/rad, x0 m or rad. "Natural" parameters are
 * M, B and K row by row, then x0: 3 n^2 + n values. */
#ifndef ULNA_IMPEDANCE_H
#define ULNA_IMPEDANCE_H

#include <ulna/base.h>
#include <ulna/ident.h>
#include <ulna/record.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Every entry of M, B and K is free. @since 0.1 */
#define ULNA_MODEL_FREE (0)
/** M, B and K are symmetric. @since 0.1 */
#define ULNA_MODEL_SYMMETRIC (1)
/** M, B and K are symmetric and positive semidefinite. @since 0.1 */
#define ULNA_MODEL_PASSIVE (2)

/** Instrumental variables where the record holds a reference for every axis, else least squares.
 * @since 0.1 */
#define ULNA_ESTIMATOR_AUTO (0)
/** Least squares: biased when the human causes part of the motion. @since 0.1 */
#define ULNA_ESTIMATOR_LEAST_SQUARES (1)
/** Instrumental variables from the reference. @since 0.1 */
#define ULNA_ESTIMATOR_INSTRUMENTAL (2)

/** Newey-West standard errors. @since 0.1 */
#define ULNA_ERRORS_NEWEY_WEST (0)
/** Bootstrap over blocks: the record's segments, or stretches of block_s. @since 0.1 */
#define ULNA_ERRORS_BLOCK_BOOTSTRAP (1)

/** Report all data when trials hold several segments, else the identification part. @since 0.1 */
#define ULNA_REFIT_AUTO (0)
/** Report a fit to all data, once validated on the held-out part. @since 0.1 */
#define ULNA_REFIT_YES (1)
/** Report the fit to the identification part. @since 0.1 */
#define ULNA_REFIT_NO (2)

/** Outcome bit: least squares differs significantly from instrumental variables. @since 0.1 */
#define ULNA_OUTCOME_CLOSED_LOOP_BIASED (1)
/** Outcome bit: the model accounts for too little of the held-out force, and the human's own force
 * is not the reason. @since 0.1 */
#define ULNA_OUTCOME_POOR_FIT (2)
/** Outcome bit: the data hardly determine some direction. @since 0.1 */
#define ULNA_OUTCOME_ILL_CONDITIONED (4)
/** Outcome bit: force and motion seem not to be simultaneous. @since 0.1 */
#define ULNA_OUTCOME_FORCE_LAG (8)
/** Outcome bit: the constrained fit did not converge. @since 0.1 */
#define ULNA_OUTCOME_NOT_CONVERGED (16)
/** Outcome bit: x0 is undefined since K is singular. @since 0.1 */
#define ULNA_OUTCOME_NOT_FINITE (32)
/** Outcome bit: no reference, so the cause of the motion could not be checked. @since 0.1 */
#define ULNA_OUTCOME_UNCHECKED (64)

/** Outcome bit: the record holds something to check first, as a unit that looks wrong. @since 0.1
 */
#define ULNA_OUTCOME_SUSPECT_DATA (128)

/** The estimate that is reported. @since 0.1 */
#define ULNA_FIT_REPORTED (0)
/** The other estimator on the same data: least squares beside instrumental variables. @since 0.1 */
#define ULNA_FIT_ALTERNATIVE (1)

/** Inertia, n x n. @since 0.1 */
#define ULNA_IMPEDANCE_M (0)
/** Damping, n x n. @since 0.1 */
#define ULNA_IMPEDANCE_B (1)
/** Stiffness, n x n. @since 0.1 */
#define ULNA_IMPEDANCE_K (2)
/** Equilibrium position, n. @since 0.1 */
#define ULNA_IMPEDANCE_X0 (3)
/** Covariance of the natural parameters, square. @since 0.1 */
#define ULNA_IMPEDANCE_COVARIANCE (4)
/** Draws of the natural parameters, one a row: Gaussian, or bootstrap replicates. @since 0.1 */
#define ULNA_IMPEDANCE_DRAWS (5)
/** Variance accounted for on held-out data, percent, n. (3.10) of Dyck 2013. @since 0.1 */
#define ULNA_IMPEDANCE_VAF (6)
/** Its 95 % interval, 2 x n: low, high. @since 0.1 */
#define ULNA_IMPEDANCE_VAF_INTERVAL (7)
/** Variance accounted for on the identification part, percent, n. @since 0.1 */
#define ULNA_IMPEDANCE_VAF_TRAIN (8)
/** Frequencies of the motion share, Hz; empty without a reference. @since 0.1 */
#define ULNA_IMPEDANCE_MOTION_FREQUENCY (9)
/** Share of the motion's power that the reference does not explain, frequencies x n. @since 0.1 */
#define ULNA_IMPEDANCE_MOTION_SHARE (10)
/** The same over the whole band, n. @since 0.1 */
#define ULNA_IMPEDANCE_MOTION_TOTAL (11)
/** Natural parameters of every trial, one a row; empty for one trial. @since 0.1 */
#define ULNA_IMPEDANCE_TRIALS (12)
/** Their mean over trials; empty for one trial. @since 0.1 */
#define ULNA_IMPEDANCE_TRIAL_MEAN (13)
/** Standard error of that mean; empty for one trial. @since 0.1 */
#define ULNA_IMPEDANCE_TRIAL_ERROR (14)

/** Variance accounted for of the force that the perturbation caused, percent, n: the human's own
 * force does not lower it. NaN without a reference. @since 0.1 */
#define ULNA_IMPEDANCE_VAF_REFERENCE (15)

/** Time of the prepared rows, s. @since 0.1 */
#define ULNA_SIGNAL_TIME (0)
/** Prepared position, rows x n. @since 0.1 */
#define ULNA_SIGNAL_POSITION (1)
/** Prepared velocity, rows x n. @since 0.1 */
#define ULNA_SIGNAL_VELOCITY (2)
/** Prepared acceleration, rows x n. @since 0.1 */
#define ULNA_SIGNAL_ACCELERATION (3)
/** Prepared force, rows x n. @since 0.1 */
#define ULNA_SIGNAL_FORCE (4)
/** Force that the fit predicts, rows x n. @since 0.1 */
#define ULNA_SIGNAL_FORCE_PREDICTED (5)
/** Use of each row: 0 not used, 1 identification, 2 held out. @since 0.1 */
#define ULNA_SIGNAL_USE (6)

/** Warnings, one sentence a line. @since 0.1 */
#define ULNA_TEXT_WARNINGS (0)
/** Notes, one sentence a line. @since 0.1 */
#define ULNA_TEXT_NOTES (1)
/** Provenance, one step a line. @since 0.1 */
#define ULNA_TEXT_PROVENANCE (2)
/** Names of the axes, one a line. @since 0.1 */
#define ULNA_TEXT_AXES (3)

/** An identified impedance with its uncertainty; immutable.
 * @since 0.1 */
typedef struct ulna_impedance ulna_impedance;

/** How an impedance is identified. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_impedance_options {
  int64_t struct_size;                 /* sizeof(ulna_impedance_options) */
  const ulna_prepare_options *prepare; /* channels and filters; NULL: defaults */
  int32_t model;                       /* ULNA_MODEL_... */
  int32_t no_damping;                  /* 1: B = 0 */
  int32_t diagonal_mass;               /* 1: M = m I */
  int32_t estimator;                   /* ULNA_ESTIMATOR_... */
  int32_t errors;                      /* ULNA_ERRORS_... */
  int32_t refit;                       /* ULNA_REFIT_... */
  double payload_kg; /* known mass between sensor and hand, removed from M; kg m^2 for a joint */
  double train_s;    /* identify from the first train_s of every trial; 0: 40 s, at most 80 % */
  double lag_s;      /* of the Newey-West errors; 0: 0.4 s */
  double block_s;    /* of the bootstrap; 0: 2 s */
  double condition_limit; /* above it the call fails; 0: 1000 */
  double poor_vaf;        /* percent, below it the fit is called poor; 0: 80 */
  int64_t bootstrap;      /* resamples; 0: 1000 */
  int64_t draws;          /* for derived intervals; 0: 4000 */
  int64_t seed;           /* of draws and resamples; 0 is a seed */
  int32_t threads;        /* 0: one per processor; results do not depend on it */
  int32_t reserved;       /* zero */
} ulna_impedance_options;

/** What an estimate is about.
 * @since 0.1 */
typedef struct ulna_impedance_info {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_impedance_info) */
  int32_t axes;          /* n */
  int32_t rotational;    /* 1: rad and Nm; 0: m and N */
  int32_t fits;          /* 1, or 2 with an alternative */
  int32_t refitted;      /* 1: the reported parameters are of all data */
  int64_t trials;        /* prepared trials */
  int64_t train_rows;    /* samples identified from, before a refit */
  int64_t held_out_rows; /* samples validated on */
  double train_s;        /* 0 when the split is by segments */
  double payload_kg;     /* removed from M */
  double lag_s;          /* force later than motion; NaN when it could not be checked */
  double lag_error_s;    /* its standard error */
  double difference_p;   /* test that both estimators agree; NaN with one fit */
} ulna_impedance_info;

/** One fit of an estimate.
 * @since 0.1 */
typedef struct ulna_fit_info {
  int64_t struct_size; /* set by the caller to sizeof(ulna_fit_info) */
  int32_t estimator;   /* ULNA_ESTIMATOR_LEAST_SQUARES or _INSTRUMENTAL */
  uint32_t outcome;    /* ULNA_OUTCOME_... bits; 0: good */
  int32_t constrained; /* 1: a positive-semidefinite constraint is active */
  int32_t reserved;    /* zero */
  double condition;    /* of the regressors, in unit columns */
} ulna_fit_info;

/** Ellipse of the symmetric part of a 2 x 2 matrix, and its antisymmetric part. (3.11)-(3.17),
 * (3.26) of Dyck 2013, with (3.17) by atan2. Intervals are NaN where there are none.
 * @since 0.1 */
typedef struct ulna_ellipse {
  int64_t struct_size;             /* set by the caller to sizeof(ulna_ellipse) */
  double major;                    /* larger eigenvalue of the symmetric part, unit of the matrix */
  double minor;                    /* smaller eigenvalue */
  double area;                     /* pi major minor */
  double shape;                    /* major / minor; NaN unless minor > 0 */
  double angle_rad;                /* of the major axis to +x, in [0, pi) */
  double antisymmetric;            /* (z_xy - z_yx) / 2 */
  double antisymmetry;             /* its size over sqrt(major minor) */
  int32_t angle_defined;           /* 0: isotropic, or not distinguishable from it */
  int32_t reserved;                /* zero */
  double major_interval[2];        /* low, high */
  double minor_interval[2];        /* low, high */
  double area_interval[2];         /* low, high */
  double shape_interval[2];        /* low, high */
  double angle_interval_rad[2];    /* low, high, around angle_rad: may leave [0, pi) */
  double antisymmetry_interval[2]; /* low, high */
} ulna_ellipse;

/** Identifies the impedance from a record. Fails with ULNA_ERROR_DATA or _ARGUMENT as ulna_prepare,
 * and with ULNA_ERROR_ANALYSIS when the motion does not determine the parameters; the message then
 * names the direction. Look at the outcome of the fit before use.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_identify(const ulna_record *record,
                                             const ulna_impedance_options *options,
                                             ulna_token *token, ulna_impedance **out_impedance);

/** Frees an estimate; NULL is allowed.
 * @thread exclusive impedance
 * @since 0.1 */
ULNA_API void ulna_impedance_free(ulna_impedance *impedance);

/** What the estimate is about.
 * @thread shared impedance
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_get_info(const ulna_impedance *impedance,
                                             ulna_impedance_info *out_info);

/** What the filters did.
 * @thread shared impedance
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_get_preparation(const ulna_impedance *impedance,
                                                    ulna_prepare_report *out_report);

/** Estimator, outcome and conditioning of a fit (ULNA_FIT_...).
 * @thread shared impedance
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_get_fit(const ulna_impedance *impedance, int32_t fit,
                                            ulna_fit_info *out_info);

/** Numbers of a fit (ULNA_FIT_...): quantity ULNA_IMPEDANCE_...; matrices row by row.
 * @thread shared impedance
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_get_values(const ulna_impedance *impedance, int32_t fit,
                                               int32_t quantity, double *out, int64_t capacity,
                                               int64_t *out_count);

/** Prepared signals of a trial, with the force that a fit predicts: ULNA_SIGNAL_..., row by row.
 * @thread shared impedance
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_get_signals(const ulna_impedance *impedance, int32_t fit,
                                                int64_t trial, int32_t signal, double *out,
                                                int64_t capacity, int64_t *out_count);

/** Text of the estimate: ULNA_TEXT_...
 * @thread shared impedance
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_get_text(const ulna_impedance *impedance, int32_t which,
                                             char *out_text, int64_t capacity, int64_t *out_size);

/** Ellipse of M, B or K of a fit (n = 2) with percentile intervals of the given level, as 0.95.
 * @thread shared impedance
 * @since 0.1 */
ULNA_API ulna_status ulna_impedance_get_ellipse(const ulna_impedance *impedance, int32_t fit,
                                                int32_t quantity, double level,
                                                ulna_ellipse *out_ellipse);

/** Ellipse of any finite 2 x 2 matrix.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_ellipse_of(const ulna_view *matrix, ulna_ellipse *out_ellipse);

#ifdef __cplusplus
}
#endif

#endif
