/* Soft interfaces between an arm and an exoskeleton: cuff, strap and soft tissue of the upper arm
 * and of the forearm, in full or reduced to bushings, and the compression test of the tissue.
 *
 * Entry 0 is the upper arm, entry 1 the forearm. A cuff's frame: origin on the axis of its arc, x
 * across, y towards its opening, z along the limb. SI throughout; wrenches act on the limb, their
 * moments about the tissue's centre. All stiffness is true (N/m), whatever the number and the mass
 * of the elements. */
#ifndef ULNA_SOFT_H
#define ULNA_SOFT_H

#include <ulna/base.h>
#include <ulna/exo.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Shells three quarters around the limb, towards the far end of its segment, long, tightened.
 * @since 0.1 */
#define ULNA_CUFFS_FITTED (0)
/** Short open half shells in the middle of the segments: the published geometry.
 * @since 0.1 */
#define ULNA_CUFFS_PUBLISHED (1)

/** How the arm is held. Zero bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_soft_options {
  int64_t struct_size;           /* sizeof(ulna_soft_options) */
  int32_t fixed_device;          /* 1: of the published lengths; 0: adjusted to the arm */
  int32_t unlined;               /* 1: bare cuffs; 0: padded out to the limb */
  int32_t cuffs;                 /* ULNA_CUFFS_FITTED or ULNA_CUFFS_PUBLISHED */
  int32_t reserved;              /* zero */
  double shoulder_offset_m[3];   /* of the arm's shoulder from the device's, world */
  double elbow_offset_m[3];      /* of the elbow from its place, humerus axes */
  double donning_rotation_rad;   /* of the upper arm about its axis in its cuff */
  double stiffness_n_m[2];       /* of an element of the tissue; 0: 537.5 */
  double viscosity_n_s_m[2];     /* of such an element; 0: 10; < 0: none */
  double neighbour[2];           /* of the surface, share of the stiffness; 0: 0.7; < 0: none */
  double volume[2];              /* of the volume, share of it; 0: 0.003; < 0: none */
  double element_mass_kg[2];     /* that slides; 0: 0.003 */
  double friction[2];            /* of skin on cuff and strap; 0: 0.7; < 0: none */
  double pretension_n[2];        /* of the whole strap when donned; 0: the default; < 0: none */
  double strap_length_m[2];      /* without tension; 0: as the pretension asks for */
  double strap_stiffness_n_m[2]; /* of the webbing between two points; 0: 20000 */
  double squeeze_m[2];           /* of the lining into the limb; 0: the default; < 0: none */
  double tightness_pa[2];        /* pressure that ends it; 0: the default; < 0: no such end */
  double shear[2];               /* stiffness along the skin, of that across it; 0: 1/3 */
} ulna_soft_options;

/** How a full interface becomes bushings. Zero bytes are the defaults named here; an angle of 0 is
 * written as 1e-12.
 * @since 0.1 */
typedef struct ulna_reduction_options {
  int64_t struct_size; /* sizeof(ulna_reduction_options) */
  double start_rad;    /* where the device's last joint begins its movement; 0: 110 degrees */
  double end_rad;      /* and where it ends; 0: 3 degrees */
  double activation;   /* of the elbow's muscles; 0: 0.4; < 0: none */
  int64_t poses;       /* that the arm is followed through, 4 to 1000; 0: 25 */
} ulna_reduction_options;

/** Compiles a scene in which soft interfaces hold the arm; `coupling` of the scene does not count.
 * Refuses with one sentence (ULNA_ERROR_ARGUMENT) what cannot be: a strap that is too short, a limb
 * beside its cuff, an offset out of reach.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_new_soft(const ulna_scene_options *scene,
                                         const ulna_soft_options *soft, ulna_plant **out_plant);

/** The plant with each interface replaced by bushings (Voigt elements of six dimensions) at cuff
 * and strap. The arm at rest is followed through a movement of the device's last joint, and what
 * cuff and strap do to it becomes their stiffness; it takes some 50 ms. Same outputs but for
 * pressure, area, tension and sliding.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_reduce(const ulna_plant *plant,
                                       const ulna_reduction_options *options, ulna_token *token,
                                       ulna_plant **out_plant);

/** Bushings of a reduced plant, a row each: interface, 1 for a strap, origin (6), preload (6),
 * stiffness (36), damping (36). Coordinates: displacement (m) and rotation vector (rad) of the limb
 * since it was donned, cuff frame. Empty for other plants.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_plant_bushings(const ulna_plant *plant, double *out, int64_t capacity,
                                         int64_t *out_count);

/** Puts the arm into the device with its joints at angles (one each), at rest, time 0. Only runs of
 * a plant with soft interfaces; ulna_run_new and ulna_run_reset do it in the reference.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API ulna_status ulna_run_don(ulna_run *run, const ulna_view *device_angle);

/** What each interface did in the last step, a row each: wrench of the cuff (6), wrench of the
 * strap (6), displacement of the tissue's centre since donned (3, m), turn of the limb (rad),
 * sliding of the skin along the cuff (3, m), largest pressure (Pa), pressed area (m^2), tension of
 * the strap (N). NaN for what bushings do not know.
 * @thread exclusive run
 * @since 0.1 */
ULNA_API ulna_status ulna_run_interfaces(ulna_run *run, double *out, int64_t capacity,
                                         int64_t *out_count);

/** Compression of the tissue of an interface between two plates, a force that rises in steps and
 * waits until all has settled: rows of force (N), strain, stress (Pa), modulus (Pa), largest rise
 * of energy less work in the step (J). which: 0 upper arm, 1 forearm. largest_strain: 0: 0.45.
 * Fails with ULNA_ERROR_ANALYSIS when the tissue does not settle.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_tissue_compress(const ulna_soft_options *soft, int32_t which,
                                          double largest_strain, ulna_token *token, double *out,
                                          int64_t capacity, int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
