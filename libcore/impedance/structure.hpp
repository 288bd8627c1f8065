// What the fit may assume of M, B and K: a linear map from the free parameters to all of them, so
// that a constraint is part of the fit and not applied afterwards.
#pragma once

#include <vector>

#include "base/types.hpp"
#include "ident/semidefinite.hpp"

namespace ulna {

enum class Model {
  kFree,       // every entry of M, B, K
  kSymmetric,  // M, B, K symmetric
  kPassive,    // symmetric and positive semidefinite
};

struct Structure {
  Model model = Model::kFree;
  bool no_damping = false;     // B = 0: (3.8) and (3.9) of Dyck 2013, the mass-spring rig
  bool diagonal_mass = false;  // M = m I
};

// Regressors of one output in the order of ident/design.hpp, [a v x 1]; theta is (3 n + 1) x n and
// row i of M stands in theta(0..n-1, i).
// Returns T with vec(theta) = T eta; eta holds M, B, K (lower triangles when symmetric), then the
// constants.
Matrix structure_map(const Structure& structure, Index axes);

// Where eta holds M, B and K as lower triangles; only for symmetric structures.
std::vector<Cone> structure_cones(const Structure& structure, Index axes);

}  // namespace ulna
