// Least squares with symmetric matrices among the parameters that must be positive semidefinite.
// The problem is convex; with S = L L' it is smooth and unconstrained, and a factor of full size
// leaves no local minimum that is not global (Burer and Monteiro 2005). NLopt does the descent.
#pragma once

#include <vector>

#include "base/types.hpp"

namespace ulna {

// Parameters eta[first ...] are the lower triangle, column by column, of a symmetric size x size
// matrix.
struct Cone {
  Index first = 0;
  Index size = 0;
};

struct SemidefiniteFit {
  Vector eta;
  bool active = false;  // the free minimum lies outside the cones
  bool converged = true;
};

// Minimises 1/2 eta' h eta - g' eta over eta whose cones are positive semidefinite; h is positive
// definite.
SemidefiniteFit fit_semidefinite(const Matrix& h, const Vector& g, const std::vector<Cone>& cones);

}  // namespace ulna
