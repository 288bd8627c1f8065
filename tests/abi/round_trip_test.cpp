// A record becomes an impedance and a verdict through the C interface, in C99 (round_trip.c).
#include "round_trip.h"

#include <gtest/gtest.h>

TEST(RoundTrip, FromArraysToAVerdictInC99) { EXPECT_EQ(ulna_round_trip(), 0); }
