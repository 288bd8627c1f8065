/* Many assessments at once: rows of a plan, each an arm in an exoskeleton that is mobilised and
 * assessed, on several threads of this process. A row is a pure function of its values: results are
 * the same to the last bit for any number of threads and however rows are grouped, unless the
 * protocol limits the time of computing. */
#ifndef ULNA_BATCH_H
#define ULNA_BATCH_H

#include <ulna/assessment.h>
#include <ulna/base.h>
#include <ulna/exo.h>
#include <ulna/soft.h>

#ifdef __cplusplus
extern "C" {
#endif

/** What all rows have in common, and the results of the last run.
 * @since 0.1 */
typedef struct ulna_batch ulna_batch;

/** Factor of the upper arm's length (x1 of Tesfazgi 2023). @since 0.1 */
#define ULNA_VARIED_UPPER_FACTOR (0)
/** Factor of the forearm's length (x2). @since 0.1 */
#define ULNA_VARIED_FORE_FACTOR (1)
/** Mass of the upper arm without soft tissue, kg (x3). @since 0.1 */
#define ULNA_VARIED_UPPER_MASS (2)
/** Mass of the forearm without soft tissue, kg (x4). @since 0.1 */
#define ULNA_VARIED_FORE_MASS (3)
/** Stiffness of an element of the upper arm's tissue, N/m (x5, as a true stiffness). @since 0.1 */
#define ULNA_VARIED_UPPER_STIFFNESS (4)
/** Stiffness of an element of the forearm's tissue, N/m (x6). @since 0.1 */
#define ULNA_VARIED_FORE_STIFFNESS (5)
/** Viscosity of such an element of the upper arm, N s/m. @since 0.1 */
#define ULNA_VARIED_UPPER_VISCOSITY (6)
/** Viscosity of such an element of the forearm, N s/m. @since 0.1 */
#define ULNA_VARIED_FORE_VISCOSITY (7)
/** Friction of the upper arm's skin. @since 0.1 */
#define ULNA_VARIED_UPPER_FRICTION (8)
/** Friction of the forearm's skin. @since 0.1 */
#define ULNA_VARIED_FORE_FRICTION (9)
/** Pretension of the upper arm's strap, N. @since 0.1 */
#define ULNA_VARIED_UPPER_PRETENSION (10)
/** Pretension of the forearm's strap, N. @since 0.1 */
#define ULNA_VARIED_FORE_PRETENSION (11)
/** Shoulder of the arm from the device's, world x, m; y and z follow. @since 0.1 */
#define ULNA_VARIED_SHOULDER_OFFSET (12)
/** Elbow from its place, humerus axis x, m; y and z follow. @since 0.1 */
#define ULNA_VARIED_ELBOW_OFFSET (15)
/** Turn of the upper arm in its cuff, rad. @since 0.1 */
#define ULNA_VARIED_DONNING_ROTATION (18)
/** Excitation of the flexors at rest. @since 0.1 */
#define ULNA_VARIED_FLEXORS (19)
/** Excitation of the extensors at rest. @since 0.1 */
#define ULNA_VARIED_EXTENSORS (20)
/** Height of a person whose arm it is, m; needs a scene with height and mass. @since 0.1 */
#define ULNA_VARIED_HEIGHT (21)
/** Mass of the person, kg; needs a scene with height and mass. @since 0.1 */
#define ULNA_VARIED_MASS (22)
/** How many there are. @since 0.1 */
#define ULNA_VARIED_COUNT (23)

/** Columns of the results, see ulna_batch_run. @since 0.1 */
#define ULNA_BATCH_COLUMNS (14)

/** What all rows have in common. Zero bytes are the published arm held rigidly by the published
 * device, each row assessed with its own arm as nominal model.
 * @since 0.1 */
typedef struct ulna_batch_options {
  int64_t struct_size;                        /* sizeof(ulna_batch_options) */
  const ulna_scene_options *scene;            /* of a row, but for what is varied; NULL: default */
  const ulna_soft_options *soft;              /* NULL: the arm is held rigidly */
  const ulna_reduction_options *reduction;    /* to bushings, row by row; NULL: in full */
  const ulna_plant *nominal;                  /* nominal model of all rows; NULL: each row's own */
  const ulna_protocol *protocol;              /* NULL: default */
  const ulna_viscoelastic_options *estimator; /* NULL: default */
  const int32_t *varied;                      /* ULNA_VARIED_..., one a column of the rows */
  int64_t varied_count;                       /* entries of varied */
} ulna_batch_options;

/** Makes a batch. What cannot be in any row is refused here.
 * @thread shared options
 * @since 0.1 */
ULNA_API ulna_status ulna_batch_new(const ulna_batch_options *options, ulna_batch **out_batch);

/** Frees a batch; NULL is allowed.
 * @thread exclusive batch
 * @since 0.1 */
ULNA_API void ulna_batch_free(ulna_batch *batch);

/** Runs rows (values of what is varied, a column each, SI) on threads (0: one a processor). Results
 * are rows x ULNA_BATCH_COLUMNS, row by row: status (ULNA_MOBILISATION_...), seconds of computing,
 * when the start was reached (s), largest slip between device and arm at a moved joint (rad); then,
 * of the first joint that is assessed: K, D, their standard errors, true K and D by the same
 * regressors, true K on the angle alone, residual of the regression (N m, rms), share of the
 * variance it explains, nominal less true torque (N m, rms). NaN where a row has none: an arm that
 * cannot be put in has ULNA_MOBILISATION_FAILED_INIT, a log that determines nothing
 * ULNA_MOBILISATION_NONFINITE.
 * @thread exclusive batch
 * @since 0.1 */
ULNA_API ulna_status ulna_batch_run(ulna_batch *batch, const ulna_view *rows, int32_t threads,
                                    ulna_token *token, double *out, int64_t capacity,
                                    int64_t *out_count);

/** Why a row of the last run did not end as ok, one sentence; else empty.
 * @thread shared batch
 * @since 0.1 */
ULNA_API ulna_status ulna_batch_text(const ulna_batch *batch, int64_t row, char *out_text,
                                     int64_t capacity, int64_t *out_size);

#ifdef __cplusplus
}
#endif

#endif
