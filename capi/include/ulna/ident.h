/* Preparation of a record for identification: smoothing and differentiation of every channel
 * through one linear operator (Savitzky-Golay, then a zero-phase Butterworth low pass), so that a
 * linear relation between the recorded signals stays exactly the same relation. Dyck 2013,
 * section 3.4.
 *
 * Sign: positions in the frame of the log; forces and torques are those of the human on the robot.
 */
#ifndef ULNA_IDENT_H
#define ULNA_IDENT_H

#include <ulna/base.h>
#include <ulna/record.h>
#include <ulna/signal.h>

#ifdef __cplusplus
extern "C" {
#endif

/** How signals are smoothed and differentiated. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_prepare_options {
  int64_t struct_size;   /* sizeof(ulna_prepare_options) */
  const char *position;  /* word: "p" for p_x, p_y; "x," or "x,y": exactly these; NULL: by role */
  const char *force;     /* as position */
  const char *reference; /* as position; NULL: by role, if there are any */
  double lowpass_hz;     /* -3 dB of one pass; 0: to pass motion_band_hz, 5 to 60 Hz; < 0: none */
  double pad_epsilon;    /* share of a transient that may remain at the ends; 0: 1e-3 */
  int32_t window;        /* samples, odd; 0: 101 at 1 kHz and 5 Hz, in proportion otherwise */
  int32_t order;         /* of the polynomial, at least 2; 0: 6 */
  int32_t lowpass_order; /* of one pass; 0: 5 */
  int32_t corrected;     /* 1: lowpass_hz is -3 dB after both passes */
  int32_t plain_savgol;  /* 1: derivative kernels as published, not matched to the value kernel */
  int32_t pad;           /* ULNA_PAD_... */
  int32_t threads;       /* 0: one per processor */
  int32_t reserved;      /* zero */
} ulna_prepare_options;

/** What the preparation did.
 * @since 0.1 */
typedef struct ulna_prepare_report {
  int64_t struct_size;        /* set by the caller to sizeof(ulna_prepare_report) */
  double rate_hz;             /* sample rate */
  double lowpass_hz;          /* -3 dB of one pass; 0: no low pass */
  double effective_cutoff_hz; /* -3 dB of the whole smoother */
  double motion_band_hz;  /* 95 % of the power of velocity lies below: of the reference's, if any */
  int64_t dropped_rows;   /* at either end of a trial: no full window */
  int64_t pad_rows;       /* extension at either end */
  int64_t transient_rows; /* at either end: the extension shows in the filtered signals */
  int32_t window;         /* samples */
  int32_t order;          /* of the polynomial */
  int32_t lowpass_order;  /* 0: no low pass */
  int32_t lowpass_chosen; /* 1: from the motion, not by the caller */
  int32_t short_trials;   /* 1: a trial is shorter than the extension asked for */
  int32_t reserved;       /* zero */
  double
      velocity_consistency; /* integrated acceleration against velocity, relative rms; Fig. 3.6 */
  double position_consistency; /* integrated twice against position, over 10 s; NaN: too short */
} ulna_prepare_report;

/** Prepares a record: the result holds, for every position and reference channel c, the channels c,
 * c_rate and c_acceleration, and every force channel, smoothed; all else is left out. Rows without
 * a full window are dropped at both ends of every trial. Fails (ULNA_ERROR_DATA) with the channel
 * and row for NaN, constant or all-zero channels, gaps and jitter of the clock, and too few
 * samples.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_prepare(const ulna_record *record, const ulna_prepare_options *options,
                                  ulna_token *token, ulna_record **out_record,
                                  ulna_prepare_report *out_report);

#ifdef __cplusplus
}
#endif

#endif
