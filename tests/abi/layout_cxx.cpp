// The tables of the layout as a C++ compiler sees them.
#define ulna_layout_actual ulna_layout_actual_cxx
#define ulna_layout_expected ulna_layout_expected_cxx
#define ulna_layout_rows ulna_layout_rows_cxx
#define ulna_constants_actual ulna_constants_actual_cxx
#define ulna_constants_expected ulna_constants_expected_cxx
#define ulna_constant_rows ulna_constant_rows_cxx
#include "ulna_layout.c"
