/* Filters, spectra and clocks of sampled signals.
 *
 * Signals are views of rows (time, uniform at rate_hz) by columns (channels). Every function
 * refuses a NaN or infinite sample with ULNA_ERROR_DATA and "row R, channel C" (from 0) as the
 * detail. A filter `sos` is a view of n x 6 second-order sections b0 b1 b2 a0 a1 a2 with a0 = 1. */
#ifndef ULNA_SIGNAL_H
#define ULNA_SIGNAL_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Ends are extended until the slowest transient of the filter has decayed. @since 0.1 */
#define ULNA_PAD_POLE_RADIUS (0)
/** Ends are extended as scipy.signal.sosfiltfilt does by default, which is shorter than the
 * transient. @since 0.1 */
#define ULNA_PAD_SCIPY (1)

/** Zero-phase filtering.
 * @since 0.1 */
typedef struct ulna_zero_phase_options {
  int64_t struct_size; /* sizeof(ulna_zero_phase_options) */
  int32_t pad;         /* ULNA_PAD_...; 0: from the pole radius */
  int32_t reserved;    /* zero */
  double epsilon;      /* share of the transient left after the pad, 0 to 1; 0: 1e-3 */
} ulna_zero_phase_options;

/** Welch's method: Hann window, 50 % overlap, mean of each segment removed.
 * @since 0.1 */
typedef struct ulna_spectrum_options {
  int64_t struct_size; /* sizeof(ulna_spectrum_options) */
  int64_t segment; /* samples in a segment, at least 4; 0: 1024, or all rows when there are fewer */
  const int64_t *ranges; /* 2 range_count numbers: begin and end (one past the last row) of each
                            range; NULL: all rows */
  int64_t range_count;   /* ranges that no segment reaches across */
  double confidence;     /* of the region about a frequency response, 0 to 1; 0: 0.95 */
} ulna_spectrum_options;

/** How much averaging stands behind a spectrum.
 * @since 0.1 */
typedef struct ulna_spectrum_info {
  int64_t struct_size;       /* set by the caller to sizeof(ulna_spectrum_info) */
  int64_t bins;              /* frequencies, segment / 2 + 1 */
  int64_t averages;          /* segments averaged */
  double effective_averages; /* independent segments that they are worth */
} ulna_spectrum_info;

/** What the time stamps of a log show. Rows count from 0, -1 means none.
 * @since 0.1 */
typedef struct ulna_clock {
  int64_t struct_size;     /* set by the caller to sizeof(ulna_clock) */
  double median_step_s;    /* median of the steps */
  double jitter_rms;       /* rms of step / median - 1 over the steps that are no gaps */
  double jitter_max;       /* largest |step / median - 1| of those */
  int64_t worst_row;       /* row at the end of that step */
  int64_t gap_count;       /* steps above 1.5 medians */
  int64_t first_gap_row;   /* row before the first gap */
  int64_t largest_gap_row; /* row before the largest gap */
  double largest_gap_s;    /* its length, 0 when there is none */
} ulna_clock;

/** Resampling. Zero bytes mean defaults.
 * @since 0.1 */
typedef struct ulna_resample_options {
  int64_t struct_size;  /* sizeof(ulna_resample_options) */
  double max_gap_steps; /* longest step allowed, in median steps; 0: 2.5, which bridges one lost
                           sample */
  double
      tolerance; /* residual at the stamps, as a share of the signal, that ends the fit; 0: 1e-7 */
  int64_t max_iterations; /* of the fit; 0: 300 */
} ulna_resample_options;

/** Weights of the Savitzky-Golay window for each derivative at its centre: column d, in 1/s^d,
 * gives value[i] = sum over k of w[k] y[i + k - (window - 1) / 2]. out: window x (max_derivative +
 * 1), by columns. window: odd, at most 100001; order: 0 to 30, below window; max_derivative: 0
 * to 6.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_savgol_kernels(int32_t window, int32_t order, int32_t max_derivative,
                                         double rate_hz, double *out, int64_t capacity,
                                         int64_t *out_count);

/** Frequency at which the smoothing gain first falls to 1/sqrt(2), as a fraction of the Nyquist
 * frequency; 1 when it never does. Exact, where (3.6) of Dyck 2013 approximates.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_savgol_cutoff(int32_t window, int32_t order, double *out_fraction);

/** Smoothed values and derivatives 0 to max_derivative of every column of y, in unit / s^d. The
 * (window - 1) / 2 rows at either end come from the polynomial of the first or last window, as
 * scipy.signal.savgol_filter with mode="interp". out: rows x (max_derivative + 1) x columns, rows
 * running fastest.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_savgol_apply(const ulna_view *y, int32_t window, int32_t order,
                                       int32_t max_derivative, double rate_hz, double *out,
                                       int64_t capacity, int64_t *out_count);

/** Butterworth low pass of order 1 to 20 by the bilinear transform with prewarping, 0 < cutoff_hz <
 * rate_hz / 2. out: sections x 6, by rows, in the order and with the gain of
 * scipy.signal.butter(output="sos").
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_butterworth_design(int32_t order, double cutoff_hz, double rate_hz,
                                             double *out, int64_t capacity, int64_t *out_count);

/** Frequency, Hz, at which a Butterworth low pass applied forward and backward is at -3 dB: two
 * passes square the gain, so it lies below cutoff_hz (0.9156 of it at order 5 and a low cut-off).
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_butterworth_two_pass_cutoff(int32_t order, double cutoff_hz,
                                                      double rate_hz, double *out_hz);

/** Cut-off, Hz, to design for so that the filter applied forward and backward is at -3 dB at
 * wanted_hz.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_butterworth_corrected_cutoff(int32_t order, double wanted_hz,
                                                       double rate_hz, double *out_hz);

/** Samples until the slowest transient of a filter has fallen to epsilon: ceil(ln epsilon / ln r),
 * r the largest magnitude of a pole. So many rows at either end of a filtered signal are uncertain.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sos_settle(const ulna_view *sos, double epsilon, int64_t *out_samples);

/** Samples by which ulna_sos_filter extends either end of a signal of so many rows: what the
 * options ask for, at most rows - 1. A negative rows asks for the unlimited number. options may be
 * NULL.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sos_pad(const ulna_view *sos, const ulna_zero_phase_options *options,
                                  int64_t rows, int64_t *out_samples);

/** Filters every column of y forward and backward, with odd extension and steady-state start.
 * out: the shape of y, by columns; it may be the memory of y. options may be NULL.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sos_filter(const ulna_view *y, const ulna_view *sos,
                                     const ulna_zero_phase_options *options, double *out,
                                     int64_t capacity, int64_t *out_count);

/** Magnitude response of the Savitzky-Golay kernels for value, first and second derivative, times
 * the forward and backward gain of sos (NULL: the kernels alone), at freq_hz from 0 to rate_hz / 2
 * (Fig. 3.5 of Dyck 2013). relative: 1 gives it relative to the ideal operators 1, omega, omega^2;
 * 0 the gain in 1, 1/s, 1/s^2. out: frequencies x 3, by columns.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_smoother_response(int32_t window, int32_t order, const ulna_view *sos,
                                            double rate_hz, const ulna_view *freq_hz,
                                            int32_t relative, double *out, int64_t capacity,
                                            int64_t *out_count);

/** Averages that a spectrum of so many rows has. options may be NULL.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_spectrum_plan(int64_t rows, const ulna_spectrum_options *options,
                                        ulna_spectrum_info *out_info);

/** Cross-spectral densities, one-sided, as scipy.signal.csd: s_ij = mean of conj(X_i) X_j. options
 * may be NULL. out: frequencies x (1 + 2 n^2) by columns for n channels: the frequency in Hz, then
 * real and imaginary part of s_00, s_01, ..., s_10, ... in unit_i unit_j / Hz.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_spectrum_estimate(const ulna_view *signals, double rate_hz,
                                            const ulna_spectrum_options *options, ulna_token *token,
                                            double *out, int64_t capacity, int64_t *out_count);

/** Multiple coherence of each output on all inputs (Bendat and Piersol 2010, section 9.2): the
 * share of its power that a linear system explains. options may be NULL. out: frequencies x (1 + 2
 * outputs) by columns: the frequency in Hz, the coherence of each output, then the same less the
 * bias of q inputs and n averages, 1 - (1 - c) n / (n - q), not below 0. NaN where the inputs are
 * dependent or have no power; ULNA_ERROR_ANALYSIS when that is everywhere so or the averages are
 * too few.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_coherence_estimate(const ulna_view *inputs, const ulna_view *outputs,
                                             double rate_hz, const ulna_spectrum_options *options,
                                             ulna_token *token, double *out, int64_t capacity,
                                             int64_t *out_count);

/** Frequency response H1 of each output to each input, with the radius of the circle about it that
 * holds the truth with the options' confidence. Same refusals as ulna_coherence_estimate. options
 * may be NULL. out: frequencies x (1 + 3 outputs inputs) by columns: the frequency in Hz, then real
 * part, imaginary part and radius for output 0 and each input, for output 1 and each input, and so
 * on.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_response_estimate(const ulna_view *inputs, const ulna_view *outputs,
                                            double rate_hz, const ulna_spectrum_options *options,
                                            ulna_token *token, double *out, int64_t capacity,
                                            int64_t *out_count);

/** Looks at time stamps, s, increasing, at least 2: their jitter and gaps. A stamp that is not
 * finite or not after the one before is ULNA_ERROR_DATA with "row R" as the detail.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_clock_check(const ulna_view *times_s, ulna_clock *out_clock);

/** Row before each gap (step above 1.5 medians) of time stamps.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_clock_gaps(const ulna_view *times_s, int64_t *out, int64_t capacity,
                                     int64_t *out_count);

/** The signals behind time stamps that jitter, at t0_s + k / rate_hz, k = 0 ... n - 1, all within
 * the log. The log is taken as band-limited to 0.7 of its own Nyquist frequency and fitted by least
 * squares in windowed-sinc functions; jitter up to 30 % rms of the step is undone. A lower rate
 * low-passes to 0.7 of the new Nyquist frequency. Some 64 samples at either end are less exact. A
 * gap is ULNA_ERROR_DATA with "row R" as the detail. options may be NULL. out: n x columns of y, by
 * columns.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_clock_resample(const ulna_view *times_s, const ulna_view *y, double t0_s,
                                         double rate_hz, int64_t n,
                                         const ulna_resample_options *options, ulna_token *token,
                                         double *out, int64_t capacity, int64_t *out_count);

#ifdef __cplusplus
}
#endif

#endif
