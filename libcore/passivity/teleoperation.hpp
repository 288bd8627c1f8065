// How much gain a delay allows, and how much more when the arm's excess of passivity is known.
//
// Position-force teleoperation (two channels), velocities v, forces f, delay T each way:
//   master  (m_m s + b_m) v_m = f_h - phi e^{-sT} f_c      f_h: by the arm
//   slave   (m_s s + b_s) v_s = f_c - f_e                  f_e: by the environment on the slave
//   coupler f_c = (k_v + k_p / s) (lambda e^{-sT} v_m - v_s)
// The environment is any passive one, the arm any with Re z >= delta: its excess (or shortage)
// shows as delta added to b_m. By Llewellyn's criterion on the hybrid matrix of this two-port the
// loop is stable for all of them exactly when, with gain g = phi lambda,
//   g sup_w f(w) <= b_m + delta,   psi = 2 w T,  c = k_p / w,
//   2 (b_s + k_v) f = (k_v^2 + c^2)(1 - cos psi) - 2 k_v b_s cos psi + 2 c b_s sin psi
// (h11 = Z_m + g e^{-2sT} q Z_s, h12 h21 = -g e^{-2sT} q^2, h22 = 1/(Z_s + C), q = C/(Z_s + C);
// the masses cancel). The supremum lies in 0 <= psi <= pi: a psi beyond has one in there with the
// same cosine, no smaller sine and a larger c.
//
// Virtual wall: a device of damping b shows f = (K + B s) x with delay T (a sampled one: half a
// period more). With the arm it is stable for every arm of excess delta exactly when
//   b + delta + B cos(wT) - K sin(wT) / w >= 0 at every w,
// so that K <= (b + delta) / T for B = 0 (Colgate and Schenkel 1997 with T as half a period).
#pragma once

#include "base/types.hpp"

namespace ulna {

struct PositionForce {
  double master_damping = 0.0;      // b_m, N s/m
  double slave_damping = 0.0;       // b_s, N s/m
  double coupling_damping = 0.0;    // k_v, N s/m, above 0
  double coupling_stiffness = 0.0;  // k_p, N/m
};

// Largest product of force and position scaling at each delay (s, not negative): infinite where
// nothing limits it, 0 where no gain is allowed. excess: delta, N s/m; negative for a shortage.
Vector allowed_gain(const PositionForce& loop, double excess, const Vector& delay_s);

// Largest stiffness (N/m) of a wall of the given damping at each delay: infinite without delay, 0
// when the wall's damping alone is too much.
Vector allowed_stiffness(double device_damping, double wall_damping, double excess,
                         const Vector& delay_s);

}  // namespace ulna
