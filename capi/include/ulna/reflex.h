/* What reacts late: intrinsic and reflex torque of a joint (parallel cascade), an impedance with
 * delayed feedback, and the first window after a perturbation against what follows.
 *
 * Sign: forces and torques are those of the human on the robot. A positive reflex gain resists the
 * motion. Units as in impedance.h. */
#ifndef ULNA_REFLEX_H
#define ULNA_REFLEX_H

#include <ulna/base.h>
#include <ulna/ident.h>
#include <ulna/impedance.h>
#include <ulna/record.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Intrinsic path M x'' + B x' + K x. @since 0.1 */
#define ULNA_INTRINSIC_SECOND_ORDER (0)
/** Intrinsic path a two-sided impulse response of the position. @since 0.1 */
#define ULNA_INTRINSIC_IMPULSE_RESPONSE (1)

/** Outcome bit: no reflex path is shown; its numbers mean nothing. @since 0.1 */
#define ULNA_REFLEX_NOT_SIGNIFICANT (1)
/** Outcome bit: the delay lies at the end of its range. @since 0.1 */
#define ULNA_REFLEX_DELAY_AT_BOUND (2)
/** Outcome bit: frequency or damping ratio lie at the end of their range. @since 0.1 */
#define ULNA_REFLEX_DYNAMICS_AT_BOUND (4)
/** Outcome bit: both paths account for too little of the torque. @since 0.1 */
#define ULNA_REFLEX_POOR_FIT (8)
/** Outcome bit: the search did not converge. @since 0.1 */
#define ULNA_REFLEX_NOT_CONVERGED (16)
/** Outcome bit: too few blocks for a test. @since 0.1 */
#define ULNA_REFLEX_UNTESTED (32)
/** The inertia is negative: the torque has the wrong sign, or another unit. @since 0.1 */
#define ULNA_REFLEX_SUSPECT_DATA (64)

/** M, B, K, gain, omega, zeta, delay: 7 values; zeta is NaN for order 1. @since 0.1 */
#define ULNA_REFLEX_PARAMETERS (0)
/** Their covariance, 7 x 7. @since 0.1 */
#define ULNA_REFLEX_COVARIANCE (1)
/** Their 95 % intervals, 2 x 7: lows, then highs. The delay's is that of its profile. @since 0.1 */
#define ULNA_REFLEX_INTERVALS (2)
/** Coefficients of the square, cube, ... of the position about its mean. @since 0.1 */
#define ULNA_REFLEX_POWERS (3)
/** Their standard errors. @since 0.1 */
#define ULNA_REFLEX_POWERS_ERROR (4)
/** Delays of the profile, s. @since 0.1 */
#define ULNA_REFLEX_PROFILE_DELAY (5)
/** VAF of the identification part at each, all else refitted, percent. @since 0.1 */
#define ULNA_REFLEX_PROFILE_VAF (6)
/** Lags of the intrinsic impulse response, s; empty when the trials are too short. @since 0.1 */
#define ULNA_REFLEX_INTRINSIC_LAG (7)
/** Intrinsic impulse response, N m/rad a lag. @since 0.1 */
#define ULNA_REFLEX_INTRINSIC_RESPONSE (8)
/** Its standard error. @since 0.1 */
#define ULNA_REFLEX_INTRINSIC_ERROR (9)
/** Lags of the reflex impulse response, s. @since 0.1 */
#define ULNA_REFLEX_REFLEX_LAG (10)
/** Reflex impulse response, N m/rad: its integral is the gain. @since 0.1 */
#define ULNA_REFLEX_REFLEX_RESPONSE (11)
/** Its standard error. @since 0.1 */
#define ULNA_REFLEX_REFLEX_ERROR (12)

/** Time of the prepared rows, s. @since 0.1 */
#define ULNA_REFLEX_SIGNAL_TIME (0)
/** Prepared torque. @since 0.1 */
#define ULNA_REFLEX_SIGNAL_TORQUE (1)
/** Intrinsic torque, in the sign of the torque; NaN where it is not known. @since 0.1 */
#define ULNA_REFLEX_SIGNAL_INTRINSIC (2)
/** Reflex torque, in the sign of the torque; NaN where it is not known. @since 0.1 */
#define ULNA_REFLEX_SIGNAL_REFLEX (3)
/** Rectified velocity. @since 0.1 */
#define ULNA_REFLEX_SIGNAL_DRIVE (4)
/** Use of each row: 0 not used, 1 identification, 2 held out. @since 0.1 */
#define ULNA_REFLEX_SIGNAL_USE (5)

/** Outcome bit: no delayed feedback is shown. @since 0.1 */
#define ULNA_DELAYED_NOT_SIGNIFICANT (1)
/** Outcome bit: the delay's interval reaches the end of its range. @since 0.1 */
#define ULNA_DELAYED_AT_BOUND (2)
/** Outcome bit: the motion hardly tells the immediate from the delayed. @since 0.1 */
#define ULNA_DELAYED_ILL_CONDITIONED (4)
/** Outcome bit: the model accounts for too little of the force. @since 0.1 */
#define ULNA_DELAYED_POOR_FIT (8)
/** Outcome bit: too few blocks for a test. @since 0.1 */
#define ULNA_DELAYED_UNTESTED (16)
/** The inertia is negative: the force has the wrong sign, or other axes. @since 0.1 */
#define ULNA_DELAYED_SUSPECT_DATA (32)

/** M, B, K, K_d, B_d row by row, x0, delay: 5 n^2 + n + 1 values. @since 0.1 */
#define ULNA_DELAYED_PARAMETERS (0)
/** Their covariance, square. @since 0.1 */
#define ULNA_DELAYED_COVARIANCE (1)
/** VAF per axis on held-out data, percent; NaN without any. @since 0.1 */
#define ULNA_DELAYED_VAF (2)
/** The same of the best fit without delayed feedback. @since 0.1 */
#define ULNA_DELAYED_VAF_WITHOUT (3)
/** Delays of the profile, s. @since 0.1 */
#define ULNA_DELAYED_PROFILE_DELAY (4)
/** Chi-square of one degree of each against the best. @since 0.1 */
#define ULNA_DELAYED_PROFILE_STATISTIC (5)

/** Outcome bit: the low pass reaches across the border of the windows. @since 0.1 */
#define ULNA_WINDOWS_SMEARED (1)
/** Outcome bit: the windows hardly determine some direction. @since 0.1 */
#define ULNA_WINDOWS_ILL_CONDITIONED (2)
/** Outcome bit: too few perturbations for a test. @since 0.1 */
#define ULNA_WINDOWS_UNTESTED (4)

/** M, B, K in the window, row by row: 3 n^2. @since 0.1 */
#define ULNA_WINDOWS_EARLY (0)
/** Their covariance, square. @since 0.1 */
#define ULNA_WINDOWS_EARLY_COVARIANCE (1)
/** M, B, K after the window, row by row. @since 0.1 */
#define ULNA_WINDOWS_LATE (2)
/** Their covariance, square. @since 0.1 */
#define ULNA_WINDOWS_LATE_COVARIANCE (3)
/** Covariance of late - early, square. @since 0.1 */
#define ULNA_WINDOWS_DIFFERENCE_COVARIANCE (4)
/** VAF per axis in the window, percent. @since 0.1 */
#define ULNA_WINDOWS_EARLY_VAF (5)
/** VAF per axis after it, percent. @since 0.1 */
#define ULNA_WINDOWS_LATE_VAF (6)
/** Onsets used, s. @since 0.1 */
#define ULNA_WINDOWS_ONSETS (7)

/** Both paths of a joint with their uncertainty; immutable.
 * @since 0.1 */
typedef struct ulna_reflex ulna_reflex;

/** An impedance with delayed feedback; immutable.
 * @since 0.1 */
typedef struct ulna_delayed ulna_delayed;

/** Impedance in a window and after it; immutable.
 * @since 0.1 */
typedef struct ulna_windows ulna_windows;

/** How the paths are identified. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_reflex_options {
  int64_t struct_size;                 /* sizeof(ulna_reflex_options) */
  const ulna_prepare_options *prepare; /* channels and filters; NULL: defaults */
  int32_t intrinsic;                   /* ULNA_INTRINSIC_... */
  int32_t side;            /* +1: rising position excites, -1: falling, 0: the better of both */
  int32_t order;           /* of the reflex dynamics, 1 or 2; 0: 2 */
  int32_t position_powers; /* highest power of the position, 1 to 5; 0: 1 */
  int32_t drift;           /* order of each segment's polynomial offset, 0 to 3 */
  int32_t refit;           /* ULNA_REFIT_... */
  double threshold;        /* velocity that excites nothing, rad/s (m/s); 0: none */
  double delay_min_s;      /* 0 */
  double delay_max_s;      /* 0: 0.12 */
  double intrinsic_irf_s;  /* reach of the intrinsic impulse response; 0: 0.04 */
  double reflex_irf_s;     /* length of the reflex impulse response; 0: 0.4; < 0: none is made */
  double train_s;          /* identify from the first train_s of a trial; 0: 40 s, at most 80 % */
  double lag_s;            /* of the Newey-West errors; 0: 0.4 s */
  double block_s;          /* of the test and of the VAF's interval; 0: 1 s */
  double level;            /* of the test; 0: 0.05 */
  double poor_vaf;         /* percent, below it the fit is called poor; 0: 80 */
  int64_t draws;           /* of the test; 0: 1999 */
  int64_t seed;            /* 0 is a seed */
  int32_t threads;         /* 0: one per processor */
  int32_t reserved;        /* zero */
} ulna_reflex_options;

/** What was found.
 * @since 0.1 */
typedef struct ulna_reflex_info {
  int64_t struct_size;      /* set by the caller to sizeof(ulna_reflex_info) */
  uint32_t outcome;         /* ULNA_REFLEX_... bits; 0: good */
  int32_t rotational;       /* 1: rad and Nm; 0: m and N */
  int32_t side;             /* +1 or -1 */
  int32_t refitted;         /* 1: the parameters are of all data */
  double p_value;           /* that there is no reflex path; NaN with too few blocks */
  double vaf;               /* held out, percent, of both paths; NaN where nothing is held out */
  double vaf_interval[2];   /* low, high */
  double vaf_intrinsic;     /* of the intrinsic path alone */
  double vaf_reflex;        /* of the reflex path alone */
  double vaf_without;       /* of the best fit without a reflex path */
  double gain_interval[2];  /* of vaf - vaf_without: low, high */
  double vaf_train;         /* of both paths on the data of the fit */
  double vaf_train_without; /* of the best fit without a reflex path on the data of the fit */
  double vaf_train_other;   /* of the other side; NaN when the side was given */
  double vaf_impulse;       /* held out, of both impulse responses */
  double impulse_penalty;   /* on the roughness of the reflex response, by cross-validation */
  double position_mean;     /* about which powers of the position count */
  double train_s;           /* 0 when the split is by segments */
  int64_t train_rows;       /* samples */
  int64_t held_out_rows;    /* samples */
  int64_t test_blocks;      /* of the test */
  int64_t trials;           /* with signals each */
} ulna_reflex_info;

/** How delayed feedback is identified. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_delayed_options {
  int64_t struct_size;                 /* sizeof(ulna_delayed_options) */
  const ulna_prepare_options *prepare; /* channels and filters; NULL: defaults */
  int32_t estimator;                   /* ULNA_ESTIMATOR_... */
  int32_t refit;                       /* ULNA_REFIT_... */
  double delay_min_s;                  /* 0: 0.02; < 0: 0 */
  double delay_max_s;                  /* 0: 0.25 */
  double train_s;         /* identify from the first train_s of a trial; 0: 40 s, at most 80 % */
  double lag_s;           /* of the Newey-West errors; 0: 0.4 s */
  double block_s;         /* of the test; 0: 2 s */
  double level;           /* of the test; 0: 0.05 */
  double condition_limit; /* above it the call fails; 0: 1000 */
  double poor_vaf;        /* percent, below it the fit is called poor; 0: 80 */
  int64_t draws;          /* of the test; 0: 1999 */
  int64_t seed;           /* 0 is a seed */
  int32_t threads;        /* 0: one per processor */
  int32_t reserved;       /* zero */
} ulna_delayed_options;

/** What was found.
 * @since 0.1 */
typedef struct ulna_delayed_info {
  int64_t struct_size;      /* set by the caller to sizeof(ulna_delayed_info) */
  int32_t axes;             /* n */
  int32_t rotational;       /* 1: rad and Nm; 0: m and N */
  uint32_t outcome;         /* ULNA_DELAYED_... bits; 0: good */
  int32_t estimator;        /* ULNA_ESTIMATOR_LEAST_SQUARES or _INSTRUMENTAL */
  int32_t refitted;         /* 1: the parameters are of all data */
  int32_t reserved;         /* zero */
  double delay_s;           /* tau */
  double delay_interval[2]; /* 95 %, of the profile: low, high */
  double p_value;           /* that there is no delayed feedback; NaN with too few blocks */
  double condition;         /* of the regressors, in unit columns */
  int64_t train_rows;       /* samples */
  int64_t held_out_rows;    /* samples */
  int64_t test_blocks;      /* of the test */
} ulna_delayed_info;

/** How windows are compared. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_windows_options {
  int64_t struct_size;                 /* sizeof(ulna_windows_options) */
  const ulna_prepare_options *prepare; /* NULL: defaults, with a low pass of 5 / window_s */
  const ulna_view *onsets_s; /* times of the onsets; NULL: one in each segment, or found from the
                                reference */
  double window_s;           /* 0: 0.1 */
  double after_s;            /* use of a perturbation from its onset; 0: 1 s */
  double baseline_s;         /* rest before the onset; 0: 0.1 s */
  double condition_limit;    /* above it the call fails; 0: 1000 */
  double level;              /* of the test; 0: 0.05 */
  int64_t draws;             /* of the test; 0: 1999 */
  int64_t seed;              /* 0 is a seed */
  int32_t estimator;         /* ULNA_ESTIMATOR_... */
  int32_t free_inertia;      /* 1: inertia of its own in either window */
  int32_t threads;           /* 0: one per processor */
  int32_t reserved;          /* zero */
} ulna_windows_options;

/** What was found.
 * @since 0.1 */
typedef struct ulna_windows_info {
  int64_t struct_size; /* set by the caller to sizeof(ulna_windows_info) */
  int32_t axes;        /* n */
  int32_t rotational;  /* 1: rad and Nm; 0: m and N */
  uint32_t outcome;    /* ULNA_WINDOWS_... bits; 0: good */
  int32_t estimator;   /* ULNA_ESTIMATOR_LEAST_SQUARES or _INSTRUMENTAL */
  double p_value;      /* that both windows agree; NaN with too few perturbations */
  double degrees;      /* of Student's t for intervals */
  double quantile;     /* of it, for 95 % on both sides */
  double condition;    /* of the regressors, in unit columns */
  double guard_s;      /* left out on either side of the border: the filter mixes both */
  int64_t early_rows;  /* samples in windows */
  int64_t late_rows;   /* samples after them */
} ulna_windows_info;

/** Identifies both paths of one joint: -F = M x'' + B x' + K x + c + G H(s) r(t - tau), r the
 * half-wave rectified velocity and H a low pass of unit static gain. Fails as ulna_prepare does,
 * with ULNA_ERROR_ARGUMENT for several axes, and with ULNA_ERROR_ANALYSIS when the velocity never
 * excites the path.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_reflex_identify(const ulna_record *record,
                                          const ulna_reflex_options *options, ulna_token *token,
                                          ulna_reflex **out_reflex);

/** Frees an estimate; NULL is allowed.
 * @thread exclusive reflex
 * @since 0.1 */
ULNA_API void ulna_reflex_free(ulna_reflex *reflex);

/** What was found.
 * @thread shared reflex
 * @since 0.1 */
ULNA_API ulna_status ulna_reflex_get_info(const ulna_reflex *reflex, ulna_reflex_info *out_info);

/** What the filters did.
 * @thread shared reflex
 * @since 0.1 */
ULNA_API ulna_status ulna_reflex_get_preparation(const ulna_reflex *reflex,
                                                 ulna_prepare_report *out_report);

/** Its numbers: ULNA_REFLEX_PARAMETERS and so on; matrices row by row.
 * @thread shared reflex
 * @since 0.1 */
ULNA_API ulna_status ulna_reflex_get_values(const ulna_reflex *reflex, int32_t quantity,
                                            double *out, int64_t capacity, int64_t *out_count);

/** Its signals of one trial: ULNA_REFLEX_SIGNAL_...
 * @thread shared reflex
 * @since 0.1 */
ULNA_API ulna_status ulna_reflex_get_signals(const ulna_reflex *reflex, int64_t trial,
                                             int32_t signal, double *out, int64_t capacity,
                                             int64_t *out_count);

/** Its words: ULNA_TEXT_...
 * @thread shared reflex
 * @since 0.1 */
ULNA_API ulna_status ulna_reflex_get_text(const ulna_reflex *reflex, int32_t which, char *out_text,
                                          int64_t capacity, int64_t *out_size);

/** Identifies M x'' + B x' + K (x - x0) + K_d (x(t - tau) - x0) + B_d x'(t - tau) = -F along one or
 * two axes, tau with the rest. Fails as ulna_impedance_identify does.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_delayed_identify(const ulna_record *record,
                                           const ulna_delayed_options *options, ulna_token *token,
                                           ulna_delayed **out_delayed);

/** Frees an estimate; NULL is allowed.
 * @thread exclusive delayed
 * @since 0.1 */
ULNA_API void ulna_delayed_free(ulna_delayed *delayed);

/** What was found.
 * @thread shared delayed
 * @since 0.1 */
ULNA_API ulna_status ulna_delayed_get_info(const ulna_delayed *delayed,
                                           ulna_delayed_info *out_info);

/** What the filters did.
 * @thread shared delayed
 * @since 0.1 */
ULNA_API ulna_status ulna_delayed_get_preparation(const ulna_delayed *delayed,
                                                  ulna_prepare_report *out_report);

/** Its numbers: ULNA_DELAYED_PARAMETERS and so on; matrices row by row.
 * @thread shared delayed
 * @since 0.1 */
ULNA_API ulna_status ulna_delayed_get_values(const ulna_delayed *delayed, int32_t quantity,
                                             double *out, int64_t capacity, int64_t *out_count);

/** Its words: ULNA_TEXT_...
 * @thread shared delayed
 * @since 0.1 */
ULNA_API ulna_status ulna_delayed_get_text(const ulna_delayed *delayed, int32_t which,
                                           char *out_text, int64_t capacity, int64_t *out_size);

/** Compares the impedance in the first window_s after each onset with that after it, from one fit
 * to all perturbations; covariances leave one perturbation out at a time. Fails as ulna_prepare
 * does, and with ULNA_ERROR_DATA when fewer than three perturbations can be used.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_windows_compare(const ulna_record *record,
                                          const ulna_windows_options *options, ulna_token *token,
                                          ulna_windows **out_windows);

/** Frees a comparison; NULL is allowed.
 * @thread exclusive windows
 * @since 0.1 */
ULNA_API void ulna_windows_free(ulna_windows *windows);

/** What was found.
 * @thread shared windows
 * @since 0.1 */
ULNA_API ulna_status ulna_windows_get_info(const ulna_windows *windows,
                                           ulna_windows_info *out_info);

/** What the filters did.
 * @thread shared windows
 * @since 0.1 */
ULNA_API ulna_status ulna_windows_get_preparation(const ulna_windows *windows,
                                                  ulna_prepare_report *out_report);

/** Its numbers: ULNA_WINDOWS_EARLY and so on; matrices row by row.
 * @thread shared windows
 * @since 0.1 */
ULNA_API ulna_status ulna_windows_get_values(const ulna_windows *windows, int32_t quantity,
                                             double *out, int64_t capacity, int64_t *out_count);

/** Its words: ULNA_TEXT_...
 * @thread shared windows
 * @since 0.1 */
ULNA_API ulna_status ulna_windows_get_text(const ulna_windows *windows, int32_t which,
                                           char *out_text, int64_t capacity, int64_t *out_size);

#ifdef __cplusplus
}
#endif

#endif
