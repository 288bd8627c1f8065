// Fitting the parallel cascade: search of delay and dynamics, profile over the delay, covariance.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "impedance/reflex.hpp"
#include "impedance/reflex_cascade.hpp"
#include "impedance/separable.hpp"

namespace ulna {

struct CascadeFit {
  int side = 1;
  BoxSolution solution;
  Vector theta;                 // intrinsic block, then the gain
  Vector theta_without;         // intrinsic block alone
  double penalty = 0.0;         // on the lags of an intrinsic impulse response
  double total = 0.0;           // sum of squares of the torque
  double vaf() const noexcept;  // percent, on the rows of the fit; NaN without torque
};

// Chooses the penalty of an intrinsic impulse response and leaves it in the cascade.
CascadeFit fit_cascade(Cascade& cascade, const ReflexOptions& options, int side, Token* token);

// Cost over the delay, all else refitted.
struct DelayProfile {
  Vector delay, cost;
};

struct CascadeUncertainty {
  ReflexFit fit;
  DelayProfile profile;
};

// Newey-West covariance and 95 % intervals in natural parameters; the delay's from its profile.
CascadeUncertainty uncertainty(const std::vector<CascadeTrial>& trials, const Cascade& cascade,
                               const ReflexOptions& options, const CascadeGrid& grid,
                               const CascadeFit& fitted, double effective_hz, double position_mean,
                               Token* token);

}  // namespace ulna
