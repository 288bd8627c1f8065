/* Design of a perturbation experiment: signals for a robot to follow, whether arm and robot stay
 * within limits under them, and the standard errors that the recording will give.
 *
 * A design is a reference in SI, rows at a rate by axes, with its first two derivatives and the
 * rows that are perturbations (its segments). Position references are in the frame of the robot's
 * controller, relative to where it starts; force references are those of the robot on the human. */
#ifndef ULNA_DESIGN_H
#define ULNA_DESIGN_H

#include <ulna/base.h>
#include <ulna/impedance.h>
#include <ulna/record.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The reference of a position controller, m or rad. @since 0.1 */
#define ULNA_DRIVE_POSITION (0)
/** The force that the robot exerts on the human, N or N m. @since 0.1 */
#define ULNA_DRIVE_FORCE (1)

/** Phases of low crest factor, by minimising L_2p norms (Guillaume et al. 1991). @since 0.1 */
#define ULNA_PHASES_OPTIMISED (0)
/** Uniform random phases. @since 0.1 */
#define ULNA_PHASES_RANDOM (1)
/** Schroeder's phases (1970). @since 0.1 */
#define ULNA_PHASES_SCHROEDER (2)

/** A design; immutable.
 * @since 0.1 */
typedef struct ulna_design ulna_design;

/** A sum of sinusoids. Zero bytes mean the defaults named here: those of Dyck 2013, 3.4.1.
 * @since 0.1 */
typedef struct ulna_multisine_options {
  int64_t struct_size; /* sizeof(ulna_multisine_options) */
  double rate_hz;      /* 0: 1000 */
  double duration_s;   /* of the whole design; 0: 50 */
  double low_hz;       /* begin of the band */
  double high_hz;      /* end of the band; 0: 3 */
  double period_s;     /* lines are multiples of 1 / period_s; 0: the part between the fades */
  double slope;        /* amplitude of a line ~ freq^slope */
  double fade_s;       /* smooth rise and fall at the ends */
  const ulna_view *lines_hz; /* exactly these, lines x axes or lines x 1; NULL: from the band */
  int64_t lines;             /* per axis; 0: 10 */
  int64_t seed;              /* 0 is a seed */
  int32_t phases;            /* ULNA_PHASES_... */
  int32_t shared;            /* 1: all axes have the same lines; 0: they take turns */
  int32_t rms;               /* 1: the amplitude is the rms; 0: the largest magnitude */
  int32_t starts; /* random starts of the optimisation, beside Schroeder's; 0: 10; < 0: none */
} ulna_multisine_options;

/** Steps through an underdamped filter. Zero bytes mean the defaults named here: those of
 * Dyck 2013, 3.4.1.
 * @since 0.1 */
typedef struct ulna_steps_options {
  int64_t struct_size;         /* sizeof(ulna_steps_options) */
  double rate_hz;              /* 0: 1000 */
  double damping_ratio;        /* of the filter; 0: 0.1 */
  double natural_rad_s;        /* of the filter; 0: 15 */
  double hold_s[2];            /* least and most; 0, 0: 1.5, 2 */
  double wait_s[2];            /* from the end of a hold to the next onset; 0, 0: 2, 7 */
  double return_s;             /* the way back, within the wait; 0: 1 */
  double rest_s;               /* after the last way back; 0: 1; < 0: none */
  const ulna_view *directions; /* directions x axes, rows of length 1; NULL: about the circle */
  int64_t axes;                /* 1 or 2, without directions; 0: 2 */
  int64_t direction_count;     /* about the circle; 0: 8, or 2 for one axis */
  int64_t repeats;             /* of each direction; 0: 2 */
  int64_t seed;                /* 0 is a seed */
} ulna_steps_options;

/** A random binary sequence. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_binary_options {
  int64_t struct_size;  /* sizeof(ulna_binary_options) */
  double rate_hz;       /* 0: 1000 */
  double duration_s;    /* of the whole design; 0: 50 */
  double clock_s;       /* the sign is drawn anew this often; 0: 0.5 */
  double return_s;      /* gently back at the end; 0: 1; < 0: not at all */
  double damping_ratio; /* of the filter; 0: 0.1; < 0: no filter */
  double natural_rad_s; /* of the filter; 0: 15 */
  int64_t seed;         /* 0 is a seed */
} ulna_binary_options;

/** What a design holds.
 * @since 0.1 */
typedef struct ulna_design_info {
  int64_t struct_size; /* set by the caller to sizeof(ulna_design_info) */
  int64_t rows;        /* samples */
  int64_t axes;        /* columns */
  int64_t segments;    /* perturbations */
  int64_t lines;       /* of a multisine, all axes; 0: none */
  int64_t events;      /* steps; 0: none */
  double rate_hz;      /* sample rate */
  double period_s;     /* of a multisine; 0: not periodic */
  int32_t drive;       /* ULNA_DRIVE_... */
  int32_t reserved;    /* zero */
} ulna_design_info;

/** The reference, rows x axes, m, rad, N or N m. @since 0.1 */
#define ULNA_DESIGN_VALUE (0)
/** Its first derivative, rows x axes, per s. @since 0.1 */
#define ULNA_DESIGN_RATE (1)
/** Its second derivative, rows x axes, per s^2. @since 0.1 */
#define ULNA_DESIGN_ACCELERATION (2)
/** Segments x 2: begin and end (one past the last row). @since 0.1 */
#define ULNA_DESIGN_SEGMENTS (3)
/** Lines x 4: axis, frequency (Hz), amplitude, phase (rad, of a cosine from row 0). @since 0.1 */
#define ULNA_DESIGN_LINES (4)
/** Events x (3 + axes): onset (s), hold (s), number of the direction, size on each axis. @since 0.1
 */
#define ULNA_DESIGN_EVENTS (5)
/** Per axis over the segments: the largest magnitude. @since 0.1 */
#define ULNA_DESIGN_PEAK (6)
/** Per axis over the segments: the root mean square. @since 0.1 */
#define ULNA_DESIGN_RMS (7)
/** Per axis over the segments: the crest factor, peak over rms. @since 0.1 */
#define ULNA_DESIGN_CREST (8)

/** What to know before using the design, a sentence a line. @since 0.1 */
#define ULNA_DESIGN_TEXT_NOTES (0)
/** How to make it again, one line. @since 0.1 */
#define ULNA_DESIGN_TEXT_PROVENANCE (1)

/** A sum of sinusoids on every axis. amplitude: axes x 1, SI.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_design_multisine(int32_t drive, const ulna_view *amplitude,
                                           const ulna_multisine_options *options, ulna_token *token,
                                           ulna_design **out_design);

/** Steps of `size` (m, rad, N or N m) in random order, each held and taken back gently.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_design_steps(int32_t drive, double size,
                                       const ulna_steps_options *options, ulna_token *token,
                                       ulna_design **out_design);

/** A random binary sequence on every axis. amplitude: axes x 1, SI.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_design_binary(int32_t drive, const ulna_view *amplitude,
                                        const ulna_binary_options *options, ulna_token *token,
                                        ulna_design **out_design);

/** A signal of one's own, rows x axes. segments: segment_count x 2 rows, begin and end; NULL: all
 * rows. velocity and acceleration: its derivatives in the same shape; NULL: by differences.
 * provenance: how it was made, one line, for its records; NULL: a signal of one's own.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_design_new(int32_t drive, const ulna_view *reference,
                                     const ulna_view *velocity, const ulna_view *acceleration,
                                     double rate_hz, const int64_t *segments, int64_t segment_count,
                                     const char *provenance, ulna_design **out_design);

/** The same design `factor` times as large.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_scale(const ulna_design *design, double factor,
                                       ulna_design **out_design);

/** Frees a design; NULL is allowed.
 * @thread exclusive design
 * @since 0.1 */
ULNA_API void ulna_design_free(ulna_design *design);

/** Sizes of a design.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_get_info(const ulna_design *design, ulna_design_info *out_info);

/** Numbers of a design: ULNA_DESIGN_..., tables column after column.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_get_values(const ulna_design *design, int32_t quantity,
                                            double *out, int64_t capacity, int64_t *out_count);

/** Its words: ULNA_DESIGN_TEXT_...
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_get_text(const ulna_design *design, int32_t which, char *out_text,
                                          int64_t capacity, int64_t *out_size);

/** The design as a record with one reference channel an axis, for ulna_record_write_csv and a
 * robot's controller. axes: names with commas between, as "x,y"; rotational 1: rad and Nm;
 * derivatives 1: with rate and acceleration.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_to_record(const ulna_design *design, const char *axes,
                                           int32_t rotational, int32_t derivatives,
                                           ulna_record **out_record);

/** The record with the design's segments in every trial; the design starts start_s after the first
 * row of each.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_mark(const ulna_design *design, const ulna_record *record,
                                      double start_s, ulna_record **out_record);

/** Unit step response of w^2 / (s^2 + 2 zeta w s + w^2), exact. time: s, rows x 1. out: rows x 3 by
 * columns: value, rate, acceleration; 0 before t = 0.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_step_response(const ulna_view *time, double damping_ratio,
                                        double natural_rad_s, double *out, int64_t capacity,
                                        int64_t *out_count);

/** Of that response: overshoot as a share of the step, time of its peak (s, infinite from zeta = 1)
 * and of settling to 2 % (four time constants of the slowest pole, s).
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_step_facts(double damping_ratio, double natural_rad_s,
                                     double *out_overshoot, double *out_peak_time_s,
                                     double *out_settling_s);

/** The arm that is expected, n x n, SI: M x'' + B x' + K (x - x0) = -F_h.
 * @since 0.1 */
typedef struct ulna_design_arm {
  int64_t struct_size; /* sizeof(ulna_design_arm) */
  const ulna_view *m;  /* kg or kg m^2 */
  const ulna_view *b;  /* N s/m or N m s/rad */
  const ulna_view *k;  /* N/m or N m/rad */
  const ulna_view *x0; /* n x 1, from where the robot starts; NULL: there */
} ulna_design_arm;

/** The robot, n x n, SI: mass x'' + damping x' + stiffness x = u + F_h, with u = stiffness r +
 * damping r' for a position design and u = the design for a force design. NULL: zero.
 * @since 0.1 */
typedef struct ulna_design_robot {
  int64_t struct_size; /* sizeof(ulna_design_robot) */
  const ulna_view
      *stiffness;           /* of the position controller, or of a force-controlled robot itself */
  const ulna_view *damping; /* as stiffness */
  const ulna_view *mass;    /* between motor and force sensor */
} ulna_design_robot;

/** What disturbs the experiment.
 * @since 0.1 */
typedef struct ulna_design_noise {
  int64_t struct_size;   /* sizeof(ulna_design_noise) */
  double tremor;         /* standard deviation of the human's own force on each axis, N or N m */
  double tremor_low_hz;  /* its band, of flat density */
  double tremor_high_hz; /* 0: 5 */
  double force;          /* standard deviation of white noise on a force sample, N or N m */
  double position;       /* the same of a position sample, m or rad */
} ulna_design_noise;

/** Predicted hand motion away from rest, rows x n, m or rad. @since 0.1 */
#define ULNA_RESPONSE_POSITION (0)
/** Its velocity. @since 0.1 */
#define ULNA_RESPONSE_VELOCITY (1)
/** Its acceleration. @since 0.1 */
#define ULNA_RESPONSE_ACCELERATION (2)
/** Force by the human on the robot, away from rest. @since 0.1 */
#define ULNA_RESPONSE_FORCE (3)

/** What arm and robot do under a design, from rest: ULNA_RESPONSE_..., rows x n, column after
 * column. Exact for an input that is linear between samples.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_respond(const ulna_design *design, const ulna_design_arm *arm,
                                         const ulna_design_robot *robot, int32_t response,
                                         ulna_token *token, double *out, int64_t capacity,
                                         int64_t *out_count);

/** Force between hand and robot. @since 0.1 */
#define ULNA_LIMIT_FORCE (0)
/** Displacement of the hand from where it rests. @since 0.1 */
#define ULNA_LIMIT_DISPLACEMENT (1)
/** Velocity of the hand. @since 0.1 */
#define ULNA_LIMIT_VELOCITY (2)

/** What the experiment must not exceed.
 * @since 0.1 */
typedef struct ulna_safety_options {
  int64_t struct_size; /* sizeof(ulna_safety_options) */
  double force;        /* N or N m; 0: no limit */
  double displacement; /* m or rad; 0: no limit */
  double velocity;     /* m/s or rad/s; 0: no limit */
  double sigmas;       /* of the tremor, added to every peak; 0: 3; < 0: 0 */
  int32_t per_axis;    /* 1: each axis by itself; 0: the length of the vector */
  int32_t rotational;  /* 1: words say N m and rad */
} ulna_safety_options;

/** A design held against limits; immutable.
 * @since 0.1 */
typedef struct ulna_safety ulna_safety;

/** The verdict. Arrays: by ULNA_LIMIT_....
 * @since 0.1 */
typedef struct ulna_safety_info {
  int64_t struct_size; /* set by the caller to sizeof(ulna_safety_info) */
  int64_t axes;        /* n */
  double scale;        /* largest factor of the design that keeps every limit; may be infinite */
  double limits[3];    /* as given; 0: none */
  double scales[3];    /* the same factor for each limit */
  double scale_times_s[3]; /* when that factor is decided */
  int32_t scale_axes[3];   /* the axis with the largest share there */
  int32_t within;          /* 1: all limits are kept */
  int32_t tightest;        /* ULNA_LIMIT_...: the one that is met first */
  int32_t reserved;        /* zero */
} ulna_safety_info;

/** Holds the peaks of the linear response from rest, plus a multiple of what the tremor adds,
 * against limits. axes: names for the words, with commas between.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_check(const ulna_design *design, const ulna_design_arm *arm,
                                       const ulna_design_robot *robot,
                                       const ulna_design_noise *noise, const char *axes,
                                       const ulna_safety_options *options, ulna_token *token,
                                       ulna_safety **out_safety);

/** Frees it; NULL is allowed.
 * @thread exclusive safety
 * @since 0.1 */
ULNA_API void ulna_safety_free(ulna_safety *safety);

/** The verdict.
 * @thread shared safety
 * @since 0.1 */
ULNA_API ulna_status ulna_safety_get_info(const ulna_safety *safety, ulna_safety_info *out_info);

/** Peaks of a quantity (ULNA_LIMIT_...), (n + 1) x 3 by columns: largest magnitude with the tremor,
 * its time (s), the tremor's part; rows are the axes and, last, the length of the vector.
 * @thread shared safety
 * @since 0.1 */
ULNA_API ulna_status ulna_safety_get_peaks(const ulna_safety *safety, int32_t quantity, double *out,
                                           int64_t capacity, int64_t *out_count);

/** The verdict in a sentence.
 * @thread shared safety
 * @since 0.1 */
ULNA_API ulna_status ulna_safety_get_text(const ulna_safety *safety, char *out_text,
                                          int64_t capacity, int64_t *out_size);

/** How the recording will be analysed. Zero bytes mean the defaults of ulna_impedance_identify.
 * @since 0.1 */
typedef struct ulna_plan_options {
  int64_t struct_size;                 /* sizeof(ulna_plan_options) */
  const ulna_prepare_options *prepare; /* filters; NULL: defaults; names of channels are not used */
  double train_s;                      /* identify from; 0: first 40 s, or half the segments */
  double condition_limit;              /* 0: 1000 */
  double repetitions;                  /* of the whole design, fractions allowed; 0: 1 */
  int32_t model;                       /* ULNA_MODEL_..., passive as symmetric */
  int32_t no_damping;                  /* 1: B = 0 */
  int32_t diagonal_mass;               /* 1: M = m I */
  int32_t estimator;                   /* ULNA_ESTIMATOR_...; automatic: instrumental variables */
  int32_t refit;                       /* ULNA_REFIT_... */
  int32_t reserved;                    /* zero */
} ulna_plan_options;

/** Predicted errors of an experiment; immutable.
 * @since 0.1 */
typedef struct ulna_plan ulna_plan;

/** A plan. Parameters are natural: M, B and K row by row, then x0.
 * @since 0.1 */
typedef struct ulna_plan_info {
  int64_t struct_size; /* set by the caller to sizeof(ulna_plan_info) */
  int64_t axes;        /* n */
  double condition;    /* of the regressors in unit columns */
  double weakness;     /* noise in the instruments' hold on the motion, relative; above 0.3: weak */
  double seconds;      /* all repetitions, pauses of the design included */
  double used_s;       /* of it in the fit */
  double repetitions;  /* as given */
  double lowpass_hz;   /* of the preparation; 0: none */
  int32_t estimator;   /* ULNA_ESTIMATOR_LEAST_SQUARES or _INSTRUMENTAL */
  int32_t reserved;    /* zero */
} ulna_plan_info;

/** The parameters that were assumed. @since 0.1 */
#define ULNA_PLAN_TRUTH (0)
/** Predicted standard errors. @since 0.1 */
#define ULNA_PLAN_ERROR (1)
/** Their covariance, square. @since 0.1 */
#define ULNA_PLAN_COVARIANCE (2)
/** Predicted bias of the estimator in use. @since 0.1 */
#define ULNA_PLAN_BIAS (3)
/** Predicted bias of least squares. @since 0.1 */
#define ULNA_PLAN_LEAST_SQUARES_BIAS (4)
/** Predicted standard errors of least squares about its biased mean. @since 0.1 */
#define ULNA_PLAN_LEAST_SQUARES_ERROR (5)
/** Share of the motion's power that the reference does not cause, n. @since 0.1 */
#define ULNA_PLAN_MOTION_SHARE (6)

/** Predicts the errors of M, B, K and x0 that identification from a recording of this design gives.
 * Fails (ULNA_ERROR_ANALYSIS) when the design does not determine them.
 * @thread shared design
 * @since 0.1 */
ULNA_API ulna_status ulna_design_plan(const ulna_design *design, const ulna_design_arm *arm,
                                      const ulna_design_robot *robot,
                                      const ulna_design_noise *noise,
                                      const ulna_plan_options *options, ulna_token *token,
                                      ulna_plan **out_plan);

/** Frees a plan; NULL is allowed.
 * @thread exclusive plan
 * @since 0.1 */
ULNA_API void ulna_plan_free(ulna_plan *plan);

/** What the plan rests on.
 * @thread shared plan
 * @since 0.1 */
ULNA_API ulna_status ulna_plan_get_info(const ulna_plan *plan, ulna_plan_info *out_info);

/** Numbers of a plan: ULNA_PLAN_...
 * @thread shared plan
 * @since 0.1 */
ULNA_API ulna_status ulna_plan_get_values(const ulna_plan *plan, int32_t quantity, double *out,
                                          int64_t capacity, int64_t *out_count);

/** Its warnings, a sentence a line.
 * @thread shared plan
 * @since 0.1 */
ULNA_API ulna_status ulna_plan_get_text(const ulna_plan *plan, char *out_text, int64_t capacity,
                                        int64_t *out_size);

/** Seconds of the experiment until the standard error of a natural parameter (its number) is
 * `error`, in its unit: errors fall with the square root of time.
 * @thread shared plan
 * @since 0.1 */
ULNA_API ulna_status ulna_plan_seconds_for(const ulna_plan *plan, int64_t parameter, double error,
                                           double *out_seconds);

#ifdef __cplusplus
}
#endif

#endif
