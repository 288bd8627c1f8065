/* Which uncertainty matters: designs of a study and sensitivity indices of its outputs, for any
 * function. The caller runs the function; here are the points to run it at, and what its outputs
 * say.
 *
 * A sampling is a design: points of the unit cube, a row a run, a column a factor. A factor's value
 * is the quantile of its coordinate (ulna_factor_quantile). Rows come in blocks, which are dropped,
 * resampled and counted as a whole:
 * - sample: 1 row
 * - saltelli: A, AB_1 ... AB_G, B, with second order A, AB_1 ..., BA_1 ..., B; AB_g is A with the
 * factors of group g from B (the order of SALib)
 * - radial: a, then a with the factors of one group from b, group after group
 * - trajectories: G + 1 rows, each moves one group
 *
 * A row is a pure function of the options and its number. Indices are those of outputs y, one a
 * row; Saltelli et al. 2010, Jansen 1999, Janon et al. 2014, Martinez 2011, Saltelli 2002 (second
 * order), Morris 1991 and Campolongo et al. 2007, 2011 (elementary effects, in quantiles). */
#ifndef ULNA_STUDY_H
#define ULNA_STUDY_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Parameters: low, high. @since 0.1 */
#define ULNA_FACTOR_UNIFORM (0)
/** Parameters: mean, standard deviation. @since 0.1 */
#define ULNA_FACTOR_NORMAL (1)
/** Parameters: mean, standard deviation, low, high. @since 0.1 */
#define ULNA_FACTOR_TRUNCATED_NORMAL (2)
/** Parameters: low, mode, high. @since 0.1 */
#define ULNA_FACTOR_TRIANGULAR (3)
/** Parameters: low, high. @since 0.1 */
#define ULNA_FACTOR_LOG_UNIFORM (4)
/** Parameters: the values, a row each; a second column holds weights. @since 0.1 */
#define ULNA_FACTOR_DISCRETE (5)

/** Quantiles of a distribution. parameters: a column, see ULNA_FACTOR_...; probability: rows x 1,
 * from 0 to 1, the ends only where they are finite; out: as many values.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_factor_quantile(int32_t family, const ulna_view *parameters,
                                          const ulna_view *probability, double *out,
                                          int64_t capacity, int64_t *out_count);

/** Probability of values at most so large, the inverse of ulna_factor_quantile; at a discrete value
 * the middle of its step.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_factor_probability(int32_t family, const ulna_view *parameters,
                                             const ulna_view *value, double *out, int64_t capacity,
                                             int64_t *out_count);

/** For variance-based indices. @since 0.1 */
#define ULNA_SCHEME_SALTELLI (0)
/** For elementary effects: base points and steps from them. @since 0.1 */
#define ULNA_SCHEME_RADIAL (1)
/** For elementary effects: walks on a grid (Morris). @since 0.1 */
#define ULNA_SCHEME_TRAJECTORIES (2)
/** Points alone. @since 0.1 */
#define ULNA_SCHEME_SAMPLE (3)

/** Scrambled Sobol' sequence; n a power of two. @since 0.1 */
#define ULNA_SAMPLER_SOBOL (0)
/** Latin hypercube of n rows. @since 0.1 */
#define ULNA_SAMPLER_LATIN (1)
/** Independent uniform numbers. @since 0.1 */
#define ULNA_SAMPLER_MONTE_CARLO (2)
/** Parity with the SAFE toolbox: one Latin hypercube of 2 n rows; A and B are its halves, a and b
 * of a radial block its consecutive rows. @since 0.1 */
#define ULNA_SAMPLER_POOLED_LATIN (3)

/** A design; immutable.
 * @since 0.1 */
typedef struct ulna_sampling ulna_sampling;

/** What is to be sampled. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_sampling_options {
  int64_t struct_size;   /* sizeof(ulna_sampling_options) */
  int64_t factors;       /* columns */
  const int64_t *groups; /* group of each factor, 0 to G - 1; NULL: each its own */
  int64_t n;             /* blocks of one replicate */
  int64_t replicates;    /* independent designs in a row; 0: 1 */
  int64_t levels;        /* of trajectories, even; 0: 4 */
  int64_t candidates;    /* latin: the best of so many by its smallest distance; 0: 1 */
  int64_t seed;          /* 0 is a seed */
  double guard;    /* radial: smallest step in a quantile; 0: 0.25, none if pooled; < 0: none */
  int32_t scheme;  /* ULNA_SCHEME_... */
  int32_t sampler; /* ULNA_SAMPLER_... */
  int32_t second_order; /* 1: saltelli with BA rows */
  int32_t reserved;     /* zero */
} ulna_sampling_options;

/** Size of a design.
 * @since 0.1 */
typedef struct ulna_sampling_info {
  int64_t struct_size;       /* set by the caller to sizeof(ulna_sampling_info) */
  int64_t rows;              /* runs */
  int64_t blocks;            /* of all replicates */
  int64_t block_rows;        /* runs of a block */
  int64_t factors;           /* columns */
  int64_t groups;            /* G; factors when not grouped */
  int32_t independent_steps; /* 1: total indices are possible */
  int32_t has_points;        /* 0: a layout of outputs alone */
} ulna_sampling_info;

/** A design.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sampling_new(const ulna_sampling_options *options, ulna_token *token,
                                       ulna_sampling **out_sampling);

/** A design made elsewhere in the same layout. points: rows x factors in the unit cube; NULL: only
 * outputs are known. The sampler and seed of the options have no meaning.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sampling_given(const ulna_sampling_options *options,
                                         const ulna_view *points, ulna_sampling **out_sampling);

/** Frees a design; NULL is allowed.
 * @thread exclusive sampling
 * @since 0.1 */
ULNA_API void ulna_sampling_free(ulna_sampling *sampling);

/** Size of a design.
 * @thread shared sampling
 * @since 0.1 */
ULNA_API ulna_status ulna_sampling_get_info(const ulna_sampling *sampling,
                                            ulna_sampling_info *out_info);

/** Rows first ... first + count - 1, count x factors, row after row, in the unit cube. Memory and
 * time are those of these rows.
 * @thread shared sampling
 * @since 0.1 */
ULNA_API ulna_status ulna_sampling_get_rows(const ulna_sampling *sampling, int64_t first,
                                            int64_t count, double *out, int64_t capacity,
                                            int64_t *out_count);

/** Which group each row of a block moves alone, -1 for none.
 * @thread shared sampling
 * @since 0.1 */
ULNA_API ulna_status ulna_sampling_get_moves(const ulna_sampling *sampling, int64_t block,
                                             int64_t *out, int64_t capacity, int64_t *out_count);

/** First order of Saltelli 2010, total order of Jansen, centred. @since 0.1 */
#define ULNA_INDICES_BY_SALTELLI (0)
/** Janon et al. 2014. @since 0.1 */
#define ULNA_INDICES_BY_JANON (1)
/** Martinez 2011, correlations. @since 0.1 */
#define ULNA_INDICES_BY_MARTINEZ (2)
/** The uncentred pair of Saltelli 2008 that the SAFE toolbox computes; its A and B are the B and A
 * here. @since 0.1 */
#define ULNA_INDICES_BY_PARITY (3)

/** Bootstrap of whole blocks, quantiles. @since 0.1 */
#define ULNA_INTERVAL_PERCENTILE (0)
/** Bootstrap of whole blocks, bias-corrected and accelerated. @since 0.1 */
#define ULNA_INTERVAL_BCA (1)
/** Spread of the design's replicates, Student's t. @since 0.1 */
#define ULNA_INTERVAL_REPLICATES (2)
/** No interval and no standard error. @since 0.1 */
#define ULNA_INTERVAL_NONE (3)

/** A failed run is an error. @since 0.1 */
#define ULNA_ON_FAILURE_ERROR (0)
/** Blocks that hold a failed run are left out. @since 0.1 */
#define ULNA_ON_FAILURE_DROP_BLOCK (1)
/** A failed run takes the output of the nearest good one, in quantiles. @since 0.1 */
#define ULNA_ON_FAILURE_NEAREST (2)
/** A failed run takes the value of a polynomial fitted to the good ones. @since 0.1 */
#define ULNA_ON_FAILURE_SURFACE (3)

/** Indices of a study; immutable.
 * @since 0.1 */
typedef struct ulna_indices ulna_indices;

/** How outputs are analysed. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_indices_options {
  int64_t struct_size; /* sizeof(ulna_indices_options) */
  double level;        /* of intervals; 0: 0.9 */
  int64_t resamples;   /* of the bootstrap; 0: 1000 */
  int64_t seed;        /* of the bootstrap, of subsets and of a surface's rows; 0 is a seed */
  int64_t blocks;      /* analyse so many blocks of each replicate; 0: all */
  int32_t random;      /* which blocks: 1: a random choice; 0: the first */
  int32_t estimator;   /* ULNA_INDICES_BY_... */
  int32_t interval;    /* ULNA_INTERVAL_... */
  int32_t on_failure;  /* ULNA_ON_FAILURE_... */
  int32_t threads;     /* 0: one per processor; the result is the same */
  int32_t reserved;    /* zero */
} ulna_indices_options;

/** The indices are what they say. @since 0.1 */
#define ULNA_INDICES_GOOD (0)
/** The outputs do not vary: variance-based indices are NaN, elementary effects 0. @since 0.1 */
#define ULNA_INDICES_CONSTANT (1)

/** What indices rest on.
 * @since 0.1 */
typedef struct ulna_indices_info {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_indices_info) */
  int64_t groups;        /* G */
  int64_t blocks;        /* that were analysed */
  int64_t failed_rows;   /* of the whole design */
  int64_t failed_blocks; /* that hold a failed row */
  int64_t failed_base;   /* failed rows at which nothing had been moved alone (A, B) */
  int64_t surface_terms; /* of ULNA_ON_FAILURE_SURFACE; 0: none */
  double surface_r2;     /* of the surface on the good runs nearest to the failed ones, left out */
  int32_t outcome;       /* ULNA_INDICES_... */
  int32_t reserved;      /* zero */
} ulna_indices_info;

/** First-order index of each group. @since 0.1 */
#define ULNA_INDEX_FIRST (0)
/** Total-order index of each group. @since 0.1 */
#define ULNA_INDEX_TOTAL (1)
/** Second-order index of each pair: 01, 02, ..., 12, ... @since 0.1 */
#define ULNA_INDEX_SECOND (2)
/** First order of a factor that does nothing: the noise of the estimator. @since 0.1 */
#define ULNA_INDEX_DUMMY_FIRST (3)
/** Total order of a factor that does nothing. @since 0.1 */
#define ULNA_INDEX_DUMMY_TOTAL (4)
/** Mean elementary effect of each group; NaN for groups of several factors. @since 0.1 */
#define ULNA_INDEX_MU (5)
/** Mean magnitude of the elementary effects. @since 0.1 */
#define ULNA_INDEX_MU_STAR (6)
/** Standard deviation of the elementary effects, with r - 1. @since 0.1 */
#define ULNA_INDEX_SIGMA (7)
/** Mean output, one number. @since 0.1 */
#define ULNA_INDEX_MEAN (8)
/** Variance of the output, one number. @since 0.1 */
#define ULNA_INDEX_VARIANCE (9)
/** First order of the indicator "the run failed". @since 0.1 */
#define ULNA_INDEX_FAILURE_FIRST (10)
/** Total order of the indicator "the run failed". @since 0.1 */
#define ULNA_INDEX_FAILURE_TOTAL (11)

/** The estimate. @since 0.1 */
#define ULNA_FIELD_VALUE (0)
/** Its standard error. @since 0.1 */
#define ULNA_FIELD_ERROR (1)
/** Low end of its interval. @since 0.1 */
#define ULNA_FIELD_LOW (2)
/** High end of its interval. @since 0.1 */
#define ULNA_FIELD_HIGH (3)

/** Failed rows of status 0 (not finite), 1, 2, ... @since 0.1 */
#define ULNA_FAILURES_BY_STATUS (0)
/** Failed rows at which each group had just been moved. @since 0.1 */
#define ULNA_FAILURES_BY_GROUP (1)
/** Share of each group's steps that turned a good run into a failed one, or back. @since 0.1 */
#define ULNA_FAILURES_FLIP_SHARE (2)

/** Variance-based indices of a saltelli design. y: rows x 1, NaN where a run failed; status: one a
 * row, 0 for a good run, 1 to 1023 for a failed one, or NULL.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_indices_of_variance(const ulna_sampling *sampling, const ulna_view *y,
                                              const int32_t *status,
                                              const ulna_indices_options *options,
                                              ulna_token *token, ulna_indices **out_indices);

/** Elementary effects of a radial design or of trajectories; per unit of quantile, in the unit of
 * y. Total indices too where the steps are independent.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_indices_of_effects(const ulna_sampling *sampling, const ulna_view *y,
                                             const int32_t *status,
                                             const ulna_indices_options *options, ulna_token *token,
                                             ulna_indices **out_indices);

/** Frees indices; NULL is allowed.
 * @thread exclusive indices
 * @since 0.1 */
ULNA_API void ulna_indices_free(ulna_indices *indices);

/** What the indices rest on.
 * @thread shared indices
 * @since 0.1 */
ULNA_API ulna_status ulna_indices_get_info(const ulna_indices *indices,
                                           ulna_indices_info *out_info);

/** Numbers: which is ULNA_INDEX_..., field ULNA_FIELD_.... Empty where the design does not give
 * them; ULNA_ERROR_ANALYSIS for the total order of guarded or grid steps, whose points depend on
 * each other.
 * @thread shared indices
 * @since 0.1 */
ULNA_API ulna_status ulna_indices_get_values(const ulna_indices *indices, int32_t which,
                                             int32_t field, double *out, int64_t capacity,
                                             int64_t *out_count);

/** Failures of the whole design: which is ULNA_FAILURES_....
 * @thread shared indices
 * @since 0.1 */
ULNA_API ulna_status ulna_indices_get_failures(const ulna_indices *indices, int32_t which,
                                               double *out, int64_t capacity, int64_t *out_count);

/** The results of a study on disk, in a folder: an immutable plan and a file for each writer.
 * @since 0.1 */
typedef struct ulna_journal ulna_journal;

/** A row that has no result yet. @since 0.1 */
#define ULNA_ROW_NONE (-1)
/** A good run. @since 0.1 */
#define ULNA_ROW_OK (0)
/** The run could not be set up. @since 0.1 */
#define ULNA_ROW_FAILED_INIT (1)
/** The run diverged. @since 0.1 */
#define ULNA_ROW_DIVERGED (2)
/** The run left its limits. @since 0.1 */
#define ULNA_ROW_LIMIT (3)
/** The run took too long; transient: it may be run again. @since 0.1 */
#define ULNA_ROW_TIMEOUT (4)
/** The output is not finite. @since 0.1 */
#define ULNA_ROW_NONFINITE (5)
/** The function raised an error. @since 0.1 */
#define ULNA_ROW_RAISED (6)
/** The process of the run died; transient. @since 0.1 */
#define ULNA_ROW_CRASHED (7)

/** How a journal is opened. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_journal_options {
  int64_t struct_size; /* sizeof(ulna_journal_options) */
  int64_t rows;        /* of the study */
  int64_t outputs;     /* numbers of a row; 0: 1 */
  double sync_s;       /* of appended records, at most so late; 0: 1 s; < 0: every record */
} ulna_journal_options;

/** What a journal holds.
 * @since 0.1 */
typedef struct ulna_journal_info {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_journal_info) */
  int64_t rows;          /* of the study */
  int64_t outputs;       /* numbers of a row */
  int64_t records;       /* good ones, of all writers */
  int64_t damaged_bytes; /* that were skipped when it was opened */
  char hash[72];         /* SHA-256 of the plan, in hexadecimal */
} ulna_journal_info;

/** Opens the journal in a folder, making both when there are none, and reads what all writers have
 * done. plan: any text that names all that the results depend on; another plan in the folder is an
 * error. writer: name of the own file, which one process at a time may open; NULL: only to read.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_open(const char *folder, const char *plan, const char *writer,
                                       const ulna_journal_options *options,
                                       ulna_journal **out_journal);

/** Syncs, closes and frees a journal; NULL is allowed.
 * @thread exclusive journal
 * @since 0.1 */
ULNA_API void ulna_journal_free(ulna_journal *journal);

/** Adds the result of a row, in one write: a process that is killed afterwards has not lost it.
 * values: outputs numbers; message: may be NULL. A row that is done already must have the same
 * result, bit for bit.
 * @thread shared journal
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_append(ulna_journal *journal, int64_t row, int32_t status,
                                         double wall_s, const double *values, const char *message);

/** Waits until all records are on the disk.
 * @thread shared journal
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_sync(ulna_journal *journal);

/** What the journal holds.
 * @thread shared journal
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_get_info(const ulna_journal *journal,
                                           ulna_journal_info *out_info);

/** Status of each row, ULNA_ROW_....
 * @thread shared journal
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_get_status(const ulna_journal *journal, int32_t *out,
                                             int64_t capacity, int64_t *out_count);

/** Time of each run, s; NaN where there is none.
 * @thread shared journal
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_get_times(const ulna_journal *journal, double *out,
                                            int64_t capacity, int64_t *out_count);

/** Outputs, rows x outputs, row after row; NaN where there are none.
 * @thread shared journal
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_get_values(const ulna_journal *journal, double *out,
                                             int64_t capacity, int64_t *out_count);

/** Message of a row, perhaps empty.
 * @thread shared journal
 * @since 0.1 */
ULNA_API ulna_status ulna_journal_get_message(const ulna_journal *journal, int64_t row,
                                              char *out_text, int64_t capacity, int64_t *out_size);

#ifdef __cplusplus
}
#endif

#endif
