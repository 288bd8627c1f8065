// Errors of a straight line through a torque that count all it leaves: noise, and the curves of the
// muscles, the softness of an interface, whatever a line is not. K and D are then those of a
// population of such movements, not of this one.
#pragma once

#include "base/token.hpp"
#include "base/types.hpp"
#include "impedance/viscoelastic.hpp"
#include "record/record.hpp"

namespace ulna {

// An entry a parameter.
struct MisfitErrors {
  Vector error;
  Vector half_low, half_high;  // of an interval, below and above the estimate
};

// x: regressors, a column each, full rank; inverse: of x' x. By options.errors: Newey-West or a
// bootstrap over blocks. Throws Error (kData) for a bootstrap over fewer than 5 blocks.
MisfitErrors misfit_errors(const Record& record, const Matrix& x, const Vector& torque,
                           const Matrix& inverse, const ViscoelasticOptions& options, Token* token);

}  // namespace ulna
