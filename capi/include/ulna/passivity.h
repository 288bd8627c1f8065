/* Is the limb passive, and how sure is that? Two approaches: the eigenvalues of the identified
 * model over its uncertainty (Theorem 3.2 of Dyck 2013, corrected), and the energy that flowed into
 * the limb during the recording ((3.1) and (4.3)).
 *
 * Sign: absorbed energy is positive. Excess of passivity is positive, shortage negative; N s/m, or
 * N m s/rad for joints. */
#ifndef ULNA_PASSIVITY_H
#define ULNA_PASSIVITY_H

#include <ulna/base.h>
#include <ulna/impedance.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Passive with at least the probability asked for. @since 0.1 */
#define ULNA_VERDICT_PASSIVE (0)
/** Not passive with at least the probability asked for. @since 0.1 */
#define ULNA_VERDICT_NOT_PASSIVE (1)
/** The data do not decide. @since 0.1 */
#define ULNA_VERDICT_UNDECIDED (2)

/** The verdict rests on the identified model. @since 0.1 */
#define ULNA_APPROACH_MODEL (0)
/** The verdict rests on the energy balance of the recording. @since 0.1 */
#define ULNA_APPROACH_ENERGY (1)

/** A verdict with both approaches and their series; immutable.
 * @since 0.1 */
typedef struct ulna_passivity ulna_passivity;

/** How passivity is judged. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_passivity_options {
  int64_t struct_size;           /* sizeof(ulna_passivity_options) */
  double antisymmetry_threshold; /* share below which antisymmetry is dropped; 0: 0.15; < 0: none */
  double level;                  /* of intervals and of the decision; 0: 0.95 */
  double min_share;  /* of the motion before which energy is not judged; 0: 0.05; < 0: 0 */
  double block_s;    /* of the energy bootstrap; 0: 2 s */
  int64_t bootstrap; /* resamples; 0: 1000 */
  int64_t seed;      /* 0 is a seed */
} ulna_passivity_options;

/** Margins of M, B and K.
 * @since 0.1 */
typedef struct ulna_passivity_margins {
  int64_t struct_size; /* set by the caller to sizeof(ulna_passivity_margins) */
  double m_min;        /* smallest eigenvalue of the symmetric part of M */
  double b_min;        /* of B: the excess of passivity when M and K allow one */
  double k_min;        /* of K */
  double excess;       /* b_min, or minus infinity when M or K is not symmetric and semidefinite */
  double antisymmetry_m; /* (3.26) of Dyck 2013 */
  double antisymmetry_k; /* (3.26) */
  int32_t m_symmetric;   /* 1: the antisymmetric part is below the threshold and dropped */
  int32_t k_symmetric;   /* as m_symmetric */
  int32_t verdict;       /* ULNA_VERDICT_..., exact arithmetic aside */
  int32_t reserved;      /* zero */
} ulna_passivity_margins;

/** A verdict.
 * @since 0.1 */
typedef struct ulna_passivity_info {
  int64_t struct_size;        /* set by the caller to sizeof(ulna_passivity_info) */
  int32_t verdict;            /* ULNA_VERDICT_... */
  int32_t approach;           /* ULNA_APPROACH_...: what it rests on */
  double probability;         /* that the limb is passive, by that approach */
  double model_probability;   /* by the model */
  double energy_probability;  /* by the energy; NaN when the record is too short */
  double excess;              /* smallest eigenvalue of the symmetric part of B */
  double excess_interval[2];  /* low, high */
  double m_min_interval[2];   /* low, high */
  double k_min_interval[2];   /* low, high */
  double energy_index;        /* excess (shortage when negative) that the energy shows */
  double energy_index_time_s; /* when the bound is met */
  double energy_interval[2];  /* low, high; NaN when the record is too short */
  double beta_j;              /* minus the most that the start of a trial could give back */
  int64_t trials;             /* with a series each */
} ulna_passivity_info;

/** Why: what the verdict rests on. @since 0.1 */
#define ULNA_PASSIVITY_TEXT_REASON (0)
/** What would change it. @since 0.1 */
#define ULNA_PASSIVITY_TEXT_WOULD_CHANGE (1)

/** Time from the start of the prepared trial, s. @since 0.1 */
#define ULNA_ENERGY_TIME (0)
/** Energy absorbed since then, J. @since 0.1 */
#define ULNA_ENERGY_ABSORBED (1)
/** Integral of the squared velocity since then, m^2/s or rad^2/s. @since 0.1 */
#define ULNA_ENERGY_MOTION (2)

/** Judges an estimate.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_assess(const ulna_impedance *impedance,
                                           const ulna_passivity_options *options, ulna_token *token,
                                           ulna_passivity **out_passivity);

/** Frees a verdict; NULL is allowed.
 * @thread exclusive passivity
 * @since 0.1 */
ULNA_API void ulna_passivity_free(ulna_passivity *passivity);

/** The verdict with its numbers.
 * @thread shared passivity
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_get_info(const ulna_passivity *passivity,
                                             ulna_passivity_info *out_info);

/** Margins of the estimate itself.
 * @thread shared passivity
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_get_margins(const ulna_passivity *passivity,
                                                ulna_passivity_margins *out_margins);

/** Its words: ULNA_PASSIVITY_TEXT_...
 * @thread shared passivity
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_get_text(const ulna_passivity *passivity, int32_t which,
                                             char *out_text, int64_t capacity, int64_t *out_size);

/** Its energy series of one trial: ULNA_ENERGY_...
 * @thread shared passivity
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_get_series(const ulna_passivity *passivity, int64_t trial,
                                               int32_t series, double *out, int64_t capacity,
                                               int64_t *out_count);

/** Margins of given matrices, n x n, n from 1 to 6, without any uncertainty.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_of_model(const ulna_view *m, const ulna_view *b,
                                             const ulna_view *k,
                                             const ulna_passivity_options *options,
                                             ulna_passivity_margins *out_margins);

/** Energy that a limb absorbed and the excess (shortage when negative) that it shows: the largest
 * delta with E(t) >= beta_j + delta D(t), D the integral of the squared velocity, from where D
 * exceeds min_share of its final value. force: by the human on the robot, rows x n; velocity: the
 * same shape. out_energy: rows values, or NULL with capacity 0.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_of_energy(const ulna_view *force, const ulna_view *velocity,
                                              double rate_hz, double beta_j,
                                              const ulna_passivity_options *options,
                                              double *out_index, double *out_time_s,
                                              double *out_energy, int64_t capacity,
                                              int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
