/* Status, errors, array views, tokens and versions: what every other header of ulna uses.
 *
 * Units are SI and radians throughout; scalars carry their unit in the name (_s, _hz, _rad).
 * The @thread tag says who may call: "any" thread at any time; "shared h" several threads at once
 * on the same handle h; "exclusive h" one thread at a time on h. */
#ifndef ULNA_BASE_H
#define ULNA_BASE_H

#include <stdint.h>

#if defined(_WIN32)
#define ULNA_API __declspec(dllimport)
#else
#define ULNA_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** Result of a call: 0, or a negative value named by what the caller should do.
 * A failing call changes nothing it was given.
 * @since 0.1 */
typedef int32_t ulna_status;

/** The call did what it says. @since 0.1 */
#define ULNA_OK (0)
/** The call is wrong: change the argument that the error record names. @since 0.1 */
#define ULNA_ERROR_ARGUMENT (-1)
/** The numbers cannot be used: clean or change the data. @since 0.1 */
#define ULNA_ERROR_DATA (-2)
/** The file cannot be opened, read or written. @since 0.1 */
#define ULNA_ERROR_FILE (-3)
/** The file does not hold what its kind promises. @since 0.1 */
#define ULNA_ERROR_FORMAT (-4)
/** The data are sound but do not determine what was asked for. @since 0.1 */
#define ULNA_ERROR_ANALYSIS (-5)
/** The buffer is too small: ask for the count first. @since 0.1 */
#define ULNA_ERROR_BUFFER (-6)
/** Another thread cancelled the call through its token. @since 0.1 */
#define ULNA_ERROR_CANCELLED (-7)
/** Not enough memory. @since 0.1 */
#define ULNA_ERROR_MEMORY (-8)
/** This build cannot do it. @since 0.1 */
#define ULNA_ERROR_UNSUPPORTED (-9)
/** A defect of the library: please report it with the message. @since 0.1 */
#define ULNA_ERROR_INTERNAL (-10)

/** Number of the binary interface; a library with another number must not be used.
 * @since 0.1 */
#define ULNA_INTERFACE (0)

/** The reason of the last failing call on this thread.
 * @since 0.1 */
typedef struct ulna_error {
  int64_t struct_size; /* set by the caller to sizeof(ulna_error) */
  ulna_status status;  /* ULNA_OK when no call has failed on this thread */
  int32_t reserved;    /* zero */
  char argument[64];   /* name of the offending argument or option, or empty */
  char detail[192];    /* where in the data: "row 17", "channel F_x", or empty */
  char message[768];   /* one sentence for a person */
} ulna_error;

/** A borrowed two-dimensional array of doubles, read only; strides count elements, so rows of NumPy
 * and columns of MATLAB pass without a copy. A vector has cols 1.
 * @since 0.1 */
typedef struct ulna_view {
  const double *data; /* first element; may be NULL only when rows or cols is 0 */
  int64_t rows;       /* samples */
  int64_t cols;       /* channels */
  int64_t row_stride; /* elements from one row to the next */
  int64_t col_stride; /* elements from one column to the next */
} ulna_view;

/** Progress and cancellation of a long call. A call reads it, another thread writes it.
 * @since 0.1 */
typedef struct ulna_token ulna_token;

/** Copies out the reason of the last failing call on this thread.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_error_last(ulna_error *out_error);

/** Name of a status, as "ULNA_ERROR_DATA"; NULL for a value that is none. Static text.
 * @thread any
 * @since 0.1 */
ULNA_API const char *ulna_status_name(ulna_status status);

/** ULNA_INTERFACE of the library that is loaded, to compare with the header's.
 * @thread any
 * @since 0.1 */
ULNA_API int32_t ulna_interface_number(void);

/** Release as "0.1.0". Static text.
 * @thread any
 * @since 0.1 */
ULNA_API const char *ulna_release(void);

/** Compiler and build kind, for error reports. Static text.
 * @thread any
 * @since 0.1 */
ULNA_API const char *ulna_build(void);

/** Makes a token; free it after the calls that use it have returned.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_token_new(ulna_token **out_token);

/** Frees a token; NULL is allowed.
 * @thread exclusive token
 * @since 0.1 */
ULNA_API void ulna_token_free(ulna_token *token);

/** Asks the calls that hold this token to stop; they return ULNA_ERROR_CANCELLED within 50 ms.
 * @thread shared token
 * @realtime
 * @since 0.1 */
ULNA_API ulna_status ulna_token_cancel(ulna_token *token);

/** Share of the work that is done, 0 to 1.
 * @thread shared token
 * @realtime
 * @since 0.1 */
ULNA_API ulna_status ulna_token_progress(const ulna_token *token, double *out_fraction);

#ifdef __cplusplus
}
#endif

#endif
