// The parallel cascade on a set of rows: everything but delay and dynamics is linear, and projected
// away (variable projection, Golub and Pereyra 1973).
#pragma once

#include <vector>

#include "base/types.hpp"
#include "ident/prepare.hpp"
#include "impedance/causal_element.hpp"
#include "impedance/reflex.hpp"
#include "impedance/reflex_rows.hpp"
#include "impedance/separable.hpp"

namespace ulna {

// How far signals reach around a row, and how many rows carry information of their own.
struct CascadeGrid {
  double rate = 0.0;
  double step = 0.0;
  Index stride = 1;
  Index irf_step = 1;  // prepared rows from one lag of an impulse response to the next
  Index back = 0, ahead = 0;
  Index intrinsic_lags = 0;  // to either side; 0: second order

  double sample_rate() const noexcept { return rate / static_cast<double>(stride); }
};
CascadeGrid make_grid(const PrepareReport& report, const ReflexOptions& options);

// Lags to either side that intrinsic_irf_s reaches over.
Index lags_either_side(const CascadeGrid& grid, const ReflexOptions& options);

// The intrinsic path's linear block: [a v x] or lags of x, then the static powers.
Matrix intrinsic_columns(const std::vector<CascadeTrial>& trials, const CascadeSample& sample,
                         const CascadeGrid& grid);

struct CascadeEvaluation {
  Vector residual;  // less offsets and past
  Vector theta;     // of the intrinsic block, then of the reflex column
};

// Nonlinear parameters q: log omega, log zeta (order 2), delay. Holds references to what it is made
// from.
class Cascade {
 public:
  Cascade(const std::vector<CascadeTrial>& trials, const CascadeSample& sample,
          const CascadeGrid& grid, const ReflexOptions& options);

  const Matrix& linear() const noexcept { return linear_; }
  const Vector& torque() const noexcept { return torque_; }
  const CascadeSample& sample() const noexcept { return *sample_; }
  const Matrix& penalty() const noexcept { return penalty_; }

  // Ridge on the lags of the intrinsic impulse response, as rows below the data.
  void set_penalty(double penalty);

  CausalElement element(const Vector& q) const;
  double delay(const Vector& q) const { return q[options_->order]; }

  // The reflex column, less offsets.
  Vector reflex(const Vector& q) const;
  // The intrinsic block and the reflex column, less offsets and past.
  Matrix columns(const Vector& q) const;

  // The best linear parameters.
  CascadeEvaluation evaluate(const Vector& q) const;
  // Residual with the linear parameters kept: what the delay and dynamics do by themselves.
  Vector residual_with(const Vector& q, const Vector& theta) const;

  // Residuals of evaluate with the delay within a range.
  BoxProblem problem(double delay_low, double delay_high) const;

 private:
  std::vector<PastRun> pasts(const Vector& q) const;

  const std::vector<CascadeTrial>* trials_;
  const CascadeSample* sample_;
  CascadeGrid grid_;
  const ReflexOptions* options_;
  RunOffsets offsets_;
  Matrix linear_;
  Vector torque_;
  Matrix penalty_;
  Matrix gram_;  // of the linear block, penalty included
};

Vector nonlinear(const ReflexOptions& options, double omega, double zeta, double delay);

}  // namespace ulna
