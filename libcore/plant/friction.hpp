// Friction that is continuous in the speed: a breakaway peak that falls to the sliding level, and a
// viscous part. Ghannadi 2017, (3.25) with the errata:
//   f = mu_d tanh(4 r) + (mu_s - mu_d) r / (r^2 / 4 + 3 / 4)^2 + mu_v omega,   r = omega / omega_t.
#pragma once

#include <cmath>
#include <string>

#include "base/error.hpp"

namespace ulna {

struct Friction {
  double sliding = 0.0;    // mu_d, N m or N: level at high speed
  double breakaway = 0.0;  // mu_s, N m or N: reached at r = 1, at least the sliding level
  double viscous = 0.0;    // mu_v, N m s/rad or N s/m
  double threshold = 0.0;  // omega_t, rad/s or m/s: positive where sliding or breakaway is not 0
};

// Opposes a positive speed when positive.
inline double friction_force(const Friction& f, double speed) {
  const double viscous = f.viscous * speed;
  if (f.sliding == 0.0 && f.breakaway == 0.0) return viscous;
  const double r = speed / f.threshold;
  const double fall = 0.25 * r * r + 0.75;
  return f.sliding * std::tanh(4.0 * r) + (f.breakaway - f.sliding) * r / (fall * fall) + viscous;
}

// Its slope at zero speed, the largest there is: what an integration step has to follow.
inline double friction_slope(const Friction& f) {
  if (f.sliding == 0.0 && f.breakaway == 0.0) return f.viscous;
  return (4.0 * f.sliding + (16.0 / 9.0) * (f.breakaway - f.sliding)) / f.threshold + f.viscous;
}

// Throws Error (kArgument) unless the parts are finite and not negative, breakaway is at least
// sliding, and the threshold is positive where it is needed. joint: for the message, from 1; 0:
// none.
inline void check_friction(const Friction& f, const char* argument, int joint) {
  const std::string where = joint == 0 ? "" : "joint " + std::to_string(joint);
  const std::string whose = joint == 0 ? "the friction" : "the friction of " + where;
  const auto refuse = [&](bool wrong, const std::string& what) {
    if (wrong) throw Error(Fault::kArgument, argument, whose + what, where);
  };
  refuse(!(std::isfinite(f.sliding) && std::isfinite(f.breakaway) && std::isfinite(f.viscous) &&
           std::isfinite(f.threshold)),
         " holds a number that is not finite");
  refuse(f.sliding < 0.0 || f.viscous < 0.0, " is negative: give 0 or more");
  refuse(f.breakaway < f.sliding, " breaks away below its sliding level: give at least that level");
  refuse(f.breakaway > 0.0 && !(f.threshold > 0.0),
         " needs a threshold speed above 0 for its dry part");
}

}  // namespace ulna
