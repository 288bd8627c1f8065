// Where the joints of a passive mobilisation should be: from the start to the end along one shape,
// theta(t) = start + (end - start) s(t), at one speed or at several one after the other.
#pragma once

#include <vector>

#include "base/types.hpp"

namespace ulna::sim {

enum class MotionShape {
  // s = 1 / (1.1 (1 + e^(5 - 2 t))), t = 6 s over the duration: the published one. Starts with a
  // step of 0.6 % of the way and ends at 90.8 % of it; one speed, no way back.
  kLogistic,
  kMinimumJerk,  // s = 10 x^3 - 15 x^4 + 6 x^5: (4.29) of Ghannadi 2017, with its erratum
  kRamp,         // constant speed
  kSinusoid,     // s = (1 - cos(pi x)) / 2; a way there and back is one period
};

struct ReferenceMotion {
  MotionShape shape = MotionShape::kLogistic;
  double duration_s = 6.0;             // of one way, at speed 1
  std::vector<double> speeds = {1.0};  // each a way there, and back unless there is only one
  int repeats = 1;                     // of each speed, there and back
  double rest_s = 0.0;                 // at both ends of every way

  // Throws Error (kArgument) with the option that cannot be.
  void check() const;

  bool returns() const { return speeds.size() > 1 || repeats > 1; }
  double length_s() const;

  struct Point {
    double share = 0.0;  // s
    double rate = 0.0;   // ds/dt, 1/s
  };
  Point at(double time_s) const;
};

}  // namespace ulna::sim
