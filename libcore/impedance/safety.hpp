// Do arm and robot stay within limits under a design? Peaks of the linear loop from rest, with a
// multiple of what the tremor adds, and the largest scale that the limits allow.
#pragma once

#include <string>

#include "impedance/arm_loop.hpp"

namespace ulna {

struct Limits {
  double force = 0.0;         // between hand and robot, N or N m; 0: none
  double displacement = 0.0;  // from where the hand rests, m or rad; 0: none
  double velocity = 0.0;      // m/s or rad/s; 0: none
  bool per_axis = false;      // each axis by itself, as for joints; else the length of the vector
};

struct SafetyOptions {
  Limits limits;
  Tremor tremor;
  double sigmas = 3.0;  // of the tremor, added to every peak
};

enum class Quantity { kForce, kDisplacement, kVelocity };

// One quantity over the whole design; axis entries and, last, the length of the vector.
struct PeakOf {
  Vector value;   // n + 1: largest magnitude, sigmas of tremor included
  Vector time_s;  // n + 1: when
  Vector tremor;  // n + 1: sigmas times the standard deviation that the tremor causes
  double limit = 0.0;
  double scale = 0.0;         // largest factor of the design that keeps the limit; infinite without
  double scale_time_s = 0.0;  // where that factor is decided
  Index entry = 0;  // of `value` that decides it: an axis, or n for the length of the vector
  Index axis = 0;   // the axis with the largest share there
  bool within = true;
};

struct Safety {
  PeakOf peaks[3];  // by Quantity
  bool within = true;
  double scale = 0.0;                    // smallest of the three
  Quantity tightest = Quantity::kForce;  // the limit that is met first; kForce without any limit
};

Safety check_safety(const Excitation& excitation, const ArmLoop& loop, const SafetyOptions& options,
                    Token* token = nullptr);

// The verdict in words, with names of the axes and units.
std::string safety_sentence(const Safety& safety, const std::vector<std::string>& axes,
                            bool rotational);

}  // namespace ulna
