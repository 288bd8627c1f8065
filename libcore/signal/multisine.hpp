// Sums of sinusoids on a grid of whole periods: all power at known frequencies, none of it leaking
// between them over a whole period. Dyck 2013, 3.4.1: ten sinusoids an axis, 0 to 3 Hz, 50 s.
#pragma once

#include <cstdint>

#include "base/token.hpp"
#include "signal/excitation.hpp"

namespace ulna {

enum class Phases {
  kOptimised,  // low crest factor: low_crest_phases
  kRandom,     // uniform
  kSchroeder,
};

struct MultisineSpec {
  Drive drive = Drive::kPosition;
  Vector amplitude;  // per axis, SI: the largest magnitude, or with `rms` the rms
  bool rms = false;
  double rate_hz = 1000.0;
  double duration_s = 50.0;  // of the whole design, fades included
  double low_hz = 0.0;
  double high_hz = 3.0;
  Index lines = 10;       // per axis
  Matrix lines_hz;        // lines x axes, or x 1 for all axes: exactly these; empty: from the band
  bool shared = false;    // every axis has the same lines; else axes take turns along the band
  double period_s = 0.0;  // lines are multiples of 1 / period_s; 0: the part between the fades
  double slope = 0.0;     // amplitude of a line ~ freq^slope: 0 flat in position, -1 in velocity
  double fade_s = 0.0;    // at either end: rises smoothly from and falls to rest
  Phases phases = Phases::kOptimised;
  int starts = 10;  // random starts of the optimisation, beside Schroeder's phases
  std::uint64_t seed = 0;
};

// The segment is the part between the fades. Its first row is where each axis passes 0 most slowly,
// or, with shared lines, where it is least like the axes before: a shift in time, which leaves
// spectrum and crest factor as they are. Throws Error (kArgument) for
// a band that does not hold the lines.
Excitation multisine(const MultisineSpec& spec, Token* token = nullptr);

}  // namespace ulna
