/* Statistics of experiments in which the same subjects go through several conditions: analysis of
 * variance of repeated measures, and paired comparisons with bootstrap intervals.
 *
 * Rows of a view are subjects. A level of 0.95 means that 95 of 100 intervals hold the truth, as
 * far as few subjects allow: a bootstrap of ten is somewhat narrow. */
#ifndef ULNA_STATS_H
#define ULNA_STATS_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Main effect of the first factor. @since 0.1 */
#define ULNA_ANOVA_FIRST (0)
/** Main effect of the second factor. @since 0.1 */
#define ULNA_ANOVA_SECOND (1)
/** Interaction of both factors. @since 0.1 */
#define ULNA_ANOVA_INTERACTION (2)

/** One effect of an analysis of variance.
 * @since 0.1 */
typedef struct ulna_anova_effect {
  int64_t struct_size;         /* set by the caller to sizeof(ulna_anova_effect) */
  double sum_of_squares;       /* in the squared unit of the values */
  double error_sum_of_squares; /* of effect x subjects */
  double dof;                  /* of the effect */
  double error_dof;            /* of its error */
  double f;                    /* ratio of the mean squares */
  double p;                    /* under sphericity */
  double epsilon;              /* Greenhouse and Geisser 1959; 1 for one degree of freedom */
  double p_corrected;          /* with both degrees of freedom times epsilon */
  double partial_eta_squared;  /* sum of squares over itself plus its error's */
} ulna_anova_effect;

/** Effect of one or two factors that every subject went through. values: subjects x
 * (levels_first levels_second), the second factor runs fastest; one factor has levels_second 1.
 * effect: ULNA_ANOVA_... Fails with ULNA_ERROR_DATA at a value that is no finite number, and with
 * ULNA_ERROR_ANALYSIS where the subjects do not differ.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_anova_repeated(const ulna_view *values, int64_t levels_first,
                                         int64_t levels_second, int32_t effect,
                                         ulna_anova_effect *out_effect);

/** P(F > f) of the F distribution; the degrees of freedom need not be whole.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_f_tail(double f, double dof, double error_dof, double *out_p);

/** How a paired comparison is done. Zero bytes mean the defaults named here. A bootstrap of few
 * subjects is too narrow, by sqrt((n - 1) / n) and for want of Student's t; unless `plain` is 1 its
 * quantiles are moved out by as much (Hesterberg 2015, "expanded percentiles").
 * @since 0.1 */
typedef struct ulna_paired_options {
  int64_t struct_size; /* sizeof(ulna_paired_options) */
  double level;        /* of the intervals; 0: 0.95 */
  int64_t resamples;   /* 50 to a million; 0: 5000 */
  int64_t seed;        /* 0 is a seed */
  int32_t percentile;  /* 1: quantiles of the resamples; 0: bias-corrected and accelerated */
  int32_t plain;       /* 1: quantiles as they are; 0: moved out for few subjects */
  int32_t threads;     /* 0: one per processor; the result is the same */
  int32_t reserved;    /* zero */
} ulna_paired_options;

/** Change from a first to a second condition, subjects x measures each. out: for each measure the
 * mean difference second - first, the relative change of the mean (second / first - 1) and the
 * standardised difference (mean over standard deviation of the differences), each as value,
 * standard error, low, high: 12 numbers a measure; NaN where it is not defined.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_paired_compare(const ulna_view *first, const ulna_view *second,
                                         const ulna_paired_options *options, ulna_token *token,
                                         double *out, int64_t capacity, int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
