/* What round_trip.c does for its C++ test. */
#ifndef ULNA_TESTS_ROUND_TRIP_H
#define ULNA_TESTS_ROUND_TRIP_H

#include <ulna/impedance.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Number of checks that failed; each is told on the standard error. */
int ulna_round_trip(void);

/* Identifies one and the same simulated record. */
ulna_status ulna_identify_with(const ulna_impedance_options* options);

#ifdef __cplusplus
}
#endif

#endif
