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
#include <ulna/system.h>

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

/** Over which frequencies and along which line a system is judged. Zero bytes mean the defaults
 * named here.
 * @since 0.1 */
typedef struct ulna_port_options {
  int64_t struct_size;        /* sizeof(ulna_port_options) */
  const ulna_view *direction; /* as many numbers as ports: motion along this line; NULL: any */
  double band_low_rad_s;      /* of a band, not negative */
  double band_high_rad_s;     /* above band_low_rad_s, may be infinite; 0: all frequencies */
  double tolerance; /* relative, within which a sign is undecided; 0: 1e-9; < 0: rounding */
} ulna_port_options;

/** Passivity indices of a square system H, u its input and y its output. Frequencies in rad/s, may
 * be infinite; NaN without one.
 * @since 0.1 */
typedef struct ulna_port_indices {
  int64_t struct_size; /* set by the caller to sizeof(ulna_port_indices) */
  int32_t verdict;     /* ULNA_VERDICT_...: positive real, or passive in the band */
  int32_t reserved;    /* zero */
  double input;        /* largest nu with u'y >= nu u'u; minus infinity when there is none */
  double input_frequency_rad_s;    /* where it is met */
  double output;                   /* largest rho with u'y >= rho y'y; NaN for a singular H */
  double output_frequency_rad_s;   /* where it is met */
  double relative;                 /* gain of (I - H) (I + H)^-1, at most 1 when passive */
  double relative_frequency_rad_s; /* where it is met */
  char reason[512];                /* one sentence: why this verdict */
  char notes[1024];                /* what else to know, one sentence a line */
} ulna_port_indices;

/** Passivity indices and positive realness (Definition 3.2 of Dyck 2013 with lemmas 4.1 and 4.2,
 * the residues at 0 and infinity stated apart): exact by roots of polynomials or eigenvalues of a
 * Hamiltonian matrix, poles and zeros on the axis and improper systems included.
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_of_system(const ulna_system *system,
                                              const ulna_port_options *options,
                                              ulna_port_indices *out_indices);

/** Smallest eigenvalue of the Hermitian part of H(j omega) and of its inverse, and the gain of the
 * scattering: three numbers at every omega_rad_s (a vector, not negative). NaN where there is none.
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_passivity_curves(const ulna_system *system,
                                           const ulna_port_options *options,
                                           const ulna_view *omega_rad_s, double *out,
                                           int64_t capacity, int64_t *out_count);

/** How a two-port is terminated. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_two_port_options {
  int64_t struct_size;    /* sizeof(ulna_two_port_options) */
  double shortage;        /* a of the termination, Re z >= -a; negative: an excess */
  double band_low_rad_s;  /* of a band, not negative */
  double band_high_rad_s; /* above band_low_rad_s, may be infinite; 0: all frequencies */
  double tolerance;       /* relative; 0: 1e-9; < 0: rounding */
  int32_t port;           /* that it ends, 1 or 2; 0: 2. The other ends passively. */
  int32_t reserved;       /* zero */
} ulna_two_port_options;

/** Absolute stability of a two-port: Llewellyn's criterion, (4.1) and (4.2) of Dyck 2013.
 * Frequencies in rad/s.
 * @since 0.1 */
typedef struct ulna_two_port_stability {
  int64_t struct_size; /* set by the caller to sizeof(ulna_two_port_stability) */
  int32_t verdict;     /* ULNA_VERDICT_PASSIVE: absolutely stable */
  int32_t reserved;    /* zero */
  double margin;       /* smallest 2 r_far (r_own - a) - Re k - |k|, k = z12 z21, r = Re z */
  double margin_frequency_rad_s;   /* where it is met */
  double shortage;                 /* largest a of the termination that keeps stability */
  double shortage_frequency_rad_s; /* where it is met */
  double opposite;                 /* largest a of the other one, this one passive */
  double opposite_frequency_rad_s; /* where it is met */
  double own_real;                 /* smallest real part at the port of the termination */
  double own_real_frequency_rad_s; /* where it is met */
  double far_real;                 /* at the other port */
  double far_real_frequency_rad_s; /* where it is met */
  char reason[512];                /* one sentence: why this verdict */
} ulna_two_port_stability;

/** Absolute stability of a 2 x 2 system of impedances (or other immittance parameters). Beyond the
 * printed theorems all four entries must have no pole in the right half-plane, and residues k on
 * the axis must meet 0 <= k12 k21 <= k11 k22.
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_two_port_assess(const ulna_system *system,
                                          const ulna_two_port_options *options,
                                          ulna_two_port_stability *out_stability);

/** Margin and tolerable shortage at every omega_rad_s (a vector, not negative): two numbers each.
 * @thread shared system
 * @since 0.1 */
ULNA_API ulna_status ulna_two_port_curves(const ulna_system *system,
                                          const ulna_two_port_options *options,
                                          const ulna_view *omega_rad_s, double *out,
                                          int64_t capacity, int64_t *out_count);

/** A position-force teleoperator: master (m s + b_m) v_m = f_h - phi e^(-sT) f_c, slave (m s + b_s)
 * v_s = f_c - f_e, coupler f_c = (k_v + k_p/s) (lambda e^(-sT) v_m - v_s). Masses do not matter.
 * @since 0.1 */
typedef struct ulna_position_force {
  int64_t struct_size;           /* sizeof(ulna_position_force) */
  double master_damping_n_s_m;   /* b_m, not negative */
  double slave_damping_n_s_m;    /* b_s, not negative */
  double coupling_damping_n_s_m; /* k_v, above 0 */
  double coupling_stiffness_n_m; /* k_p, not negative */
} ulna_position_force;

/** Largest gain phi lambda at which the teleoperator is stable with every passive environment and
 * every arm of at least this excess (negative: shortage), for every delay_s (one way, a vector).
 * Infinite where nothing limits it.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_teleoperation_gain(const ulna_position_force *loop, double excess_n_s_m,
                                             const ulna_view *delay_s, double *out,
                                             int64_t capacity, int64_t *out_count);

/** Largest stiffness (N/m) of a virtual wall of the given damping, rendered with each delay_s by a
 * device of the given damping, that is stable with every arm of at least this excess.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_teleoperation_stiffness(double device_damping_n_s_m,
                                                  double wall_damping_n_s_m, double excess_n_s_m,
                                                  const ulna_view *delay_s, double *out,
                                                  int64_t capacity, int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
