/* What the examples share: the reason of the last failing call, and the exit code that belongs to
 * it: 2 what was given is wrong, 3 it does not determine the result, 4 a defect of ulna. */
#ifndef ULNA_EXAMPLES_EXPLAIN_H
#define ULNA_EXAMPLES_EXPLAIN_H

#include <stdio.h>
#include <ulna/ulna.h>

enum { kOk = 0, kBadInput = 2, kFailedAnalysis = 3, kInternal = 4 };

/* One sentence to the terminal. */
static int explain(const char *program) {
  ulna_error error = {0};
  error.struct_size = sizeof error;
  if (ulna_error_last(&error) != ULNA_OK) return kInternal;
  fprintf(stderr, "%s: %s\n", program, error.message);
  switch (error.status) {
    case ULNA_ERROR_ARGUMENT:
    case ULNA_ERROR_DATA:
    case ULNA_ERROR_FILE:
    case ULNA_ERROR_FORMAT:
    case ULNA_ERROR_UNSUPPORTED:
      return kBadInput;
    case ULNA_ERROR_ANALYSIS:
    case ULNA_ERROR_MEMORY:
      return kFailedAnalysis;
    default:
      return kInternal;
  }
}

#endif
