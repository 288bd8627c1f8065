/* Every function of the interface, callable without its signature: see make_calls.py. */
#ifndef ULNA_TESTS_CALLS_H
#define ULNA_TESTS_CALLS_H

#include <stddef.h>
#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ulna_bad_arguments {
  int32_t number;   /* every integer; at most 64, the size of the buffers that are given */
  double real;      /* every double */
  const char* text; /* every text; at least 64 bytes can be read */
  ulna_view view;
  int64_t struct_size; /* of every struct that has one; -1: its real size */
} ulna_bad_arguments;

typedef struct ulna_call_row {
  const char* name;
  int returns_status;
  ulna_status (*with_nulls)(void);
  ulna_status (*with_bad)(const ulna_bad_arguments* bad, int* out_same);
} ulna_call_row;

extern const ulna_call_row ulna_calls[];
extern const int ulna_call_rows;

/* Fills structs with zeros but their first eight bytes, where struct_size is. */
void ulna_fill(void* objects, size_t size, size_t count, const ulna_bad_arguments* bad);

#ifdef __cplusplus
}
#endif

#endif
