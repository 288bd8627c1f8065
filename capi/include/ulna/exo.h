/* The exoskeleton and the arm in it: scenes for the physics engine, their nominal model, runs, and
 * the maximum isometric torque of the elbow.
 *
 * World: x forward, y left, z up; the origin is the device's shoulder centre. Angles rad, torques
 * N m, positions m, muscle excitation and activation 0 to 1. Sign: a torque is positive that turns
 * its joint towards positive angles, so flexion of the elbow is positive. Parts of a scene are
 * found by name. Arrays hold one pose a row; results are written row by row. */
#ifndef ULNA_EXO_H
#define ULNA_EXO_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A compiled scene; immutable, shared by runs and threads.
 * @since 0.1 */
typedef struct ulna_plant ulna_plant;

/** A simulation of a plant, of one thread at a time; keeps its plant alive.
 * @since 0.1 */
typedef struct ulna_run ulna_run;

/** Upper arm and forearm stand in their links, perfectly aligned. @since 0.1 */
#define ULNA_COUPLING_RIGID (0)
/** The arm moves on its own joints beside the device. @since 0.1 */
#define ULNA_COUPLING_APART (1)
/** No arm. @since 0.1 */
#define ULNA_COUPLING_EXO_ONLY (2)
/** No exoskeleton. @since 0.1 */
#define ULNA_COUPLING_ARM_ONLY (3)

/** Elbow muscles around cylinders, fitted to measured torque. @since 0.1 */
#define ULNA_MUSCLES_FITTED (0)
/** Elbow muscles on straight lines, published forces and ranges. @since 0.1 */
#define ULNA_MUSCLES_PUBLISHED (1)
/** Paths around cylinders, published forces: where the fit begins. @since 0.1 */
#define ULNA_MUSCLES_UNFITTED (2)
/** No muscles. @since 0.1 */
#define ULNA_MUSCLES_NONE (3)

/** Names of a part of a scene. @since 0.1 */
#define ULNA_PART_BODY (0)
/** Joints, in the order of their angles. @since 0.1 */
#define ULNA_PART_JOINT (1)
/** Geoms. @since 0.1 */
#define ULNA_PART_GEOM (2)
/** Sites. @since 0.1 */
#define ULNA_PART_SITE (3)
/** Tendons. @since 0.1 */
#define ULNA_PART_TENDON (4)
/** Actuators: motors and muscles, in the order of their controls. @since 0.1 */
#define ULNA_PART_ACTUATOR (5)
/** Equality constraints. @since 0.1 */
#define ULNA_PART_EQUALITY (6)

/** Of a body: 1 value, kg. @since 0.1 */
#define ULNA_QUANTITY_MASS (0)
/** Of a body: 9 values, centre of mass x y z (m), then xx yy zz xy xz yz about it (kg m^2).
 * @since 0.1 */
#define ULNA_QUANTITY_INERTIA (1)
/** Of a body in its parent: 3 values, m. @since 0.1 */
#define ULNA_QUANTITY_BODY_POSITION (2)
/** Of a site in its body: 3 values, m. @since 0.1 */
#define ULNA_QUANTITY_SITE_POSITION (3)
/** Of a joint: 1 value, N m s/rad. @since 0.1 */
#define ULNA_QUANTITY_DAMPING (4)
/** Coulomb friction of a joint: 1 value, N m. @since 0.1 */
#define ULNA_QUANTITY_FRICTION (5)
/** Of an actuator: 2 values, shortest and longest path, m. @since 0.1 */
#define ULNA_QUANTITY_LENGTH_RANGE (6)
/** Of a muscle: 3 values, peak force (N), normalised lengths at the ends of its length range.
 * @since 0.1 */
#define ULNA_QUANTITY_MUSCLE (7)
/** Of an equality: 2 values, the engine's solref. @since 0.1 */
#define ULNA_QUANTITY_REFERENCE (8)
/** Of an equality: 5 values, the engine's solimp. @since 0.1 */
#define ULNA_QUANTITY_IMPEDANCE (9)

/** Torque by the recursive Newton-Euler equations of the description. @since 0.1 */
#define ULNA_DYNAMICS_NOMINAL (0)
/** The same and damping and Coulomb friction (none at rest). @since 0.1 */
#define ULNA_DYNAMICS_FRICTION (1)
/** Torque that the engine needs, with friction, limits and muscles at no excitation. @since 0.1 */
#define ULNA_DYNAMICS_ENGINE (2)

/** Angle of each joint; may be set. @since 0.1 */
#define ULNA_RUN_POSITION (0)
/** Rate of each joint; may be set. @since 0.1 */
#define ULNA_RUN_VELOCITY (1)
/** Activation of each muscle; may be set. @since 0.1 */
#define ULNA_RUN_ACTIVATION (2)
/** Control of each actuator: motor torque N m, excitation of a muscle; may be set. @since 0.1 */
#define ULNA_RUN_CONTROL (3)
/** Torque on each joint from outside; may be set. @since 0.1 */
#define ULNA_RUN_APPLIED (4)
/** Acceleration of each joint. @since 0.1 */
#define ULNA_RUN_ACCELERATION (5)
/** Coriolis, centrifugal and gravity torque of each joint. @since 0.1 */
#define ULNA_RUN_BIAS (6)
/** Damping torque on each joint. @since 0.1 */
#define ULNA_RUN_PASSIVE (7)
/** Torque of friction, limits, constraints and contacts on each joint. @since 0.1 */
#define ULNA_RUN_CONSTRAINT (8)
/** Torque of all actuators on each joint. @since 0.1 */
#define ULNA_RUN_ACTUATOR_TORQUE (9)
/** Force of each actuator; a muscle that pulls has less than 0. @since 0.1 */
#define ULNA_RUN_ACTUATOR_FORCE (10)
/** Length of each actuator's path, m, or its joint's angle. @since 0.1 */
#define ULNA_RUN_ACTUATOR_LENGTH (11)
/** Time (s), energy of weight (J), energy of motion (J). @since 0.1 */
#define ULNA_RUN_TIME_AND_ENERGY (12)

/** A scene from descriptions. Zero bytes are the published device holding the published arm
 * rigidly, with fitted muscles.
 * @since 0.1 */
typedef struct ulna_scene_options {
  int64_t struct_size;            /* sizeof(ulna_scene_options) */
  int32_t coupling;               /* ULNA_COUPLING_... */
  int32_t muscles;                /* ULNA_MUSCLES_... of the elbow */
  int32_t shoulder_muscles;       /* 1: fifteen more, straight, at published forces */
  int32_t published_straps;       /* 1: 1.2 kg each and off centre; 0: 0.05 kg each */
  int32_t pronation;              /* 1: the radius turns */
  int32_t wrist;                  /* 1: the hand bends */
  int32_t elliptic;               /* 1: elliptic friction cones; 0: pyramids */
  int32_t iterations;             /* of the solver; 0: 200 */
  double upper_factor;            /* of the upper arm's length; 0: 1 */
  double fore_factor;             /* of the forearm's length; 0: 1 */
  double upper_mass_kg;           /* without soft tissue; 0: 1.761 */
  double fore_mass_kg;            /* without soft tissue; 0: 0.962 */
  double height_m;                /* with mass_kg: segments of such a person; 0: as above */
  double mass_kg;                 /* with height_m */
  double timestep_s;              /* 0: 0.005 */
  double tolerance;               /* of the solver; 0: 1e-11 */
  double impratio;                /* 0: 10 */
  const ulna_view *links;         /* links x 26, see ulna_plant_new; NULL: the published device */
  const char *const *link_names;  /* 2 a link: of the link, of its joint; NULL: "Link1", "J1" ... */
  int64_t link_name_count;        /* entries of link_names */
  const ulna_view *muscle_values; /* muscles x 3: peak force N, range; NULL: as `muscles` says */
} ulna_scene_options;

/** Compiles a scene. A row of `links` is a link on the one before: position x y z (m), orientation
 * as quaternion w x y z, joint axis x y z (link axes), lower and upper limit and reference angle
 * (rad), mass (kg), centre of mass x y z (m), inertia about it xx yy zz xy xz yz (kg m^2), damping
 * (N m s/rad), Coulomb friction (N m), motor limit (N m, 0: no motor). The last link but one
 * carries the upper arm, the last one the forearm and its joint bends the elbow. Links come without
 * straps, and their joints are not named like the arm's (shoulder_flexion, shoulder_abduction,
 * shoulder_rotation, elbow_flexion, forearm_pronation, wrist_flexion, wrist_abduction). Held
 * rigidly, the elbow of an arm of any length is put on the last joint, which must be within 60 mm
 * of that arm's elbow, or the published one's, in the reference. Refuses with one sentence
 * (ULNA_ERROR_ARGUMENT) what cannot be, and names link, joint or muscle.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_new(const ulna_scene_options *options, ulna_plant **out_plant);

/** Compiles a scene from an MJCF file; such a plant has no nominal model. contacts: how many a run
 * has room for at once; 0: 100.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_read(const char *path, int64_t contacts, ulna_plant **out_plant);

/** A plant with another value of one quantity of one part, without compiling again; it has no
 * nominal model.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_change(const ulna_plant *plant, int32_t quantity, const char *name,
                                       const ulna_view *values, ulna_plant **out_plant);

/** Frees a plant; NULL is allowed. Runs of it stay alive.
 * @thread exclusive plant
 * @since 0.1 */
ULNA_API void ulna_plant_free(ulna_plant *plant);

/** The scene in the engine's language (MJCF); empty for plants that were read or changed.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_text(const ulna_plant *plant, char *out_text, int64_t capacity,
                                     int64_t *out_size);

/** Names of the parts of one kind, each followed by a line feed.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_names(const ulna_plant *plant, int32_t part, char *out_text,
                                      int64_t capacity, int64_t *out_size);

/** The values that ulna_plant_change would replace.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_values(const ulna_plant *plant, int32_t quantity, const char *name,
                                       double *out, int64_t capacity, int64_t *out_count);

/** Angles in which the scene is written.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_reference(const ulna_plant *plant, double *out, int64_t capacity,
                                          int64_t *out_count);

/** Limits of the joints, joints x 2; without one -inf, inf.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_range(const ulna_plant *plant, double *out, int64_t capacity,
                                      int64_t *out_count);

/** Refuses a start (one angle a joint) outside the joints' limits and names the joint.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_check_start(const ulna_plant *plant, const ulna_view *start);

/** Inertia matrix at each row of angles by the engine, rows x (joints squared).
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_inertia(const ulna_plant *plant, const ulna_view *angle,
                                        double *out, int64_t capacity, int64_t *out_count);

/** Torque at each joint for a motion, rows x joints. dynamics: ULNA_DYNAMICS_...
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_inverse_dynamics(const ulna_plant *plant, int32_t dynamics,
                                                 const ulna_view *angle, const ulna_view *rate,
                                                 const ulna_view *acceleration, double *out,
                                                 int64_t capacity, int64_t *out_count);

/** What each muscle does at a joint held at each angle, the others in `pose` (NULL: the reference):
 * angles x (4 times the muscles): path lengths (m), moment arms (m, positive where pulling turns
 * the joint to positive angles), torque at full activation without the passive part, passive
 * torque.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_muscles(const ulna_plant *plant, const char *joint,
                                        const char *const *muscles, int64_t muscle_count,
                                        const ulna_view *angle, const ulna_view *pose,
                                        ulna_token *token, double *out, int64_t capacity,
                                        int64_t *out_count);

/** Fits forces and ranges of the plant's elbow muscles to maximum isometric torque (Amis,
 * Buchanan), at a passive torque of at most passive_limit_nm within 30 to 110 degrees: muscles x 3
 * in the order of the description. evaluations: at most, in each of four rounds; 0: 60000.
 * passive_limit_nm: 0: 2.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_fit_muscles(const ulna_plant *plant, double passive_limit_nm,
                                            int64_t evaluations, ulna_token *token, double *out,
                                            int64_t capacity, int64_t *out_count);

/** Starts a run in the plant's reference, at rest.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_run_new(const ulna_plant *plant, ulna_run **out_run);

/** Frees a run; NULL is allowed.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API void ulna_run_free(ulna_run *run);

/** Back to the plant's reference, at rest, time 0.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API ulna_status ulna_run_reset(ulna_run *run);

/** Sets a field that may be set, one value an entry; ulna_run_forward makes the rest follow.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API ulna_status ulna_run_set(ulna_run *run, int32_t field, const ulna_view *values);

/** Copies a field out.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API ulna_status ulna_run_get(const ulna_run *run, int32_t field, double *out, int64_t capacity,
                                  int64_t *out_count);

/** Computes what follows from the state without moving it.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API ulna_status ulna_run_forward(ulna_run *run);

/** Moves on by time steps. Fails when the motion diverges, when there is no room for the contacts,
 * when a muscle is shorter than the engine can compute, and when the engine gives up: the run can
 * then only be freed. A control that is not finite is refused before anything moves.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API ulna_status ulna_run_step(ulna_run *run, int64_t steps, ulna_token *token);

#ifdef __cplusplus
}
#endif

#endif
