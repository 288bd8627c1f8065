/* Linear time-invariant systems in continuous time with real coefficients: matrices of rational
 * functions, proper or not, and state space.
 *
 * Polynomials have the highest power first. Matrices are written row by row; complex numbers as two
 * doubles, real and imaginary part. Frequencies in rad/s. */
#ifndef ULNA_SYSTEM_H
#define ULNA_SYSTEM_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A system of inputs and outputs; immutable.
 * @since 0.1 */
typedef struct ulna_system ulna_system;

/** Numerators, entry after entry, each num_length coefficients with zeros in front; empty for a
 * state space. @since 0.1 */
#define ULNA_SYSTEM_NUM (0)
/** Denominators, entry after entry, each den_length coefficients; empty for a state space.
 * @since 0.1 */
#define ULNA_SYSTEM_DEN (1)
/** A of a realisation, states x states. @since 0.1 */
#define ULNA_SYSTEM_A (2)
/** B, states x inputs. @since 0.1 */
#define ULNA_SYSTEM_B (3)
/** C, outputs x states. @since 0.1 */
#define ULNA_SYSTEM_C (4)
/** D, outputs x inputs. @since 0.1 */
#define ULNA_SYSTEM_D (5)
/** E, states x states; empty when it is the identity. @since 0.1 */
#define ULNA_SYSTEM_E (6)
/** Poles of every entry, or eigenvalues of the state space: modes that cancel are among them.
 * @since 0.1 */
#define ULNA_SYSTEM_POLES (7)
/** Finite zeros of a square system. @since 0.1 */
#define ULNA_SYSTEM_ZEROS (8)

/** first + second. @since 0.1 */
#define ULNA_COMBINE_PARALLEL (0)
/** first second: the second acts first. @since 0.1 */
#define ULNA_COMBINE_SERIES (1)
/** (I + first second)^-1 first: the second feeds back, subtracted. @since 0.1 */
#define ULNA_COMBINE_LOOP (2)

/** State space. @since 0.1 */
#define ULNA_FORM_STATE_SPACE (0)
/** Rational functions; poles that an entry does not show cancel. @since 0.1 */
#define ULNA_FORM_RATIONAL (1)

/** Shape of a system.
 * @since 0.1 */
typedef struct ulna_system_info {
  int64_t struct_size; /* set by the caller to sizeof(ulna_system_info) */
  int64_t outputs;     /* rows of H */
  int64_t inputs;      /* columns of H */
  int64_t states;      /* of the realisation, differentiators of an improper part among them */
  int64_t num_length;  /* coefficients of the longest numerator; 0 for a state space */
  int64_t den_length;  /* of the longest denominator; 0 for a state space */
  double scale_rad_s;  /* geometric mean of the moduli of its poles and zeros */
  int32_t rational;    /* 1: made of rational functions */
  int32_t proper;      /* 1: bounded towards infinite frequency */
} ulna_system_info;

/** Makes a system from numerators and denominators: row k holds the coefficients of entry k,
 * outputs x inputs of them row by row, zeros in front. Fails with ULNA_ERROR_ARGUMENT for a
 * denominator of zero and with ULNA_ERROR_DATA for a coefficient that is not finite.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_system_new_rational(const ulna_view *num, const ulna_view *den,
                                              int64_t outputs, int64_t inputs,
                                              ulna_system **out_system);

/** Makes a system E x' = A x + B u, y = C x + D u. e: NULL for the identity; a singular E allows
 * improper systems. Fails with ULNA_ERROR_ANALYSIS when A - s E is singular for every s.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_system_new_state_space(const ulna_view *a, const ulna_view *b,
                                                 const ulna_view *c, const ulna_view *d,
                                                 const ulna_view *e, ulna_system **out_system);

/** Frees a system; NULL is allowed.
 * @thread exclusive system
 * @since 0.1 */
ULNA_API void ulna_system_free(ulna_system *system);

/** Its shape.
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_system_get_info(const ulna_system *system, ulna_system_info *out_info);

/** Its numbers: ULNA_SYSTEM_...
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_system_get_values(const ulna_system *system, int32_t which, double *out,
                                            int64_t capacity, int64_t *out_count);

/** H(j omega) at every omega_rad_s (a vector): outputs x inputs complex numbers a frequency.
 * Infinite or NaN at a pole.
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_system_respond(const ulna_system *system, const ulna_view *omega_rad_s,
                                         double *out, int64_t capacity, int64_t *out_count);

/** Joins two systems: ULNA_COMBINE_... Rational where both are (a loop: for one port), else state
 * space.
 * @thread shared first
 * @since 0.1 */
ULNA_API ulna_status ulna_system_combine(const ulna_system *first, const ulna_system *second,
                                         int32_t how, ulna_system **out_system);

/** The same system in another form: ULNA_FORM_...
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_system_convert(const ulna_system *system, int32_t form,
                                         ulna_system **out_system);

#ifdef __cplusplus
}
#endif

#endif
