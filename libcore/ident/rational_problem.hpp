// What every estimator of a rational model needs from the data: the output error of a model and its
// normal equations, with exact sensitivities, in O(rows n^2). Initial states and offsets of the
// runs are eliminated, so that they cost nothing and runs are never joined.
//
// A model is simulated by the chain u -> 1/A -> B -> 1/A, discretised exactly. Its states are the
// filtered derivatives of Young and Jakeman's refined instrumental variables: with
// s_j = p^j/A u, r_i = p^i/A yhat and f_i = p^i/A y,
//   d yhat / d b_j = s_j,  d yhat / d a_i = -r_i,
// and the regression of p^n/A y on [-f_i, s_j] has the output error as residual at the current
// model. So instruments and sensitivities are the same thing here.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "ident/hold.hpp"
#include "ident/rational.hpp"
#include "signal/spectrum.hpp"

namespace ulna {

struct RationalOrders {
  Index poles = 2;
  std::vector<Index> zeros;     // one an input
  std::vector<double> delay_s;  // one an input

  Index inputs() const { return static_cast<Index>(zeros.size()); }
  Index parameters() const;
};

struct RationalSetup {
  RationalOrders orders;
  Hold hold = Hold::kZero;
  bool rest = false;          // the runs begin at rest with zero input before; else states are free
  bool offset = true;         // a constant is added to the output of each run
  double held_out = 0.0;      // share of every run, its end, that is left out of all sums
  double least_skip_s = 0.0;  // left out at the start of a run, at least; else the longest delay
};

// Signals of one run on its way through the filters.
struct RationalRun {
  Index begin = 0;             // row of the record
  Vector output;               // rows
  std::vector<Matrix> taps;    // one an input, 3 x rows: u[k-d-1], u[k-d], u[k-d+1]
  std::vector<Vector> direct;  // one an input, rows: u(t - delay); empty without feedthrough
  Index skip = 0;              // first row in the sums
  Index fit_end = 0;           // one past the last row in the sums
  Matrix work;                 // filtered signals by rows: see RationalProblem
  Matrix basis;                // free responses, n x rows
  Index basis_end = 0;         // from here on they have decayed
  Vector error;                // rows
  Matrix inverse;              // of the Gram matrix of free responses and the constant
  Vector nuisance;             // state (n values, none at rest) and offset, in scaled time

  Index rows() const { return output.size(); }
};

struct NormalEquations {
  Matrix zz;  // instruments with instruments
  Matrix zf;  // instruments with regressors
  Vector g;   // instruments with the output error
};

class RationalProblem {
 public:
  // ranges: the runs; empty: all rows are one. Throws Error for shapes, orders, values that are not
  // finite, constant signals and too few rows.
  RationalProblem(MatrixRef inputs, VectorRef output, double rate_hz,
                  const std::vector<RowRange>& ranges, const RationalSetup& setup);

  const RationalSetup& setup() const { return setup_; }
  double rate_hz() const { return rate_hz_; }
  Index parameters() const { return parameters_; }
  Index fit_rows() const { return fit_rows_; }
  Index nuisances() const;                        // of all runs
  double output_power() const { return power_; }  // mean square of the output about its run's mean
  double longest_s() const;                       // longest run
  const std::vector<RationalRun>& runs() const { return runs_; }

  // Unit of angular frequency, rad/s, in which parameters are given from now on.
  void set_scale(double omega);
  double scale() const { return omega_; }
  Vector to_scaled(const Vector& theta) const;
  Vector from_scaled(const Vector& theta) const;
  Vector units() const;  // theta = units * scaled

  // Sum of squared output errors of a model, states and offsets at their best; not finite for a
  // model that cannot be simulated. The errors stay in the runs.
  double evaluate(const Vector& theta);

  // At the model last evaluated.
  NormalEquations normal_equations(const Vector& theta);
  // Sensitivities in the first rows of the runs' work freed of what states and offsets explain, as
  // parameters() x rows in the sums; after normal_equations.
  Matrix sensitivities(const RationalRun& run) const;

  // Least squares with the state-variable filter 1/(p + omega)^n (Young 1965); free: which
  // parameters are estimated, the others keep their value in `fixed`. Sets the scale to omega.
  Vector filtered_least_squares(double omega, const std::vector<bool>& free, const Vector& fixed);

  Rational unpack(const Vector& theta) const;

 private:
  template <int N>
  void simulate(const Vector& a, const Vector& b, RationalRun& run) const;
  template <int N>
  void filter_output(const Vector& a, RationalRun& run, bool highest) const;
  template <int N>
  void differentiate(const Vector& theta, RationalRun& run) const;
  void invert_basis(RationalRun& run) const;
  Matrix basis_products(const RationalRun& run, MatrixRef rows) const;
  double remove_nuisance(RationalRun& run) const;
  Matrix reduced_gram(const RationalRun& run, Index first) const;

  RationalSetup setup_;
  double rate_hz_ = 0.0;
  double omega_ = 1.0;
  double power_ = 0.0;
  Index n_ = 0;           // poles
  Index parameters_ = 0;  // n + all numerator coefficients
  Index fit_rows_ = 0;
  // Rows of `work`: instruments of a (n), filtered output (n), filtered inputs.
  Index states_ = 0;  // free initial states of a run
  Vector evaluated_;  // the model last evaluated, in this scale, and its sum
  double evaluated_sum_ = 0.0;
  Index nuisance_ = 0;  // states and offset of a run
  std::vector<Delay> delays_;
  std::vector<Index> first_row_;  // of each input's filtered derivatives
  std::vector<RationalRun> runs_;
};

}  // namespace ulna
