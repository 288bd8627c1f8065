/* Whole bodies: trees of rigid links on hinges whose first link (the base) is free in space; the
 * human model from height and mass; URDF and MJCF; kinematics and dynamics of recorded motion.
 *
 * World: x forward, y left, z up. Link k is carried by joint k, which its parent holds; the base is
 * link 0 and has no joint. Degrees of freedom are the hinges in the order of their links. A wrench
 * is a force (N) and a moment (N m). SI and radians throughout. Arrays of frames have one row a
 * frame; what belongs to links is written link after link within a row. */
#ifndef ULNA_BODY_H
#define ULNA_BODY_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A body: immutable, shared by any number of threads.
 * @since 0.1 */
typedef struct ulna_body ulna_body;

/** Numbers that describe a link, one row a link: parent (-1: the base), position in the parent (3),
 * orientation there (9, rows of the matrix whose columns are the link's axes), axis of the hinge
 * (3), angle at which it stands as written, mass, centre of mass (3), inertia about it (xx yy zz xy
 * xz yz), lower and upper limit. Link axes but for the position. @since 0.1 */
#define ULNA_BODY_LINK_VALUES (29)
/** Numbers of a link's shape: kind (0 none, 1 box, 2 cylinder, 3 sphere), size (3: edges; radius
 * and length; radius), centre (3), axis of a cylinder (3). @since 0.1 */
#define ULNA_BODY_SHAPE_VALUES (10)

/** Text of a body: URDF. @since 0.1 */
#define ULNA_BODY_URDF (0)
/** Text of a body: MJCF with a base that floats. @since 0.1 */
#define ULNA_BODY_MJCF (1)
/** Text of a body: MJCF with a base fixed to the world. @since 0.1 */
#define ULNA_BODY_MJCF_FIXED (2)

/** Names of a body: links. @since 0.1 */
#define ULNA_BODY_LINK_NAMES (0)
/** Names of a body: hinges, one a degree of freedom. @since 0.1 */
#define ULNA_BODY_JOINT_NAMES (1)
/** Names of a body: the hinge of each link, empty for the base and for fixed links. @since 0.1 */
#define ULNA_BODY_LINK_JOINTS (2)

/** Names of the human model: segments that may be given a length. @since 0.1 */
#define ULNA_HUMAN_SEGMENTS (0)
/** Names of the human model: joint centres and ends that may be given a place. @since 0.1 */
#define ULNA_HUMAN_POINTS (1)
/** Names of the human model: the 17 links that wear a sensor in the usual suit. @since 0.1 */
#define ULNA_HUMAN_SUIT (2)

/** Measures of a person. Zero bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_human_options {
  int64_t struct_size;              /* sizeof(ulna_human_options) */
  double height_m;                  /* 0.5 to 2.5 */
  double mass_kg;                   /* 5 to 400, without what is attached */
  double density_kg_m3;             /* fixes the girth of segments; 0: 1050 */
  int32_t published_masses;         /* 1: mass fractions of the published model */
  int32_t spherical_joints;         /* 1: all 22 joints spherical, 66 hinges; 0: 48 hinges */
  const char *const *segments;      /* names of measured lengths; NULL: none */
  const ulna_view *segment_lengths; /* m, one a name */
  int64_t segment_count;            /* names and lengths */
  const char *const *points;        /* names of measured points, neutral pose; NULL: none */
  const ulna_view *point_positions; /* m, 3 a name, any frame along x forward, y left, z up */
  int64_t point_count;              /* names and points */
} ulna_human_options;

/** How a body moves over frames. A NULL view means zeros, an orientation along the world, and a
 * base that lies still: its proper acceleration is g upwards.
 * @since 0.1 */
typedef struct ulna_body_motion {
  int64_t struct_size;                /* sizeof(ulna_body_motion) */
  const ulna_view *angle;             /* frames x hinges, rad; never NULL */
  const ulna_view *rate;              /* frames x hinges, rad/s */
  const ulna_view *acceleration;      /* frames x hinges, rad/s^2 */
  const ulna_view *position;          /* frames x 3, of the base origin, world, m */
  const ulna_view *orientation;       /* frames x 4, unit quaternion w x y z of the base */
  const ulna_view *velocity;          /* frames x 3, of the base origin, world, m/s */
  const ulna_view *angular_velocity;  /* frames x 3, of the base, world axes, rad/s */
  const ulna_view *base_acceleration; /* frames x 6, proper, of the base origin; angular; world */
} ulna_body_motion;

/** The human model: 49 links on 48 hinges, or 67 on 66, neutral pose a T.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_body_new_human(const ulna_human_options *options, ulna_body **out_body);

/** A body from its links. links: ULNA_BODY_LINK_VALUES columns; names: 2 a link, of the link and of
 * its hinge ("" for a link that is fixed to its parent, and for the base). gravity_m_s2: 0: 9.81.
 * Refuses (ULNA_ERROR_ARGUMENT) with the link's name what no body has.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_body_new_links(const ulna_view *links, const char *const *names,
                                         int64_t name_count, double gravity_m_s2,
                                         ulna_body **out_body);

/** A body from URDF or MJCF text, told apart by the first element.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_body_new_text(const char *text, ulna_body **out_body);

/** A body from a URDF or MJCF file (UTF-8 path).
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_body_read(const char *path, ulna_body **out_body);

/** The body with something rigid added to a link: mass (kg, positive), its centre (3, link axes, m)
 * and its inertia about it (xx yy zz xy xz yz, kg m^2; NULL: a point).
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_attach(const ulna_body *body, const char *name, const char *link,
                                      double mass_kg, const ulna_view *centre,
                                      const ulna_view *inertia, ulna_body **out_body);

/** The same body told from another base link. Links between the two bases get new frames, at the
 * joint that now carries them; torques and their signs stay.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_rebase(const ulna_body *body, const char *base,
                                      ulna_body **out_body);

/** Frees a body; NULL is accepted.
 * @thread exclusive body
 * @since 0.1 */
ULNA_API void ulna_body_free(ulna_body *body);

/** Numbers of links and hinges, mass (kg) and gravity (m/s^2).
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_size(const ulna_body *body, int64_t *out_links, int64_t *out_hinges,
                                    double *out_mass_kg, double *out_gravity_m_s2);

/** Names of a kind (ULNA_BODY_LINK_NAMES, ...), one a line.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_names(const ulna_body *body, int32_t kind, char *out_text,
                                     int64_t capacity, int64_t *out_size);

/** Links: ULNA_BODY_LINK_VALUES and then ULNA_BODY_SHAPE_VALUES numbers a link.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_links(const ulna_body *body, double *out, int64_t capacity,
                                     int64_t *out_count);

/** The body as text of a format (ULNA_BODY_URDF, ...).
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_text(const ulna_body *body, int32_t format, const char *name,
                                    char *out_text, int64_t capacity, int64_t *out_size);

/** Names of the human model of a kind (ULNA_HUMAN_SEGMENTS, ...), one a line.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_human_names(int32_t kind, char *out_text, int64_t capacity,
                                      int64_t *out_size);

/** Where every link is: frames x links x 7, position (m) and unit quaternion w x y z in the world.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_poses(const ulna_body *body, const ulna_body_motion *motion,
                                     double *out, int64_t capacity, int64_t *out_count);

/** Velocity and proper acceleration of a point of a link (link axes, m): frames x 12, linear and
 * angular velocity, linear and angular acceleration, in the link's axes: what an inertial sensor
 * there that is mounted along them reads.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_point(const ulna_body *body, const ulna_body_motion *motion,
                                     const char *link, const ulna_view *point, double *out,
                                     int64_t capacity, int64_t *out_count);

/** Torques of the hinges by recursive Newton-Euler and, after them, the wrench about the base
 * origin (world axes) that is still missing at the base: frames x (hinges + 6). external: frames x
 * 6 links, force and moment about each link's origin, link axes; NULL: none.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_inverse_dynamics(const ulna_body *body,
                                                const ulna_body_motion *motion,
                                                const ulna_view *external, double *out,
                                                int64_t capacity, int64_t *out_count);

/** Centre of mass: frames x 18, its position and velocity, the linear and the angular momentum
 * about it, and their rates, weight counted as an external force; world axes.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_centroid(const ulna_body *body, const ulna_body_motion *motion,
                                        double *out, int64_t capacity, int64_t *out_count);

/** Mass matrix at the first frame, (6 + hinges)^2, row after row: base linear, base angular (world
 * axes, base origin), hinges.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_mass_matrix(const ulna_body *body, const ulna_body_motion *motion,
                                           double *out, int64_t capacity, int64_t *out_count);

/** Jacobian of a point of a link at the first frame, 6 x (6 + hinges), row after row: linear then
 * angular velocity in world axes for those velocities.
 * @thread shared body
 * @since 0.1 */
ULNA_API ulna_status ulna_body_jacobian(const ulna_body *body, const ulna_body_motion *motion,
                                        const char *link, const ulna_view *point, double *out,
                                        int64_t capacity, int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
