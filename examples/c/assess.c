/* Reads a recording and prints the impedance of the arm, with its uncertainty, and whether it is
 * passive:
 *
 *     assess [recording.csv]
 *
 * Without an argument it reads examples/data/relaxed-arm.csv. Exit codes: 2 the file is wrong, 3
 * the recording does not determine the impedance, 4 a defect of ulna.
 *
 * To build it elsewhere, with an installed ulna:
 *
 *     find_package(ulna REQUIRED)               # CMake
 *     add_executable(assess assess.c)
 *     target_link_libraries(assess PRIVATE ulna::ulna)
 *
 *     cc -std=c99 assess.c -o assess -lulna     # or by hand, add -I and -L of an unusual prefix
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <ulna/ulna.h>

#include "explain.h"

/* Numbers of the reported fit; the caller frees them. NULL when they cannot be had. */
static double *values_of(const ulna_impedance *impedance, int32_t quantity) {
  int64_t count = 0;
  double *values = NULL;
  if (ulna_impedance_get_values(impedance, ULNA_FIT_REPORTED, quantity, NULL, 0, &count) != ULNA_OK)
    return NULL;
  values = malloc((size_t)(count > 0 ? count : 1) * sizeof *values);
  if (values == NULL) return NULL;
  if (ulna_impedance_get_values(impedance, ULNA_FIT_REPORTED, quantity, values, count, &count) !=
      ULNA_OK) {
    free(values);
    return NULL;
  }
  return values;
}

/* rows x cols values with the standard errors that stand from `first` on in the covariance. */
static int print_values(const ulna_impedance *impedance, const char *name, int32_t quantity,
                        int rows, int cols, int first, int natural) {
  double *values = values_of(impedance, quantity);
  double *covariance = values_of(impedance, ULNA_IMPEDANCE_COVARIANCE);
  int i = 0;
  const int good = values != NULL && covariance != NULL;
  for (i = 0; good && i < rows * cols; ++i) {
    const int k = first + i;
    const double error = sqrt(covariance[k * natural + k]);
    if (i % cols == 0) printf("%-10s", i == 0 ? name : "");
    printf("  %12.5g +- %-10.3g%s", values[i], error, i % cols == cols - 1 ? "\n" : "");
  }
  free(values);
  free(covariance);
  return good;
}

static int print_vaf(const ulna_impedance *impedance, int axes) {
  double *vaf = values_of(impedance, ULNA_IMPEDANCE_VAF);
  int i = 0;
  if (vaf == NULL) return 0;
  printf("%-10s", "VAF %");
  for (i = 0; i < axes; ++i) printf("  %12.4g%s", vaf[i], i == axes - 1 ? "\n" : "");
  free(vaf);
  return 1;
}

static int print_outcome(const ulna_impedance *impedance) {
  static const struct {
    uint32_t bit;
    const char *word;
  } kWords[] = {{ULNA_OUTCOME_CLOSED_LOOP_BIASED, "closed-loop biased"},
                {ULNA_OUTCOME_POOR_FIT, "poor fit"},
                {ULNA_OUTCOME_ILL_CONDITIONED, "ill-conditioned"},
                {ULNA_OUTCOME_FORCE_LAG, "force lag"},
                {ULNA_OUTCOME_NOT_CONVERGED, "not converged"},
                {ULNA_OUTCOME_NOT_FINITE, "no equilibrium"},
                {ULNA_OUTCOME_UNCHECKED, "unchecked"}};
  ulna_fit_info fit = {0};
  size_t i = 0;
  fit.struct_size = sizeof fit;
  if (ulna_impedance_get_fit(impedance, ULNA_FIT_REPORTED, &fit) != ULNA_OK) return 0;
  printf("%-10s  %s\n", "estimator",
         fit.estimator == ULNA_ESTIMATOR_INSTRUMENTAL ? "instrumental variables" : "least squares");
  printf("%-10s", "outcome");
  if (fit.outcome == 0) printf("  good");
  for (i = 0; i < sizeof kWords / sizeof kWords[0]; ++i) {
    if ((fit.outcome & kWords[i].bit) != 0) printf("  %s", kWords[i].word);
  }
  printf("\n");
  return 1;
}

static int print_warnings(const ulna_impedance *impedance) {
  int64_t size = 0;
  char *text = NULL;
  if (ulna_impedance_get_text(impedance, ULNA_TEXT_WARNINGS, NULL, 0, &size) != ULNA_OK) return 0;
  text = malloc((size_t)size);
  if (text == NULL) return 0;
  if (ulna_impedance_get_text(impedance, ULNA_TEXT_WARNINGS, text, size, &size) != ULNA_OK) {
    free(text);
    return 0;
  }
  if (text[0] != '\0') printf("warnings\n%s\n", text);
  free(text);
  return 1;
}

/* An ellipse needs a plane: of M, B and K at a hand that moves along two axes. */
static int print_ellipses(const ulna_impedance *impedance) {
  static const char *const kNames[] = {"ellipse M", "ellipse B", "ellipse K"};
  const double degrees = 57.29577951308232;
  int32_t quantity = ULNA_IMPEDANCE_M;
  for (; quantity <= ULNA_IMPEDANCE_K; ++quantity) {
    ulna_ellipse e = {0};
    e.struct_size = sizeof e;
    if (ulna_impedance_get_ellipse(impedance, ULNA_FIT_REPORTED, quantity, 0.95, &e) != ULNA_OK)
      return 0;
    printf("%-10s  area %.5g, shape %.3g, ", kNames[quantity], e.area, e.shape);
    if (e.angle_defined) {
      printf("angle %.1f deg (95 %% %.1f to %.1f)\n", degrees * e.angle_rad,
             degrees * e.angle_interval_rad[0], degrees * e.angle_interval_rad[1]);
    } else {
      printf("angle undefined\n");
    }
  }
  return 1;
}

static int print_passivity(const ulna_impedance *impedance) {
  static const char *const kWords[] = {"passive", "not passive", "undecided"};
  ulna_passivity *passivity = NULL;
  ulna_passivity_info info = {0};
  char reason[1024] = "";
  int64_t size = 0;
  int good = 0;
  info.struct_size = sizeof info;
  if (ulna_passivity_assess(impedance, NULL, NULL, &passivity) != ULNA_OK) return 0;
  good = ulna_passivity_get_info(passivity, &info) == ULNA_OK &&
         ulna_passivity_get_text(passivity, ULNA_PASSIVITY_TEXT_REASON, reason, sizeof reason,
                                 &size) == ULNA_OK;
  ulna_passivity_free(passivity);
  if (!good) return 0;
  printf("%-10s  %s, probability %.3g, excess %.4g (95 %% %.4g to %.4g)\n", "passivity",
         kWords[info.verdict], info.probability, info.excess, info.excess_interval[0],
         info.excess_interval[1]);
  printf("%-10s  %s\n", "", reason);
  return 1;
}

static int print_estimate(const ulna_impedance *impedance) {
  ulna_impedance_info info = {0};
  int n = 0;
  int natural = 0;
  info.struct_size = sizeof info;
  if (ulna_impedance_get_info(impedance, &info) != ULNA_OK) return 0;
  n = info.axes;
  natural = 3 * n * n + n;
  return print_values(impedance, info.rotational ? "M kg m^2" : "M kg", ULNA_IMPEDANCE_M, n, n, 0,
                      natural) &&
         print_values(impedance, info.rotational ? "B Nms/rad" : "B N s/m", ULNA_IMPEDANCE_B, n, n,
                      n * n, natural) &&
         print_values(impedance, info.rotational ? "K Nm/rad" : "K N/m", ULNA_IMPEDANCE_K, n, n,
                      2 * n * n, natural) &&
         print_values(impedance, info.rotational ? "x0 rad" : "x0 m", ULNA_IMPEDANCE_X0, 1, n,
                      3 * n * n, natural) &&
         print_vaf(impedance, n) && print_outcome(impedance) && print_warnings(impedance) &&
         (n != 2 || print_ellipses(impedance)) && print_passivity(impedance);
}

int main(int argc, char **argv) {
  const char *path = argc > 1 ? argv[1] : "examples/data/relaxed-arm.csv";
  ulna_record *record = NULL;
  ulna_impedance *impedance = NULL;
  int code = kOk;
  if (argc > 2) {
    fprintf(stderr, "usage: assess [recording.csv]\n");
    return kBadInput;
  }
  if (ulna_interface_number() != ULNA_INTERFACE) {
    fprintf(stderr, "assess: the library has another interface than the header\n");
    return kInternal;
  }
  if (ulna_record_read_csv(path, NULL, NULL, &record) != ULNA_OK) return explain("assess");
  if (ulna_impedance_identify(record, NULL, NULL, &impedance) != ULNA_OK ||
      !print_estimate(impedance)) {
    code = explain("assess");
  }
  ulna_impedance_free(impedance);
  ulna_record_free(record);
  return code;
}
