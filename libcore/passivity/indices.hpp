// Passivity indices and positive realness of linear systems, over every frequency.
//
// With u the input and y the output of a square system H, and u'y the power supplied:
// - input index nu, the largest with u'y >= nu u'u: the least eigenvalue of the Hermitian part of H
//   over all w;
// - output index rho, the largest with u'y >= rho y'y: the same of the inverse of H;
// - relative index R, the largest gain of (I - H) (I + H)^-1: at most 1 exactly for passive ones.
//
// Over all frequencies they are statements about stable energy storage: a pole of H (nu), a zero of
// H (rho) or of I + H (R) in the open right half-plane, or a pole on the axis that is not simple
// with a positive semidefinite Hermitian residue, makes them minus infinity (R: infinity). Simple
// ones are lossless and are taken out exactly. Over a band they speak of the response only.
#pragma once

#include <optional>
#include <string>

#include "passivity/level_set.hpp"
#include "passivity/model.hpp"
#include "signal/system.hpp"

namespace ulna {

struct IndexOptions {
  std::optional<Band> band;  // rad/s; nothing: all frequencies, 0 and infinity among them
  // Empty, or p numbers: the port is moved along this line only. Input and relative index and the
  // verdict are then those of d'Hd, the output index that of d'H^-1 d, with d of unit length.
  Vector direction;
  // The verdict is undecided where the Hermitian part is within this share of the response of zero
  // (a zero that structure puts at 0 or infinity apart); poles with |Re p| below this share of |p|
  // count as on the axis.
  double tolerance = 1e-9;
};

struct PassivityIndices {
  Extremum input;   // frequency where it is reached, rad/s; may be infinite
  Extremum output;  // NaN when H is singular at every frequency
  Extremum relative;
  Answer answer = Answer::kUndecided;  // positive real, or in the band
  std::string reason;                  // one sentence: why
  std::string notes;                   // one sentence a line: what else to know
};

// Definition 3.2 of Dyck 2013 with its lemmas, the residues at 0 and infinity stated apart (see
// Anderson and Vongpanitlerd 1973, "Network analysis and synthesis", theorem 2.7.2). Throws Error
// (kArgument) for a system that is not square and options out of range.
PassivityIndices passivity_indices(const System& system, const IndexOptions& options = {});

// Columns: eig_min of the Hermitian part of H, of H^-1, and the gain of the scattering, at every
// omega (rad/s, not negative). NaN where there is none.
Matrix index_curves(const System& system, const Vector& omega, const IndexOptions& options = {});

}  // namespace ulna
