// Steps in random directions at random times, each through an underdamped filter, held, then taken
// back gently. Dyck 2013, 3.4.1 and 4.1: 8 directions, two each, held 1.5 to 2 s, 2 to 7 s apart.
#pragma once

#include <cstdint>

#include "base/token.hpp"
#include "signal/excitation.hpp"

namespace ulna {

struct StepsSpec {
  Drive drive = Drive::kPosition;
  double size = 0.005;  // of each step, along its direction: m, rad, N or N m
  Index axes = 2;
  Index directions = 8;  // evenly about the circle; for one axis 2: forth and back
  Matrix vectors;        // directions x axes, of length 1: instead; empty: as above
  Index repeats = 2;     // of each direction
  SecondOrder filter;
  double rate_hz = 1000.0;
  double hold_low_s = 1.5;
  double hold_high_s = 2.0;
  double wait_low_s = 2.0;  // from the end of a hold (or the start) to the next onset
  double wait_high_s = 7.0;
  double return_s = 1.0;  // how long the way back takes; it lies within the wait
  double rest_s = 1.0;    // after the last way back
  std::uint64_t seed = 0;
};

// Segments are the holds. Every direction comes once in each `repeat`, in random order, so that the
// first half of the steps holds as many directions as the other. Onsets and holds are whole
// samples.
Excitation steps(const StepsSpec& spec, Token* token = nullptr);

}  // namespace ulna
