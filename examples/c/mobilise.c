/* An exoskeleton moves an arm that cuffs, straps and soft tissue hold, and says how stiff the elbow
 * is, with its uncertainty, beside what the simulated muscles really did:
 *
 *     mobilise [tissue stiffness in N/m]
 *
 * Exit codes: 1 the movement was not carried out, 2 what was given is wrong, 3 the movement does
 * not determine the stiffness, 4 a defect of ulna. Built like assess.c.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <ulna/ulna.h>

#include "explain.h"

enum { kNotCarriedOut = 1, kTextSize = 4096, kInterfaceValues = 22, kMostInterfaces = 2 };

static const double kDegree = 3.14159265358979323846 / 180.0;

static int print_joint(const ulna_viscoelastic *found) {
  char name[kTextSize];
  int64_t size = 0;
  ulna_viscoelastic_joint joint = {0};
  joint.struct_size = sizeof joint;
  if (ulna_viscoelastic_get_joint(found, 0, &joint) != ULNA_OK ||
      ulna_viscoelastic_text(found, 0, name, sizeof name, &size) != ULNA_OK)
    return explain("mobilise");
  name[strcspn(name, "\n")] = '\0';
  printf("joint   %s\n", name);
  printf("K       %.3f N m/rad, %.0f %% %.3f to %.3f, true %.3f\n", joint.k, 100.0 * joint.level,
         joint.k_interval[0], joint.k_interval[1], joint.true_k);
  printf("D       %.3f N m s/rad, %.0f %% %.3f to %.3f, true %.3f\n", joint.d, 100.0 * joint.level,
         joint.d_interval[0], joint.d_interval[1], joint.true_d);
  return kOk;
}

/* Stiffness and damping of the joint that moved. */
static int assess(const ulna_plant *plant, const ulna_mobilisation *mobilisation) {
  ulna_record *record = NULL;
  ulna_viscoelastic *found = NULL;
  int code = kOk;
  if (ulna_mobilisation_record(mobilisation, &record) != ULNA_OK) return explain("mobilise");
  if (ulna_viscoelastic_new(record, plant, NULL, NULL, NULL, &found) == ULNA_OK) {
    code = print_joint(found);
  } else {
    code = explain("mobilise");
  }
  ulna_viscoelastic_free(found);
  ulna_record_free(record);
  return code;
}

/* How the movement ended; only one that was carried out says anything of the arm. */
static int judge(const ulna_plant *plant, const ulna_mobilisation *mobilisation) {
  ulna_mobilisation_result result = {0};
  char reason[kTextSize];
  int64_t size = 0;
  result.struct_size = sizeof result;
  if (ulna_mobilisation_get_result(mobilisation, &result) != ULNA_OK) return explain("mobilise");
  if (result.status != ULNA_MOBILISATION_OK) {
    if (ulna_mobilisation_text(mobilisation, ULNA_MOBILISATION_REASON, reason, sizeof reason,
                               &size) != ULNA_OK)
      return explain("mobilise");
    fprintf(stderr, "mobilise: %s\n", reason);
    return kNotCarriedOut;
  }
  printf("moved   %.2f s, slip at most %.1f degrees\n", result.simulated_s,
         result.largest_slip_rad / kDegree);
  return assess(plant, mobilisation);
}

/* What holds the arm when it has been put in. */
static int print_interfaces(const ulna_plant *plant) {
  static const char *const names[kMostInterfaces] = {"upper", "fore"};
  double values[kMostInterfaces * kInterfaceValues];
  int64_t count = 0;
  int64_t i;
  ulna_run *run = NULL;
  int code = kOk;
  if (ulna_run_new(plant, &run) != ULNA_OK || ulna_run_step(run, 100, NULL) != ULNA_OK ||
      ulna_run_interfaces(run, values, (int64_t)(sizeof values / sizeof *values), &count) !=
          ULNA_OK)
    code = explain("mobilise");
  for (i = 0; code == kOk && i < count / kInterfaceValues; ++i) {
    const double *v = values + i * kInterfaceValues;
    printf("%-7s strap %.0f N, largest pressure %.1f kPa on %.0f cm2\n", names[i], v[21],
           v[19] / 1e3, v[20] * 1e4);
  }
  ulna_run_free(run);
  return code;
}

int main(int count, char **words) {
  ulna_soft_options soft = {0};
  ulna_plant *plant = NULL;
  ulna_mobilisation *mobilisation = NULL;
  int code = kOk;
  soft.struct_size = sizeof soft;
  if (count > 1) {
    char *end = NULL;
    const double stiffness = strtod(words[1], &end);
    if (end == words[1] || *end != '\0' || !(stiffness > 0.0) || !isfinite(stiffness)) {
      fprintf(stderr, "mobilise: the stiffness of the tissue must be a positive number in N/m\n");
      return kBadInput;
    }
    soft.stiffness_n_m[0] = soft.stiffness_n_m[1] = stiffness;
  }
  if (ulna_plant_new_soft(NULL, &soft, &plant) != ULNA_OK) return explain("mobilise");
  code = print_interfaces(plant);
  if (code == kOk) {
    code = ulna_mobilisation_new(plant, NULL, NULL, NULL, &mobilisation) == ULNA_OK
               ? judge(plant, mobilisation)
               : explain("mobilise");
  }
  ulna_mobilisation_free(mobilisation);
  ulna_plant_free(plant);
  return code;
}
