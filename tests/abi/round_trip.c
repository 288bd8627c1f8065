/* From arrays to a verdict as a program in C99 does it: only the headers, no C++.
 * round_trip_test.cpp runs it; every check that fails is counted and told. */
#include "round_trip.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <ulna/ulna.h>

enum { kRows = 8000, kColumns = 6 };
static const double kRate = 200.0;
static const double kM[4] = {1.4, -0.9, -0.9, 1.9};
static const double kB[4] = {5.75, -3.0, -1.0, 10.6};
static const double kK[4] = {42.0, -30.0, -26.0, 125.0};
static const double kX0[2] = {0.01, 0.5};

static int failures = 0;
#define CHECK(condition)                                              \
  do {                                                                \
    if (!(condition)) {                                               \
      ++failures;                                                     \
      fprintf(stderr, "round_trip.c:%d: %s\n", __LINE__, #condition); \
    }                                                                 \
  } while (0)

/* x, y, F_x, F_y, x_ref, y_ref, row by row: ten lines an axis up to 3 Hz. */
static void fill_table(double* table) {
  int i, a, line;
  for (i = 0; i < kRows; ++i) {
    const double t = i / kRate;
    double* row = table + (size_t)i * kColumns;
    double s[3][2] = {{0}}, reference[2] = {0};
    for (a = 0; a < 2; ++a) {
      for (line = 0; line < 10; ++line) {
        const double w = 6.283185307179586 * 0.3 * (line + 0.25 + 0.5 * a);
        const double angle = w * t + 1.7 * line * line + a;
        s[0][a] += 0.004 * cos(angle);
        s[1][a] -= 0.004 * w * sin(angle);
        s[2][a] -= 0.004 * w * w * cos(angle);
        reference[a] += 0.005 * cos(angle + 0.1 * w);
      }
    }
    for (a = 0; a < 2; ++a) {
      double force = 0.0;
      int j;
      for (j = 0; j < 2; ++j) {
        force -= kM[2 * a + j] * s[2][j] + kB[2 * a + j] * s[1][j] +
                 kK[2 * a + j] * (s[0][j] + 0.5 * j - kX0[j]);
      }
      row[a] = s[0][a] + 0.5 * a;
      row[2 + a] = force;
      row[4 + a] = reference[a] + 0.5 * a;
    }
  }
}

static ulna_record* make_record(void) {
  static const char* const kNames[kColumns] = {"x", "y", "F_x", "F_y", "x_ref", "y_ref"};
  static const int32_t kRoles[kColumns] = {ULNA_ROLE_POSITION,  ULNA_ROLE_POSITION,
                                           ULNA_ROLE_FORCE,     ULNA_ROLE_FORCE,
                                           ULNA_ROLE_REFERENCE, ULNA_ROLE_REFERENCE};
  double* table = malloc(sizeof(double) * kRows * kColumns);
  ulna_channel channels[kColumns];
  ulna_view view;
  ulna_record_parts parts;
  ulna_record* record = NULL;
  int c;
  if (table == NULL) return NULL;
  fill_table(table);
  memset(channels, 0, sizeof channels);
  for (c = 0; c < kColumns; ++c) {
    channels[c].struct_size = sizeof channels[c];
    strcpy(channels[c].name, kNames[c]);
    strcpy(channels[c].unit, kRoles[c] == ULNA_ROLE_FORCE ? "N" : "m");
    channels[c].role = kRoles[c];
    channels[c].axis = c % 2;
    channels[c].sign = 1;
  }
  view.data = table;
  view.rows = kRows;
  view.cols = kColumns;
  view.row_stride = kColumns; /* rows of C pass without a copy */
  view.col_stride = 1;
  memset(&parts, 0, sizeof parts);
  parts.struct_size = sizeof parts;
  parts.values = &view;
  parts.rate_hz = kRate;
  parts.channels = channels;
  parts.channel_count = kColumns;
  CHECK(ulna_record_new(&parts, &record) == ULNA_OK);
  free(table); /* the record has its own copy */
  return record;
}

/* Count, exact fill, and a buffer that is one too small and stays as it was. */
static void check_values(const ulna_impedance* h, int32_t quantity, int64_t expected,
                         const double* truth) {
  double* out;
  int64_t count = -1, i;
  int32_t fit;
  ulna_error error;
  for (fit = ULNA_FIT_REPORTED; fit <= ULNA_FIT_ALTERNATIVE; ++fit) {
    CHECK(ulna_impedance_get_values(h, fit, quantity, NULL, 0, &count) == ULNA_OK);
    CHECK(expected < 0 || count == expected);
    out = malloc(sizeof(double) * (size_t)(count + 1));
    if (out == NULL) return;
    for (i = 0; i <= count; ++i) out[i] = -7.0;
    if (count > 0) {
      int64_t untouched = -3;
      CHECK(ulna_impedance_get_values(h, fit, quantity, out, count - 1, &untouched) ==
            ULNA_ERROR_BUFFER);
      CHECK(untouched == -3);
      for (i = 0; i <= count; ++i) CHECK(out[i] == -7.0);
      memset(&error, 0, sizeof error);
      error.struct_size = sizeof error;
      CHECK(ulna_error_last(&error) == ULNA_OK);
      CHECK(error.status == ULNA_ERROR_BUFFER);
      CHECK(strcmp(error.argument, "capacity") == 0);
      CHECK(strstr(error.message, "needed") != NULL);
    }
    CHECK(ulna_impedance_get_values(h, fit, quantity, out, count + 1, &count) == ULNA_OK);
    CHECK(out[count] == -7.0); /* no more than the count is written */
    for (i = 0; truth != NULL && i < count; ++i) CHECK(fabs(out[i] - truth[i]) < 1e-6 * 125.0);
    free(out);
  }
}

static void check_texts(const ulna_impedance* h) {
  char text[64];
  int64_t size = 0;
  CHECK(ulna_impedance_get_text(h, ULNA_TEXT_AXES, NULL, 0, &size) == ULNA_OK);
  CHECK(size == 4);
  memset(text, '#', sizeof text);
  CHECK(ulna_impedance_get_text(h, ULNA_TEXT_AXES, text, 3, &size) == ULNA_ERROR_BUFFER);
  CHECK(text[0] == '#' && size == 4);
  CHECK(ulna_impedance_get_text(h, ULNA_TEXT_AXES, text, 4, &size) == ULNA_OK);
  CHECK(strcmp(text, "x\ny") == 0);
  CHECK(text[4] == '#');
  CHECK(ulna_impedance_get_text(h, 99, text, 64, &size) == ULNA_ERROR_ARGUMENT);
}

static void check_signals(const ulna_impedance* h, int64_t rows) {
  static const int32_t kWidth[] = {1, 2, 2, 2, 2, 2, 1};
  int64_t count = 0, i;
  int32_t signal;
  double* measured = malloc(sizeof(double) * (size_t)rows * 2);
  double* predicted = malloc(sizeof(double) * (size_t)rows * 2);
  for (signal = ULNA_SIGNAL_TIME; signal <= ULNA_SIGNAL_USE; ++signal) {
    CHECK(ulna_impedance_get_signals(h, 0, 0, signal, NULL, 0, &count) == ULNA_OK);
    CHECK(count == rows * kWidth[signal]);
  }
  if (measured != NULL && predicted != NULL) {
    CHECK(ulna_impedance_get_signals(h, 0, 0, ULNA_SIGNAL_FORCE, measured, 2 * rows, &count) ==
          ULNA_OK);
    CHECK(ulna_impedance_get_signals(h, 0, 0, ULNA_SIGNAL_FORCE_PREDICTED, predicted, 2 * rows,
                                     &count) == ULNA_OK);
    for (i = 0; i < count; ++i) CHECK(fabs(measured[i] - predicted[i]) < 1e-5);
  }
  CHECK(ulna_impedance_get_signals(h, 0, 1, 0, NULL, 0, &count) == ULNA_ERROR_ARGUMENT);
  CHECK(ulna_impedance_get_signals(h, 0, -1, 0, NULL, 0, &count) == ULNA_ERROR_ARGUMENT);
  free(measured);
  free(predicted);
}

static void check_passivity(const ulna_impedance* h, int64_t rows) {
  ulna_passivity* p = NULL;
  ulna_passivity_info info;
  ulna_passivity_margins margins;
  char text[2048];
  int64_t size = 0, count = 0, other = 0;
  double* time = NULL;
  CHECK(ulna_passivity_assess(h, NULL, NULL, &p) == ULNA_OK);
  if (p == NULL) return;
  memset(&info, 0, sizeof info);
  info.struct_size = sizeof info;
  CHECK(ulna_passivity_get_info(p, &info) == ULNA_OK);
  CHECK(info.verdict == ULNA_VERDICT_PASSIVE);
  CHECK(info.approach == ULNA_APPROACH_MODEL);
  CHECK(info.probability > 0.95 && info.probability <= 1.0);
  CHECK(info.trials == 1);
  /* lambda_min of sym B = (5.75 + 10.6) / 2 - sqrt(((10.6 - 5.75) / 2)^2 + 2^2) */
  CHECK(fabs(info.excess - (8.175 - sqrt(2.425 * 2.425 + 4.0))) < 1e-5);
  memset(&margins, 0, sizeof margins);
  margins.struct_size = sizeof margins;
  CHECK(ulna_passivity_get_margins(p, &margins) == ULNA_OK);
  CHECK(margins.b_min == info.excess);
  CHECK(ulna_passivity_get_text(p, ULNA_PASSIVITY_TEXT_REASON, text, sizeof text, &size) ==
        ULNA_OK);
  CHECK(size > 10 && (int64_t)strlen(text) + 1 == size);
  CHECK(ulna_passivity_get_series(p, 0, ULNA_ENERGY_TIME, NULL, 0, &count) == ULNA_OK);
  CHECK(count > 100 && count <= rows); /* kept at the rate that shows it */
  time = malloc(sizeof(double) * (size_t)count);
  if (time != NULL) {
    CHECK(ulna_passivity_get_series(p, 0, ULNA_ENERGY_TIME, time, count, &count) == ULNA_OK);
    CHECK(time[0] == 0.0);
    CHECK(fabs(time[count - 1] - (double)(rows - 1) / kRate) < 1e-9);
    free(time);
  }
  CHECK(ulna_passivity_get_series(p, 0, ULNA_ENERGY_ABSORBED, NULL, 0, &other) == ULNA_OK);
  CHECK(other == count);
  CHECK(ulna_passivity_get_series(p, 0, ULNA_ENERGY_MOTION, NULL, 0, &other) == ULNA_OK);
  CHECK(other == count);
  CHECK(ulna_passivity_get_series(p, 1, ULNA_ENERGY_TIME, NULL, 0, &other) == ULNA_ERROR_ARGUMENT);
  CHECK(ulna_passivity_get_series(p, 0, 3, NULL, 0, &other) == ULNA_ERROR_ARGUMENT);
  ulna_passivity_free(p);
}

static void check_ellipse(const ulna_impedance* h) {
  ulna_ellipse e, of;
  ulna_view view = {kK, 2, 2, 2, 1};
  memset(&e, 0, sizeof e);
  memset(&of, 0, sizeof of);
  e.struct_size = of.struct_size = sizeof e;
  CHECK(ulna_impedance_get_ellipse(h, 0, ULNA_IMPEDANCE_K, 0.95, &e) == ULNA_OK);
  CHECK(ulna_ellipse_of(&view, &of) == ULNA_OK);
  CHECK(fabs(e.major - of.major) < 1e-4 && fabs(e.angle_rad - of.angle_rad) < 1e-6);
  CHECK(of.antisymmetric == -2.0);
  CHECK(e.major_interval[0] <= e.major && e.major <= e.major_interval[1]);
  CHECK(ulna_impedance_get_ellipse(h, 0, ULNA_IMPEDANCE_X0, 0.95, &e) == ULNA_ERROR_ARGUMENT);
  CHECK(ulna_impedance_get_ellipse(h, 0, ULNA_IMPEDANCE_K, 1.0, &e) == ULNA_ERROR_ARGUMENT);
}

/* A failing call leaves the place of its result as it was, and says why. */
static void check_refusals(const ulna_record* record) {
  char mark = 0;
  ulna_impedance* const untouched = (ulna_impedance*)(void*)&mark;
  ulna_impedance* out = untouched;
  ulna_impedance_options options;
  ulna_prepare_options prepare;
  ulna_token* token = NULL;
  ulna_error error;
  memset(&error, 0, sizeof error);
  error.struct_size = sizeof error;

  memset(&options, 0, sizeof options);
  options.struct_size = sizeof options;
  options.model = 17;
  CHECK(ulna_impedance_identify(record, &options, NULL, &out) == ULNA_ERROR_ARGUMENT);
  CHECK(out == untouched);
  CHECK(ulna_error_last(&error) == ULNA_OK && strcmp(error.argument, "model") == 0);

  memset(&prepare, 0, sizeof prepare);
  prepare.struct_size = sizeof prepare;
  prepare.position = "elbow";
  options.model = 0;
  options.prepare = &prepare;
  CHECK(ulna_impedance_identify(record, &options, NULL, &out) < 0);
  CHECK(out == untouched);
  CHECK(ulna_error_last(&error) == ULNA_OK && strstr(error.message, "F_x") != NULL);

  options.prepare = NULL;
  options.condition_limit = 1.5; /* nothing is that well determined */
  CHECK(ulna_impedance_identify(record, &options, NULL, &out) == ULNA_ERROR_ANALYSIS);
  CHECK(out == untouched);
  CHECK(ulna_error_last(&error) == ULNA_OK && strncmp(error.detail, "condition ", 10) == 0);

  options.condition_limit = 0.0;
  CHECK(ulna_token_new(&token) == ULNA_OK);
  CHECK(ulna_token_cancel(token) == ULNA_OK);
  CHECK(ulna_impedance_identify(record, &options, token, &out) == ULNA_ERROR_CANCELLED);
  CHECK(out == untouched);
  ulna_token_free(token);
}

int ulna_round_trip(void) {
  ulna_record* record = make_record();
  ulna_impedance* h = NULL;
  ulna_impedance_info info;
  ulna_fit_info fit;
  ulna_prepare_report report;
  int64_t rows = 0;
  if (record == NULL) return failures + 1;
  check_refusals(record);
  CHECK(ulna_impedance_identify(record, NULL, NULL, &h) == ULNA_OK);
  ulna_record_free(record); /* an estimate keeps what it needs */
  if (h == NULL) return failures + 1;

  memset(&info, 0, sizeof info);
  memset(&fit, 0, sizeof fit);
  memset(&report, 0, sizeof report);
  info.struct_size = sizeof info;
  fit.struct_size = sizeof fit;
  report.struct_size = sizeof report;
  CHECK(ulna_impedance_get_info(h, &info) == ULNA_OK);
  CHECK(info.axes == 2 && info.rotational == 0 && info.fits == 2 && info.trials == 1);
  CHECK(ulna_impedance_get_fit(h, ULNA_FIT_REPORTED, &fit) == ULNA_OK);
  CHECK(fit.estimator == ULNA_ESTIMATOR_INSTRUMENTAL && fit.outcome == 0);
  CHECK(ulna_impedance_get_fit(h, 2, &fit) == ULNA_ERROR_ARGUMENT);
  CHECK(ulna_impedance_get_preparation(h, &report) == ULNA_OK);
  CHECK(report.rate_hz == kRate && report.dropped_rows == (report.window - 1) / 2);
  rows = kRows - 2 * report.dropped_rows;
  CHECK(info.train_rows + info.held_out_rows == rows);

  check_values(h, ULNA_IMPEDANCE_M, 4, kM);
  check_values(h, ULNA_IMPEDANCE_B, 4, kB);
  check_values(h, ULNA_IMPEDANCE_K, 4, kK);
  check_values(h, ULNA_IMPEDANCE_X0, 2, kX0);
  check_values(h, ULNA_IMPEDANCE_COVARIANCE, 14 * 14, NULL);
  check_values(h, ULNA_IMPEDANCE_DRAWS, 4000 * 14, NULL);
  check_values(h, ULNA_IMPEDANCE_VAF, 2, NULL);
  check_values(h, ULNA_IMPEDANCE_VAF_INTERVAL, 4, NULL);
  check_values(h, ULNA_IMPEDANCE_MOTION_TOTAL, 2, NULL);
  check_values(h, ULNA_IMPEDANCE_TRIALS, 0, NULL); /* one trial */
  check_values(h, ULNA_IMPEDANCE_TRIAL_MEAN, 0, NULL);
  check_texts(h);
  check_signals(h, rows);
  check_ellipse(h);
  check_passivity(h, rows);
  ulna_impedance_free(h);
  return failures;
}

ulna_status ulna_identify_with(const ulna_impedance_options* options) {
  static ulna_record* record = NULL; /* the same for every option; freed by the process */
  ulna_impedance* h = NULL;
  ulna_status status;
  if (record == NULL) record = make_record();
  status = ulna_impedance_identify(record, options, NULL, &h);
  if ((h != NULL) != (status == ULNA_OK)) ++failures;
  ulna_impedance_free(h);
  return status;
}
