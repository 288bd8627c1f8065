/* Frames of an MVNX file (Xsens), the motion of a suit, as its bytes come: numbers by element. The
 * caller reads what stands before <frames> and after </frames>, which is XML of the usual size. */
#ifndef ULNA_MVNX_H
#define ULNA_MVNX_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Frames of one file, read so far.
 * @since 0.1 */
typedef struct ulna_mvnx_frames ulna_mvnx_frames;

/** Frames to be read. name: of the file, for messages; elements: those whose numbers are kept, as
 * "orientation" (none: only poses are read); first_line: of the file, where the bytes begin.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_mvnx_frames_new(const char *name, const char *const *elements,
                                          int64_t element_count, int64_t first_line,
                                          ulna_mvnx_frames **out_frames);

/** Frees frames; NULL is accepted.
 * @thread exclusive frames
 * @since 0.1 */
ULNA_API void ulna_mvnx_frames_free(ulna_mvnx_frames *frames);

/** Takes the next `size` bytes behind the tag <frames>. out_used: how many of them belong to the
 * frames, all of them until </frames> has come (out_done 1). Refuses (ULNA_ERROR_FORMAT) with line
 * or frame what is no XML, no number, or a row of another length.
 * @thread exclusive frames
 * @since 0.1 */
ULNA_API ulna_status ulna_mvnx_frames_push(ulna_mvnx_frames *frames, const char *data, int64_t size,
                                           int64_t *out_used, int32_t *out_done);

/** Frames of motion so far, and the line of the file behind the bytes that were used.
 * @thread shared frames
 * @since 0.1 */
ULNA_API ulna_status ulna_mvnx_frames_size(const ulna_mvnx_frames *frames, int64_t *out_frames,
                                           int64_t *out_line);

/** Number and time stamp (ms, NaN: none) of the frames, frames x 2, row after row.
 * @thread shared frames
 * @since 0.1 */
ULNA_API ulna_status ulna_mvnx_frames_clock(const ulna_mvnx_frames *frames, double *out,
                                            int64_t capacity, int64_t *out_count);

/** Numbers of an element (0 <= element, in the order given), row after row in the units of the
 * file, NaN where a frame lacks it; empty where all do.
 * @thread shared frames
 * @since 0.1 */
ULNA_API ulna_status ulna_mvnx_frames_numbers(const ulna_mvnx_frames *frames, int64_t element,
                                              double *out, int64_t capacity, int64_t *out_count);

/** Kinds of the frames that are no motion, as "tpose", one a line.
 * @thread shared frames
 * @since 0.1 */
ULNA_API ulna_status ulna_mvnx_frames_poses(const ulna_mvnx_frames *frames, char *out_text,
                                            int64_t capacity, int64_t *out_size);

/** Orientations (positions 0) or positions (positions 1) of a pose, as the file has them.
 * @thread shared frames
 * @since 0.1 */
ULNA_API ulna_status ulna_mvnx_frames_pose(const ulna_mvnx_frames *frames, int64_t pose,
                                           int32_t positions, double *out, int64_t capacity,
                                           int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
