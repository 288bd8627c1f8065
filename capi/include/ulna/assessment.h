/* Assessment of an arm by an exoskeleton: passive mobilisation as a simulated
 * experiment, and stiffness and damping of a joint from its log or from that of
 * a real device.
 *
 * Angles rad, torques N m, excitation 0 to 1. A torque is positive that turns
 * its joint towards positive angles. Sign of stiffness and damping: K = -d tau
 * / d theta, D = -d tau / d theta', so that what resists is positive and an
 * anti-spring has K < 0 (Tesfazgi 2023 has the other sign). */
#ifndef ULNA_ASSESSMENT_H
#define ULNA_ASSESSMENT_H

#include <ulna/base.h>
#include <ulna/exo.h>
#include <ulna/impedance.h>
#include <ulna/record.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A simulated mobilisation: how it ended and its record.
 * @since 0.1 */
typedef struct ulna_mobilisation ulna_mobilisation;

/** Stiffness and damping of one joint or several.
 * @since 0.1 */
typedef struct ulna_viscoelastic ulna_viscoelastic;

/** An assessment with a full plant beside that with its reduced one.
 * @since 0.1 */
typedef struct ulna_plant_difference ulna_plant_difference;

/** The derivative gain is damping in the joints: stable with any arm. @since 0.1 */
#define ULNA_TORQUE_IMPLICIT (0)
/** The torque is recomputed at every time step. @since 0.1 */
#define ULNA_TORQUE_EVERY_STEP (1)
/** The torque is held between instants of the control, as published. @since 0.1 */
#define ULNA_TORQUE_HELD (2)

/** Logistic, the published movement: starts with a step of 0.6 % and ends at 90.8 % of the way.
 * @since 0.1 */
#define ULNA_MOTION_LOGISTIC (0)
/** Minimum jerk. @since 0.1 */
#define ULNA_MOTION_MINIMUM_JERK (1)
/** Constant speed. @since 0.1 */
#define ULNA_MOTION_RAMP (2)
/** Half a period of a sinusoid a way. @since 0.1 */
#define ULNA_MOTION_SINUSOID (3)

/** Constant co-contraction. @since 0.1 */
#define ULNA_EXCITATION_CONSTANT (0)
/** Answers to stretch and its rate after a delay. @since 0.1 */
#define ULNA_EXCITATION_STRETCH_REFLEX (1)
/** Answers to the rate of stretch at once, as in spasticity. @since 0.1 */
#define ULNA_EXCITATION_VELOCITY_DEPENDENT (2)

/** The movement was carried out. @since 0.1 */
#define ULNA_MOBILISATION_OK (0)
/** The start was not reached. @since 0.1 */
#define ULNA_MOBILISATION_FAILED_INIT (1)
/** Too fast, too far from the reference, or the plant gave up. @since 0.1 */
#define ULNA_MOBILISATION_DIVERGED (2)
/** A moved joint left its range, or the plant met what it cannot compute.
 * @since 0.1 */
#define ULNA_MOBILISATION_LIMIT (3)
/** Computing took too long. @since 0.1 */
#define ULNA_MOBILISATION_TIMEOUT (4)
/** Numbers that are not finite. @since 0.1 */
#define ULNA_MOBILISATION_NONFINITE (5)

/** Damping and Coulomb friction as the simulated device has them. @since 0.1 */
#define ULNA_FRICTION_ENGINE (0)
/** Coulomb friction at its limit, none at rest. @since 0.1 */
#define ULNA_FRICTION_COULOMB (1)
/** No Coulomb friction. @since 0.1 */
#define ULNA_FRICTION_NONE (2)

/** Why a run did not end as ok, one sentence; else empty. @since 0.1 */
#define ULNA_MOBILISATION_REASON (0)
/** What to know of a run, a sentence a line. @since 0.1 */
#define ULNA_MOBILISATION_NOTES (1)

/** How an arm is mobilised. Zero bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_protocol {
  int64_t struct_size;        /* sizeof(ulna_protocol) */
  const char *const *moved;   /* joints of the device that move; NULL: its last one */
  const ulna_view *end_rad;   /* where each of them ends; NULL: 0 (logistic) or 10 degrees */
  int64_t moved_count;        /* entries of moved */
  const ulna_view *start_rad; /* every joint; NULL: the reference, the last joint at 110 degrees */
  const ulna_view *speeds;    /* one movement there, and back, at each; NULL: 1 */
  int32_t repeats;            /* of each speed; 0: 1 */
  int32_t shape;              /* ULNA_MOTION_... */
  int32_t torque;             /* ULNA_TORQUE_... */
  int32_t excitation;         /* ULNA_EXCITATION_... */
  int32_t from_reference;     /* 1: begins in the reference with the motors off, as published */
  int32_t carry_weight;       /* 1: the motors carry the nominal model's weight */
  int32_t balanced;           /* 1: the extensors balance the flexors at the start */
  int32_t published_flags;    /* 1: only a moved joint above +2 rad/s ends a movement */
  double duration_s;          /* of one way at speed 1; 0: 6 */
  double rest_s;              /* at both ends of a way */
  double settle_s;            /* 0: 0.5, or 2.5 from the reference; < 0: none */
  double approach_s;          /* minimum jerk to the start; 0: the start at once */
  double start_limit_s;       /* to reach the start; 0: 25 */
  double start_angle_rad;     /* how near it must be; 0: 1 degree */
  double start_rate_rad_s;    /* and how slow; 0: 0.25 degrees/s */
  double kp;                  /* N m/rad; 0: 50; < 0: none */
  double ki;                  /* N m/(rad s); 0: 25; < 0: none */
  double kd;                  /* N m s/rad; 0: 15; < 0: none */
  double hold_s;              /* of a torque that is held; 0: 0.01 */
  double flexors;             /* excitation at rest; 0: 0.4; < 0: none */
  double extensors;           /* 0: 0.4; < 0: none */
  double shoulder;            /* of the shoulder's muscles */
  double rate_gain_s;         /* excitation for a stretch of one optimal length a second; 0: 0.5 */
  double rate_threshold_1_s;  /* 0: 0.1; < 0: none */
  double length_gain;         /* excitation for a stretch of one optimal length */
  double length_threshold;    /* 0: 1 */
  double delay_s;             /* of the stretch reflex; 0: 0.04; < 0: none */
  double log_rate_hz;         /* 0: 100 */
  double rate_limit_rad_s;    /* of any joint in the movement; 0: 10 */
  double follow_limit_rad;    /* from the reference; 0: 20 degrees */
  double limit_margin_rad;    /* beyond the range of a moved joint */
  double time_limit_s;        /* of computing; 0: none */
  double reference_hold_s;    /* the movement's reference changes only so often; 0: always */
} ulna_protocol;

/** How a mobilisation ended. Nothing is filled in: without a record the slip is NaN.
 * @since 0.1 */
typedef struct ulna_mobilisation_result {
  int64_t struct_size;     /* set by the caller to sizeof(ulna_mobilisation_result) */
  int32_t status;          /* ULNA_MOBILISATION_... */
  int32_t reserved;        /* zero */
  int64_t rows;            /* of the record; 0: there is none */
  int64_t saturated_rows;  /* with a motor at its limit */
  double simulated_s;      /* in all */
  double start_s;          /* when the start was reached */
  double largest_slip_rad; /* between a moved joint and the arm's */
} ulna_mobilisation_result;

/** Errors of a device's sensors, rms, white but for the slow one. Zero bytes are none.
 * @since 0.1 */
typedef struct ulna_joint_errors {
  int64_t struct_size;        /* sizeof(ulna_joint_errors) */
  double angle_rad;           /* of the encoders */
  double rate_rad_s;          /* of the rates */
  double acceleration_rad_s2; /* of the accelerations */
  double torque_nm;           /* of the motors' torque */
  double slow_torque_nm;      /* of the motors' torque, below slow_hz */
  double slow_hz;             /* 0: 0.5 */
  int64_t seed;               /* 0 is a seed */
  int64_t run;                /* repetition of the seed */
} ulna_joint_errors;

/** How stiffness and damping are found. Zero bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_viscoelastic_options {
  int64_t struct_size;       /* sizeof(ulna_viscoelastic_options) */
  const char *const *joints; /* NULL: those whose theta_ has the role position */
  int64_t joint_count;       /* entries of joints */
  int32_t friction;          /* ULNA_FRICTION_... */
  int32_t no_damping_torque; /* 1: the nominal model has no damping */
  int32_t no_inertia;        /* 1: the nominal model has no inertia */
  int32_t human_angle;       /* 1: the true human angle as regressor; simulated records only */
  int32_t no_intercept;      /* 1: no torque at angle 0 */
  int32_t no_rate;           /* 1: no rate as regressor, and no D */
  int32_t errors;            /* ULNA_ERRORS_...: with the misfit counted */
  int32_t reserved;          /* zero */
  double hac_lag_s;          /* 0: 0.4 */
  double block_s;            /* 0: 0.4 */
  int64_t bootstrap;         /* resamples; 0: 1000 */
  double level;              /* of intervals; 0: 0.95 */
  int64_t seed;              /* 0 is a seed */
} ulna_viscoelastic_options;

/** Stiffness and damping of a joint. What is not known is NaN. Errors and intervals are those of
 * the noise of the measurement, found beside all that is a function of angle and rate; noise as
 * slow as the movement cannot be told from the arm. Those with the misfit count all that a straight
 * line leaves.
 * @since 0.1 */
typedef struct ulna_viscoelastic_joint {
  int64_t struct_size;         /* set by the caller to sizeof(ulna_viscoelastic_joint) */
  int64_t rows;                /* of the record */
  double k;                    /* N m/rad */
  double d;                    /* N m s/rad */
  double offset;               /* torque at angle 0, N m */
  double k_error;              /* standard error */
  double d_error;              /* standard error */
  double k_interval[2];        /* low, high */
  double d_interval[2];        /* low, high */
  double k_misfit_error;       /* standard error with the misfit counted */
  double d_misfit_error;       /* standard error with the misfit counted */
  double k_misfit_interval[2]; /* low, high */
  double d_misfit_interval[2]; /* low, high */
  double level;                /* of the intervals */
  double r_squared;            /* share of the torque's variance */
  double residual_rms;         /* of the regression, N m */
  double noise_rms;            /* of it, what is no function of angle and rate, N m */
  double condition;            /* of the regressors */
  double true_k;               /* by the same regressors, N m/rad */
  double true_d;               /* N m s/rad */
  double true_k_alone;         /* slope on the human angle with intercept only: as published */
  double model_residual_rms;   /* nominal less true torque of the muscles, N m */
  double model_residual_max;   /* N m */
} ulna_viscoelastic_joint;

/** What the reduced plant costs in one assessment. What an assessment does not give is NaN. Not
 * compared is what bushings do not know: pressure, pressed area, tension of the strap, sliding.
 * @since 0.1 */
typedef struct ulna_plant_difference_result {
  int64_t struct_size;       /* set by the caller to sizeof(ulna_plant_difference_result) */
  double full_k;             /* of the full plant, N m/rad */
  double full_k_error;       /* of it, less the true one */
  double full_d;             /* N m s/rad */
  double full_slip_rad;      /* largest since donned */
  double k;                  /* reduced less full, N m/rad */
  double k_error;            /* reduced less full, of k less the true one */
  double d;                  /* reduced less full, N m s/rad */
  double slip_rad;           /* reduced less full */
  double torque_rms_nm;      /* of the muscles' torque by the nominal model */
  double angle_rms_rad;      /* of the human joint */
  double displacement_rms_m; /* of the limbs in their cuffs */
} ulna_plant_difference_result;

/** The published simulation (Tesfazgi 2023), built again from its numbers, with the factors of its
 * study and the defects of its plant as switches. Zero bytes are the nominal arm and every defect;
 * those of the controller and of the estimator are in ulna_protocol and ulna_viscoelastic_options.
 * @since 0.1 */
typedef struct ulna_published_options {
  int64_t struct_size;         /* sizeof(ulna_published_options) */
  int32_t own_straps;          /* 1: firm straps; 0: 73 of 74 threads as soft as tissue */
  int32_t whole_nominal;       /* 1: the nominal model has every mass of the plant, in its place */
  int32_t no_self_contact;     /* 1: tissue and straps touch limb and device only */
  int32_t wide_limits;         /* 1: ranges 10 degrees wider, so that the start is inside of them */
  double upper_factor;         /* of the upper arm's length; 0: 1 */
  double fore_factor;          /* of the forearm's length; 0: 1 */
  double upper_mass_kg;        /* without soft tissue; 0: 1.761 */
  double fore_mass_kg;         /* without soft tissue; 0: 0.962 */
  double upper_stiffness_1_s2; /* of the tissue's constraints; 0: 537.5 */
  double fore_stiffness_1_s2;  /* 0: 537.5 */
  double viscosity_1_s;        /* 0: 111 */
} ulna_published_options;

/** Compiles the published simulation: 430 degrees of freedom; a run of it takes 0.7 GB of memory.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_new_published(const ulna_published_options *options,
                                              ulna_plant **out_plant);

/** Mobilises the arm of a plant. nominal: a plant whose description is the nominal model; NULL: the
 * plant's own. A plant that was read or changed needs one; joints, motors and muscles of a scene
 * that was read have its names. Descriptions that cannot be are refused in one sentence; what goes
 * wrong in the run is in its status. The record holds, for each joint of the device, theta_,
 * theta_dot_, theta_ddot_, tau_motor_, tau_loss_ (damping and friction as they were), tau_hum_
 * (torque of the muscles by the nominal model), theta_ref_; for each human joint q_, q_dot_,
 * tau_muscle_ (true); a_ of each muscle; and what else the plant logs.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_mobilisation_new(const ulna_plant *plant, const ulna_plant *nominal,
                                           const ulna_protocol *protocol, ulna_token *token,
                                           ulna_mobilisation **out_mobilisation);

/** Frees a mobilisation; NULL is allowed.
 * @thread exclusive mobilisation
 * @since 0.1 */
ULNA_API void ulna_mobilisation_free(ulna_mobilisation *mobilisation);

/** How it ended.
 * @thread shared mobilisation
 * @since 0.1 */
ULNA_API ulna_status ulna_mobilisation_get_result(const ulna_mobilisation *mobilisation,
                                                  ulna_mobilisation_result *out_result);

/** Its words. what: ULNA_MOBILISATION_REASON or _NOTES.
 * @thread shared mobilisation
 * @since 0.1 */
ULNA_API ulna_status ulna_mobilisation_text(const ulna_mobilisation *mobilisation, int32_t what,
                                            char *out_text, int64_t capacity, int64_t *out_size);

/** Its record, as far as the movement came. Fails with ULNA_ERROR_DATA where it did not begin.
 * @thread shared mobilisation
 * @since 0.1 */
ULNA_API ulna_status ulna_mobilisation_record(const ulna_mobilisation *mobilisation,
                                              ulna_record **out_record);

/** A record of a mobilisation with errors of the device's sensors.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_record_with_joint_errors(const ulna_record *record,
                                                   const ulna_plant *plant,
                                                   const ulna_plant *nominal,
                                                   const ulna_joint_errors *errors,
                                                   ulna_record **out_record);

/** Stiffness and damping by regression of the nominal torque of the muscles, (9), (20) and (21) of
 * Tesfazgi 2023. plant: whose device it is; nominal: whose description is the nominal model, NULL:
 * the plant's own. A record needs theta_ and tau_motor_ of every joint of the device; rates and
 * accelerations that it does not hold are derivatives of the angles.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_viscoelastic_new(const ulna_record *record, const ulna_plant *plant,
                                           const ulna_plant *nominal,
                                           const ulna_viscoelastic_options *options,
                                           ulna_token *token, ulna_viscoelastic **out_viscoelastic);

/** Frees an estimate; NULL is allowed.
 * @thread exclusive viscoelastic
 * @since 0.1 */
ULNA_API void ulna_viscoelastic_free(ulna_viscoelastic *viscoelastic);

/** How many joints it has.
 * @thread shared viscoelastic
 * @since 0.1 */
ULNA_API ulna_status ulna_viscoelastic_count(const ulna_viscoelastic *viscoelastic,
                                             int64_t *out_count);

/** One joint.
 * @thread shared viscoelastic
 * @since 0.1 */
ULNA_API ulna_status ulna_viscoelastic_get_joint(const ulna_viscoelastic *viscoelastic,
                                                 int64_t joint, ulna_viscoelastic_joint *out_joint);

/** Name of a joint, and after it its warnings, a sentence a line.
 * @thread shared viscoelastic
 * @since 0.1 */
ULNA_API ulna_status ulna_viscoelastic_text(const ulna_viscoelastic *viscoelastic, int64_t joint,
                                            char *out_text, int64_t capacity, int64_t *out_size);

/** Assesses the arm of a plant with soft interfaces and that of its reduced plant by the same
 * protocol and estimator, and compares the first joint that moved. Fails with ULNA_ERROR_ANALYSIS
 * when one of the two runs does not end as ok.
 * @thread shared full
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_difference_new(const ulna_plant *full, const ulna_plant *reduced,
                                               const ulna_protocol *protocol,
                                               const ulna_viscoelastic_options *options,
                                               ulna_token *token,
                                               ulna_plant_difference **out_difference);

/** Frees a comparison; NULL is allowed.
 * @thread exclusive difference
 * @since 0.1 */
ULNA_API void ulna_plant_difference_free(ulna_plant_difference *difference);

/** Its numbers.
 * @thread shared difference
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_difference_get_result(const ulna_plant_difference *difference,
                                                      ulna_plant_difference_result *out_result);

/** Name of the joint that is compared.
 * @thread shared difference
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_difference_text(const ulna_plant_difference *difference,
                                                char *out_text, int64_t capacity,
                                                int64_t *out_size);

/** The record of one of the two mobilisations. reduced: 0 the full plant's, 1 the reduced one's.
 * @thread shared difference
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_difference_record(const ulna_plant_difference *difference,
                                                  int32_t reduced, ulna_record **out_record);

/** Impedance of the muscles alone at states of the human joints (rows), -d tau / d q and -d tau / d
 * q', each row by row: rows x (2 human joints squared). activation: rows x muscles.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_muscle_impedance(const ulna_plant *plant, const ulna_view *angle,
                                                 const ulna_view *rate, const ulna_view *activation,
                                                 ulna_token *token, double *out, int64_t capacity,
                                                 int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
