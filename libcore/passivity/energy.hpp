// Passivity from the data: energy that flowed into the arm, and the excess or shortage of passivity
// that it shows. Dyck 2013, (3.1) and (4.3); the shortage is the smallest such lambda, see the
// errata.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"

namespace ulna {

struct EnergySeries {
  Vector time_s;
  Vector energy_j;     // E(t) = -integral of F_h . x' dt: absorbed by the arm, trapezoidal
  Vector dissipation;  // D(t) = integral of x' . x' dt
  Vector stored_j;     // V(t) held by spring and mass, above its least; empty: unknown
};

// force: by the human on the robot; velocity of the hand; rows x n, one trial at rate_hz. Every row
// is integrated; the series keeps every stride-th and the last.
EnergySeries absorbed_energy(MatrixRef force, MatrixRef velocity, double rate_hz, Index stride = 1);

// Largest delta with E(t) >= beta + delta D(t) wherever D(t) is at least min_share of its final
// value: positive an excess (EOP), negative a shortage (SOP). beta <= 0 is minus the energy stored
// at the start. NaN when nothing moved.
struct EnergyIndex {
  double delta = 0.0;   // N s/m or N m s/rad
  double time_s = 0.0;  // where the bound is met
};
EnergyIndex energy_index(const EnergySeries& series, double beta_j, double min_share);

// Largest delta that holds in every one of several trials.
EnergyIndex energy_index(const std::vector<EnergySeries>& trials, const std::vector<double>& beta_j,
                         double min_share);

// The same index of `count` sets of trials, each made of blocks of its own trial drawn with
// replacement. A block keeps its increments of D and of what was absorbed and not stored, E - V:
// the stored part comes and goes and would pile up in blocks out of order, so it is added where it
// stands. beta is minus the stored energy at the start. Blocks last block_s, or a fifth of a trial
// where that is shorter. Empty when nothing moved.
std::vector<double> energy_index_bootstrap(const std::vector<EnergySeries>& trials,
                                           double min_share, double block_s, Index count,
                                           std::uint64_t seed, Token* token = nullptr);

}  // namespace ulna
