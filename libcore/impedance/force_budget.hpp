// What constant errors of a computed force do to M, B and K. The fit is linear in the force, so an
// error of the force that is a known signal times a constant moves the parameters by the fit of
// that signal times the constant; nothing of it averages out however long the recording.
#pragma once

#include <string>
#include <vector>

#include "ident/force_errors.hpp"
#include "impedance/estimate.hpp"

namespace ulna {

struct ForceBudget {
  // natural parameters x names: change of M, B, K row by row and x0 per unit of each error.
  Matrix sensitivity;
  Matrix systematic;  // covariance of the natural parameters from the constants
  Matrix total;       // with the statistical covariance of the fit
};

// errors: of the force channels in estimate.record, row for row. Filter, split, instruments and
// structure are those of the estimate; where a positive semidefinite constraint is active the
// propagation is that of the fit without it. Throws Error (kArgument) when rows or axes differ.
ForceBudget force_budget(const ImpedanceEstimate& estimate, const ForceErrors& errors,
                         Token* token = nullptr);

}  // namespace ulna
