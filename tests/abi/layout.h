/* Tables that capi/tools/apigen.py makes from the headers: `actual` is what the compiler says,
 * `expected` is what the text of the headers says. */
#ifndef ULNA_TESTS_LAYOUT_H
#define ULNA_TESTS_LAYOUT_H

#include <stdint.h>

typedef struct ulna_layout_row {
  const char* type;
  const char* member; /* "" is the struct itself */
  int64_t offset;     /* bytes */
  int64_t size;       /* bytes */
} ulna_layout_row;

typedef struct ulna_constant_row {
  const char* name;
  double value;
} ulna_constant_row;

#endif

/* Once for each set of names: layout_cxx.cpp renames them. */
#ifdef __cplusplus
extern "C" {
#endif
extern const ulna_layout_row ulna_layout_actual[];
extern const ulna_layout_row ulna_layout_expected[];
extern const int ulna_layout_rows;
extern const ulna_constant_row ulna_constants_actual[];
extern const ulna_constant_row ulna_constants_expected[];
extern const int ulna_constant_rows;
#ifdef __cplusplus
}
#endif
