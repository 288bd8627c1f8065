/* Continuous-time transfer functions from sampled signals,
 *   y(t) = sum_i B_i(p) / A(p) u_i(t - delay_i) + offset + noise,  p = d/dt,
 * by the simplified refined instrumental variable method (SRIVC) or by output-error least squares,
 * and the search for their orders. One output, one input or several with a common denominator.
 *
 * Coefficients are ordered a_0 ... a_(n-1), then b_0 ... b_m of each input; A is monic, and index k
 * belongs to p^k. Units follow from those of the signals and the second. Signs are those of the
 * signals: nothing is turned. Runs (ranges of rows) are never joined: each has its own initial
 * state and offset. */
#ifndef ULNA_MODELS_H
#define ULNA_MODELS_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Simplified refined instrumental variables. @since 0.1 */
#define ULNA_MODEL_SRIVC (0)
/** Output-error least squares by Levenberg and Marquardt, the prediction-error baseline.
 * @since 0.1 */
#define ULNA_MODEL_OUTPUT_ERROR (1)

/** Between samples the input is held. @since 0.1 */
#define ULNA_HOLD_ZERO (0)
/** Between samples the input is a straight line. @since 0.1 */
#define ULNA_HOLD_LINEAR (1)

/** The estimate stands. @since 0.1 */
#define ULNA_MODEL_GOOD (0)
/** The iterations ended before the estimate stood still. @since 0.1 */
#define ULNA_MODEL_NOT_CONVERGED (1)
/** The data ask for a pole in the right half plane; this is the best stable model. @since 0.1 */
#define ULNA_MODEL_UNSTABLE (2)
/** The data do not determine all coefficients. @since 0.1 */
#define ULNA_MODEL_ILL_CONDITIONED (3)
/** The model explains no more than chance. @since 0.1 */
#define ULNA_MODEL_UNEXPLAINED (4)

/** The coefficients, p values. @since 0.1 */
#define ULNA_MODEL_COEFFICIENTS (0)
/** Their covariance, p x p; zero rows for what is fixed or at a bound. @since 0.1 */
#define ULNA_MODEL_COVARIANCE (1)
/** Of each coefficient: 0 free, 1 fixed, 2 at its bound. @since 0.1 */
#define ULNA_MODEL_STATE (2)
/** By runs x (n + 1), run after run: free response and its derivatives at the first row in the sums
 * (unit / s^i), then the offset. @since 0.1 */
#define ULNA_MODEL_INITIAL (3)
/** Autoregression of the output errors, e[k] = sum_l ar[l] e[k-1-l] + white; empty: white.
 * @since 0.1 */
#define ULNA_MODEL_NOISE (4)
/** Simulated output, one a row; NaN outside of the runs. @since 0.1 */
#define ULNA_MODEL_SIMULATED (5)
/** Output less simulated output. @since 0.1 */
#define ULNA_MODEL_OUTPUT_ERRORS (6)
/** The same on held-out rows by the model before the refit; NaN elsewhere. @since 0.1 */
#define ULNA_MODEL_VALIDATION_ERRORS (7)

/** The fewest coefficients whose held-out error is within two standard errors of the least.
 * @since 0.1 */
#define ULNA_ORDER_HELD_OUT (0)
/** Least Bayesian information criterion. @since 0.1 */
#define ULNA_ORDER_BIC (1)
/** Least corrected Akaike information criterion. @since 0.1 */
#define ULNA_ORDER_AICC (2)
/** Least Young information criterion among the models whose error is within three standard errors
 * of the least. @since 0.1 */
#define ULNA_ORDER_YIC (3)

/** An identified model; immutable.
 * @since 0.1 */
typedef struct ulna_model ulna_model;

/** Models of several orders and delays; immutable.
 * @since 0.1 */
typedef struct ulna_order_search ulna_order_search;

/** What is estimated and how. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_model_options {
  int64_t struct_size;      /* sizeof(ulna_model_options) */
  const int64_t *ranges;    /* 2 range_count: begin and end of each run; NULL: all rows are one */
  int64_t range_count;      /* runs */
  const int64_t *zeros;     /* one an input, 0 to poles; NULL: poles - 1 for each */
  int64_t zero_count;       /* inputs */
  const double *delay_s;    /* one an input, not negative; NULL: none */
  int64_t delay_count;      /* inputs */
  const double *lower;      /* of each coefficient; -infinity: none; equal to upper: fixed */
  const double *upper;      /* as lower; +infinity: none */
  int64_t bound_count;      /* coefficients; 0: no bounds */
  const double *cutoffs_hz; /* of the filters that start the search; NULL: a grid over the band */
  int64_t cutoff_count;     /* of cutoffs_hz */
  double held_out;          /* share of each run, its end, that validates; below 0.9 */
  double skip_s;            /* left out at the start of each run, at least */
  double tolerance;         /* of the last step, in standard errors; 0: 1e-3 */
  int32_t poles;            /* 1 to 10; 0: 2 */
  int32_t method;           /* ULNA_MODEL_SRIVC or ULNA_MODEL_OUTPUT_ERROR */
  int32_t hold;             /* ULNA_HOLD_... */
  int32_t rest;             /* 1: runs begin at rest, with zero input before */
  int32_t no_offset;        /* 1: the output has no constant part of its own */
  int32_t no_refit;         /* 1: after validation, keep the model of the other rows */
  int32_t white;            /* 1: take the output errors as white for the covariance */
  int32_t max_iterations;   /* 0: 60 */
} ulna_model_options;

/** Figures of an identified model.
 * @since 0.1 */
typedef struct ulna_model_info {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_model_info) */
  int64_t coefficients;  /* p */
  int64_t inputs;        /* of the model */
  int64_t runs;          /* in the data */
  int64_t rows;          /* in the sums of the estimate */
  int64_t held_out_rows; /* that validated */
  double condition;      /* of the sensitivities in unit columns; infinite: not determined */
  double sse;            /* sum of squared output errors */
  double noise_variance; /* sse over degrees of freedom */
  double vaf;            /* percent of the output's variance accounted for, rows in the sums */
  double vaf_held_out;   /* the same on held-out rows; NaN without any */
  double aic;            /* N ln(sse / N) + 2 k, k with initial values and noise variance */
  double aicc;           /* corrected for few rows */
  double bic;            /* N ln(sse / N) + k ln N */
  double yic;            /* ln(relative noise variance) + ln(mean relative variance of p) */
  int32_t poles;         /* n */
  int32_t outcome;       /* ULNA_MODEL_GOOD ... */
  int32_t iterations;    /* of the last fit */
  int32_t refitted;      /* 1: estimated from all rows after the validation */
} ulna_model_info;

/** What an order search goes through. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_order_grid {
  int64_t struct_size;   /* sizeof(ulna_order_grid) */
  const int64_t *poles;  /* numbers of poles; NULL: 1, 2, 3, 4 */
  int64_t pole_count;    /* of poles */
  const int64_t *zeros;  /* numbers of zeros, of every input; NULL: 0 to poles - 1 */
  int64_t zero_count;    /* of zeros */
  const double *delay_s; /* delays, of every input; NULL: none */
  int64_t delay_count;   /* of delay_s */
  int32_t criterion;     /* ULNA_ORDER_... */
  int32_t threads;       /* 0: one per processor */
} ulna_order_grid;

/** One model of a search.
 * @since 0.1 */
typedef struct ulna_order_candidate {
  int64_t struct_size; /* set by the caller to sizeof(ulna_order_candidate) */
  double delay_s;      /* of every input */
  double vaf;          /* percent, rows that identified */
  double vaf_held_out; /* percent; NaN without held-out rows */
  double aicc;         /* as in ulna_model_info; of the rows that identified */
  double bic;          /* as in ulna_model_info */
  double yic;          /* as in ulna_model_info */
  double condition;    /* as in ulna_model_info */
  int32_t poles;       /* n */
  int32_t zeros;       /* m */
  int32_t outcome;     /* ULNA_MODEL_...; -1: the estimate ended in an error */
  int32_t reserved;    /* zero */
} ulna_order_candidate;

/** Identifies a model. inputs: rows x inputs; output: rows x 1, on one clock. options may be NULL.
 * ULNA_ERROR_DATA with row and channel for missing values and runs that are too short;
 * ULNA_ERROR_ANALYSIS for constant signals. Look at the outcome before you use the model.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_model_identify(const ulna_view *inputs, const ulna_view *output,
                                         double rate_hz, const ulna_model_options *options,
                                         ulna_token *token, ulna_model **out_model);

/** Frees a model; NULL is allowed.
 * @thread exclusive model
 * @since 0.1 */
ULNA_API void ulna_model_free(ulna_model *model);

/** Copies out the figures of a model.
 * @thread shared model
 * @since 0.1 */
ULNA_API ulna_status ulna_model_get_info(const ulna_model *model, ulna_model_info *out_info);

/** Copies out one of ULNA_MODEL_COEFFICIENTS ... ULNA_MODEL_VALIDATION_ERRORS.
 * @thread shared model
 * @since 0.1 */
ULNA_API ulna_status ulna_model_get_values(const ulna_model *model, int32_t which, double *out,
                                           int64_t capacity, int64_t *out_count);

/** What there is to say about a model, a sentence a line; the first explains an outcome that is not
 * good.
 * @thread shared model
 * @since 0.1 */
ULNA_API ulna_status ulna_model_get_text(const ulna_model *model, char *out_text, int64_t capacity,
                                         int64_t *out_size);

/** Output of a transfer function for inputs (rows x inputs) after rest with zero input, exact for
 * the hold. coefficients: p x 1 in the order above; options: poles, zeros, delay_s and hold count,
 * the rest must be zero. out: rows values.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_model_simulate(const ulna_view *coefficients,
                                         const ulna_model_options *options, const ulna_view *inputs,
                                         double rate_hz, double *out, int64_t capacity,
                                         int64_t *out_count);

/** Identifies a model for every combination of a grid, judged on the same rows. options: as for
 * ulna_model_identify, without orders, delays and bounds; with ULNA_ORDER_HELD_OUT a held_out of 0
 * means 0.25. options and grid may be NULL.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_order_search_new(const ulna_view *inputs, const ulna_view *output,
                                           double rate_hz, const ulna_order_grid *grid,
                                           const ulna_model_options *options, ulna_token *token,
                                           ulna_order_search **out_search);

/** Frees a search; NULL is allowed.
 * @thread exclusive search
 * @since 0.1 */
ULNA_API void ulna_order_search_free(ulna_order_search *search);

/** Number of candidates, sorted by the criterion, and which of them is recommended; -1: none is
 * good.
 * @thread shared search
 * @since 0.1 */
ULNA_API ulna_status ulna_order_search_get_count(const ulna_order_search *search,
                                                 int64_t *out_count, int64_t *out_recommended);

/** Copies out one candidate.
 * @thread shared search
 * @since 0.1 */
ULNA_API ulna_status ulna_order_search_get_candidate(const ulna_order_search *search, int64_t index,
                                                     ulna_order_candidate *out_candidate);

/** Why a candidate is out of the question, empty when it is not; with index -1 why the recommended
 * one is.
 * @thread shared search
 * @since 0.1 */
ULNA_API ulna_status ulna_order_search_get_text(const ulna_order_search *search, int64_t index,
                                                char *out_text, int64_t capacity,
                                                int64_t *out_size);

#ifdef __cplusplus
}
#endif

#endif
