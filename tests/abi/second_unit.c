/* One of two units that include every header: nothing in them may be defined twice. */
#include <ulna/ulna.h>

int ulna_second_unit(void);
int ulna_second_unit(void) { return ULNA_INTERFACE; }
