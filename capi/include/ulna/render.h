/* Pictures and films of a scene, drawn without a window.
 *
 * They need OpenGL, which is looked for when the first picture is asked for: EGL, else OSMesa.
 * Everything else of the library works without it. Pixels are three bytes each, red, green, blue,
 * row by row from the top. Lengths m, angles rad; world: x forward, y left, z up. Muscles are blue
 * at no activation and red at full. */
#ifndef ULNA_RENDER_H
#define ULNA_RENDER_H

#include <ulna/base.h>
#include <ulna/exo.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Draws runs of one plant; keeps its plant alive. Used by one thread at a time.
 * @since 0.1 */
typedef struct ulna_renderer ulna_renderer;

/** A film that is being written.
 * @since 0.1 */
typedef struct ulna_video ulna_video;

/** EGL, else OSMesa. @since 0.1 */
#define ULNA_BACKEND_ANY (0)
/** EGL only. @since 0.1 */
#define ULNA_BACKEND_EGL (1)
/** OSMesa only, which draws by software. @since 0.1 */
#define ULNA_BACKEND_OSMESA (2)

/** A sphere at the first point. @since 0.1 */
#define ULNA_SHAPE_SPHERE (0)
/** A rod with round ends from the first point to the second. @since 0.1 */
#define ULNA_SHAPE_CAPSULE (1)
/** A rod with flat ends. @since 0.1 */
#define ULNA_SHAPE_CYLINDER (2)
/** An arrow from the first point to the second. @since 0.1 */
#define ULNA_SHAPE_ARROW (3)

/** How pictures are drawn. Zero bytes are the defaults named here.
 * @since 0.1 */
typedef struct ulna_render_options {
  int64_t struct_size;        /* sizeof(ulna_render_options) */
  int32_t width;              /* pixels; 0: 1280 */
  int32_t height;             /* pixels; 0: 960 */
  int32_t samples;            /* along each side of a pixel, 1 to 4; 0: 2 */
  int32_t backend;            /* ULNA_BACKEND_... */
  int32_t no_grid;            /* 1: no lines on the floor */
  int32_t no_person;          /* 1: no figure whose arm it is */
  int32_t no_skin;            /* 1: no translucent cover of the arm */
  int32_t no_interfaces;      /* 1: no tissue, straps and forces of soft interfaces */
  int32_t whole_range;        /* 1: the default camera leaves room for the elbow's whole range */
  int32_t reserved;           /* zero */
  const char *camera;         /* device, side, front, back, top or of the scene; NULL: oblique */
  const ulna_view *direction; /* azimuth, elevation of the view; NULL: the camera's */
  const ulna_view *look_at;   /* x, y, z of a point; NULL: the middle of what is seen */
  double distance_m;          /* from that point; 0: so that everything is seen */
  double force_scale_m_n;     /* length of arrows for forces; 0: 0.0015; < 0: none */
} ulna_render_options;

/** Whether pictures can be drawn here, and in words by what or what is missing.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_render_available(int32_t backend, int32_t *out_available, char *out_text,
                                           int64_t capacity, int64_t *out_size);

/** A renderer for runs of a plant. Fails with ULNA_ERROR_UNSUPPORTED without OpenGL, and says which
 * Debian packages have it.
 * @thread shared plant
 * @since 0.1 */
ULNA_API ulna_status ulna_renderer_new(const ulna_plant *plant, const ulna_render_options *options,
                                       ulna_renderer **out_renderer);

/** Frees a renderer; NULL is allowed.
 * @thread exclusive renderer
 * @since 0.1 */
ULNA_API void ulna_renderer_free(ulna_renderer *renderer);

/** Width and height of its pictures, pixels.
 * @thread shared renderer
 * @since 0.1 */
ULNA_API ulna_status ulna_renderer_size(const ulna_renderer *renderer, int32_t *out_width,
                                        int32_t *out_height);

/** What it draws with, as "EGL, llvmpipe (LLVM 15.0.6, 256 bits)".
 * @thread shared renderer
 * @since 0.1 */
ULNA_API ulna_status ulna_renderer_text(const ulna_renderer *renderer, char *out_text,
                                        int64_t capacity, int64_t *out_size);

/** Draws a run as ulna_run_forward or ulna_run_step left it. shapes (NULL: none): rows of kind
 * (ULNA_SHAPE_...), two points x y z (m), radius (m), red, green, blue, opacity (0 to 1), in the
 * world. forces (NULL: what the run's soft interfaces do): a row for each soft interface, force of
 * cuff and of strap on the limb in the cuff's frame, 6 numbers, N. The default camera's place
 * follows from the first picture and stays. out_rgb: height x width x 3 bytes.
 * @thread exclusive renderer
 * @since 0.1 */
ULNA_API ulna_status ulna_renderer_draw(ulna_renderer *renderer, const ulna_run *run,
                                        const ulna_view *shapes, const ulna_view *forces,
                                        char *out_rgb, int64_t capacity, int64_t *out_size);

/** Distance of what the last picture shows along the direction of view, m, height x width; infinite
 * for floor and background.
 * @thread shared renderer
 * @since 0.1 */
ULNA_API ulna_status ulna_renderer_depth(const ulna_renderer *renderer, double *out,
                                         int64_t capacity, int64_t *out_count);

/** Writes a picture of width x height pixels as PNG; the path ends with .png.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_image_write_png(const char *path, const char *rgb, int32_t width,
                                          int32_t height);

/** Begins a film (MP4, H.264) of pictures of one size; width and height must be even, the path ends
 * with .mp4.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_video_new(const char *path, int32_t width, int32_t height, double rate_hz,
                                    ulna_video **out_video);

/** Adds a picture of the film's size.
 * @thread exclusive video
 * @since 0.1 */
ULNA_API ulna_status ulna_video_add(ulna_video *video, const char *rgb, int32_t width,
                                    int32_t height);

/** Ends the film, without which a file cannot be shown; again does nothing.
 * @thread exclusive video
 * @since 0.1 */
ULNA_API ulna_status ulna_video_close(ulna_video *video);

/** Frees a film and ends it where ulna_video_close has not; NULL is allowed.
 * @thread exclusive video
 * @since 0.1 */
ULNA_API void ulna_video_free(ulna_video *video);

#ifdef __cplusplus
}
#endif

#endif
