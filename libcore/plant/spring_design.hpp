// Which springs to hang into the frame so that the handle feels a wanted stiffness: continuous
// rates (springs to be wound or combined) or a choice from a drawer of springs.
#pragma once

#include <cstdint>
#include <vector>

#include "base/token.hpp"
#include "plant/spring_array.hpp"

namespace ulna {

// A kind of spring in the drawer.
struct SpringKind {
  double rate = 0.0;  // N/m
  double rest = 0.0;  // relaxed length, m
  int count = 0;      // how many there are; 0: as many as there are places
};

struct SpringDesignOptions {
  Vector2 centre = Vector2::Zero();  // of the frame, m
  double half_x = SpringArray::kHalfX;
  double half_y = SpringArray::kHalfY;
  double radius = 0.025;             // within which every spring stays taut, m
  double reach = 1.0 / 3.0;          // share of the half sides within which the handle may rest
  std::vector<SpringKind> kinds;     // the drawer; empty: continuous rates
  double rest = 0.09;                // of every spring, for continuous rates, m
  double max_rate = 0.0;             // N/m, for continuous rates; 0: no limit
  Vector2 offset = Vector2::Zero();  // of the equilibrium from the centre, continuous rates, m
  std::uint64_t seed = 0;            // of the search where the drawer is too large to try all
  int threads = 0;
};

struct SpringDesign {
  std::vector<double> rates;     // of the eight places, N/m; 0: empty
  std::vector<double> rests;     // m
  std::vector<int> kinds;        // index into the drawer, -1: empty or continuous
  SpringEquilibrium achieved;    // of the springs in place (empty places left out)
  double error = 0.0;            // |K - wanted| / |wanted|, Frobenius
  Linearity linearity;           // within options.radius
  double linear_radius = 0.0;    // where the law F = -K d errs by 5 %, m (at most 0.1)
  bool taut = false;             // every spring stays taut within the radius
  bool central = false;          // the handle rests within the reach
  bool exhaustive = false;       // nothing in the drawer does better
  std::int64_t evaluations = 0;  // arrangements tried
};

// wanted: symmetric positive definite, N/m. Throws Error: kArgument for a matrix that is not, kinds
// that are no springs, or a radius that leaves no place taut; kAnalysis when no arrangement holds
// the handle.
//
// Continuous rates: stiffness and force at the wanted equilibrium are linear in the rates, so that
// the nearest stiffness with no force there is a convex problem in at most eight variables between
// bounds; it is solved exactly by trying every set of active bounds. Among equals the smallest sum
// of squares is taken, which spreads the load over all places.
SpringDesign design_springs(const Matrix2& wanted, const SpringDesignOptions& options,
                            Token* token = nullptr);

// Stiffness from its eigenvalues and the angle of the larger one's axis to +x, rad.
Matrix2 stiffness_of_ellipse(double major, double minor, double angle);

}  // namespace ulna
