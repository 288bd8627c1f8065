/* Wrenches of a passive device that carries both arms from a hip belt, such as an exoskeleton for
 * overhead work, on any model of the body.
 *
 * World axes throughout. Elevation of an arm: 0 hanging, pi / 2 level. Wrenches are those of the
 * device on the person; they sum to its weight and to no moment. Source: Latella et al. 2021. */
#ifndef ULNA_ARM_SUPPORT_H
#define ULNA_ARM_SUPPORT_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A device. Zero bytes mean the defaults named here. The angles of a curve increase from 0 to pi
 * at most; the force across the arm is positive upward, that along it to the elbow. Between the
 * entries the force is a straight line, from the first one to nothing at 0; above the last it is
 * held.
 * @since 0.1 */
typedef struct ulna_arm_support {
  int64_t struct_size;    /* sizeof(ulna_arm_support) */
  const ulna_view *left;  /* force over elevation, entries x 3: rad, N across and N along the arm */
  const ulna_view *right; /* NULL: as the left one */
  double attachment;      /* share of the upper arm from the shoulder; 0: 0.6895 */
  double mass_kg;         /* its weight acts at the hip; 0: 1.8; negative: none */
  double up[3];           /* direction of the vertical, any length; 0, 0, 0: z */
  int32_t along_arm;      /* 1: the force along the arm acts as well; 0: it does not */
  int32_t reserved;       /* zero */
} ulna_arm_support;

/** Wrenches at every pose. poses: n x 15, m: left shoulder, right shoulder, left elbow, right
 * elbow, hip. out, row by row, 22 a pose: force on the left and the right arm (N), the points where
 * they act (m), force on the hip, moment about the hip point (N m), elevation left and right (rad),
 * and 1 where the elevation is above the curve or the arm stands upright, left and right. A
 * coordinate that is NaN makes what depends on it NaN. Fails with ULNA_ERROR_DATA where an elbow
 * lies in its shoulder, with the row.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_arm_support_wrenches(const ulna_arm_support *support,
                                               const ulna_view *poses, double *out,
                                               int64_t capacity, int64_t *out_count);

/** Elevation of arms by geometry, rad. direction: n x 3, shoulder to elbow, any length; up: n x 3
 * or 1 x 3, any length.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_arm_elevation(const ulna_view *direction, const ulna_view *up,
                                        double *out, int64_t capacity, int64_t *out_count);

/** The same rotations in the sequence ZXY: angles n x 3, u of R = Rx Ry Rz, to u' of R = Rz Rx Ry,
 * row by row (equations 13 to 16). At the singularity u'_y and u'_z are NaN. The elevation of the
 * arm is pi / 2 + u'_x on the left, pi / 2 - u'_x on the right.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_shoulder_zxy(const ulna_view *angles, double *out, int64_t capacity,
                                       int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
