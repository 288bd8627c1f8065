// Absolute stability of a two-port network between two terminations: Llewellyn's criterion ((4.1)
// of Dyck 2013) and its form for a termination that is not passive, or more than passive ((4.2)).
//
// Port 2 ends in z_t with Re z_t >= -a (a > 0: shortage, a < 0: excess of passivity), the other
// port in any passive impedance. With r = Re z(jw) and k = z12 z21, the impedance seen at port 1,
// z11 - k / (z22 + z_t), has a real part of at least r11 - (Re k + |k|) / (2 (r22 - a)): 1 / zeta
// fills a disc where Re zeta >= r22 - a. It is passive for every such z_t exactly when
//   1. no entry has a pole in the open right half-plane;
//   2. poles on the axis, at 0 and at infinity are simple, with residues k11, k22 >= 0 and k12 k21
//      real, 0 <= k12 k21 <= k11 k22;
//   3. r11 >= 0, r22 >= a, 2 r11 (r22 - a) - Re k - |k| >= 0 at every frequency.
// Theorems 4.1 and 4.2 as printed ask 1 and 2 of z11 and z22 only and leave k12 k21 out: z = [1/s +
// 1, 2/s; 2/s, 1/s + 1] passes, but between an open and a short circuit it has a pole at +1. The
// upper bound b of (4.2) does not enter, because the disc touches it from inside.
#pragma once

#include <optional>
#include <string>

#include "passivity/level_set.hpp"
#include "passivity/model.hpp"
#include "signal/system.hpp"

namespace ulna {

struct TwoPortOptions {
  double shortage = 0.0;     // a, of the termination; in the unit of z
  int port = 2;              // that it ends: 1 or 2
  std::optional<Band> band;  // rad/s; nothing: all frequencies
  double tolerance = 1e-9;   // relative, within which the answer is undecided
};

struct TwoPortStability {
  Answer answer = Answer::kUndecided;  // kPassive: absolutely stable
  Extremum margin;     // smallest 2 r11 (r22 - a) - Re k - |k|, in the square of the unit of z
  Extremum shortage;   // largest a that keeps stability, and the frequency that limits it
  Extremum opposite;   // the same for a termination of the other port, this one passive
  Extremum own_real;   // smallest r of the port that the termination ends
  Extremum far_real;   // of the other port
  std::string reason;  // one sentence
};

// z: 2 x 2, impedances or any other immittance parameters (then the termination is of that kind).
TwoPortStability two_port_stability(const System& z, const TwoPortOptions& options = {});

// Columns: the margin and the tolerable shortage at every omega (rad/s, not negative).
Matrix two_port_curves(const System& z, const Vector& omega, const TwoPortOptions& options = {});

}  // namespace ulna
