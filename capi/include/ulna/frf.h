/* Frequency response functions where Welch's method (ulna_response_estimate) is not the best there
 * is: inside of a control loop, under periodic excitation, and at a finer resolution.
 *
 * A response is that of each output to each input: H = Y / U, in output unit over input unit, with
 * the radius of the circle about it that holds the truth with the options' confidence. Tables are
 * frequencies x columns, by columns: the frequency in Hz, then real part, imaginary part and radius
 * for output 0 and each input, for output 1 and each input, and so on. NaN where a frequency is not
 * excited. Every function refuses a NaN or infinite sample with ULNA_ERROR_DATA. */
#ifndef ULNA_FRF_H
#define ULNA_FRF_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** How a response is estimated. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_frf_options {
  int64_t struct_size;   /* sizeof(ulna_frf_options) */
  const int64_t *ranges; /* 2 range_count: begin and end of each run; NULL: all rows are one */
  int64_t range_count;   /* runs */
  double confidence;     /* of the circle, 0 to 1; 0: 0.95 */
  int64_t segment;       /* closed loop: samples of a segment; 0: 1024, or all rows if fewer */
  int64_t period;        /* periodic: samples of a period */
  int64_t skip;          /* periodic: periods left out at the start of each run; < 0: none; 0: 1 */
  int64_t order;         /* local: of the polynomials, 1 to 6; 0: 2 */
  int64_t half_width;    /* local: bins to either side; 0: 10 degrees of freedom */
  int64_t stride;        /* local: bins from one frequency to the next; 0: half_width */
} ulna_frf_options;

/** Response inside of a loop by the joint input-output method, H = S_ry / S_ru, with Welch's
 * spectra; a reference for each input. Unlike H1 it has no bias from noise that the loop feeds
 * back. The radius is infinite where the effect of the reference on the input cannot be told from
 * chance. options may be NULL.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_frf_closed_loop(const ulna_view *references, const ulna_view *inputs,
                                          const ulna_view *outputs, double rate_hz,
                                          const ulna_frf_options *options, ulna_token *token,
                                          double *out, int64_t capacity, int64_t *out_count);

/** Response to periodic excitation: means over whole periods, noise from what differs between them.
 * Several inputs need as many runs in which they differ. options must give the period.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_frf_periodic(const ulna_view *inputs, const ulna_view *outputs,
                                       double rate_hz, const ulna_frf_options *options,
                                       ulna_token *token, double *out, int64_t capacity,
                                       int64_t *out_count);

/** Response by the local polynomial method (Pintelon and others 2010), for any excitation that is
 * broad. The table has two more blocks of columns, an output each: the coherence with all inputs,
 * and the same less its bias. options may be NULL.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_frf_local(const ulna_view *inputs, const ulna_view *outputs,
                                    double rate_hz, const ulna_frf_options *options,
                                    ulna_token *token, double *out, int64_t capacity,
                                    int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
