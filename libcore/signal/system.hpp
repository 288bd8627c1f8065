// Linear time-invariant systems in continuous time with real coefficients: matrices of rational
// functions, proper or not, and state space.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "base/types.hpp"
#include "signal/polynomial.hpp"

namespace ulna {

// H_ij(s) = num / den, entries row by row, highest power first; each den at least one coefficient.
struct TransferMatrix {
  Index outputs = 1;
  Index inputs = 1;
  std::vector<Vector> num;
  std::vector<Vector> den;

  std::size_t at(Index i, Index j) const { return static_cast<std::size_t>(i * inputs + j); }
};

// E x' = A x + B u, y = C x + D u. An empty E is the identity; a singular one lets H be improper.
struct StateSpace {
  Matrix a;  // n x n
  Matrix b;  // n x inputs
  Matrix c;  // outputs x n
  Matrix d;  // outputs x inputs
  Matrix e;  // n x n or empty
};

// Immutable; may be read from many threads.
class System {
 public:
  // Both throw Error (kArgument or kData) that names the entry: shapes that do not fit, numbers
  // that are not finite, a denominator of zero, A - s E singular for every s.
  explicit System(TransferMatrix rational);
  explicit System(StateSpace model);

  Index outputs() const { return state_space_.d.rows(); }
  Index inputs() const { return state_space_.d.cols(); }
  Index states() const { return state_space_.a.rows(); }
  bool is_proper() const { return proper_; }
  // The rational functions as given, without leading zeros; nothing for a state space.
  const std::optional<TransferMatrix>& rational() const { return rational_; }
  // A realisation: columns (or rows) with one denominator share its states, so that it is often,
  // not always, minimal. What is improper is in a nilpotent part of E.
  const StateSpace& state_space() const { return state_space_; }

  // H(s), outputs x inputs. Infinite or NaN at a pole.
  Eigen::MatrixXcd operator()(Complex s) const;

  // Poles of every entry, or the eigenvalues of the state space: modes that cancel are among them.
  const std::vector<Complex>& poles() const { return poles_; }

  // Roots of the numerator, or the finite s at which [A - s E, B; C, D] is singular. Throws Error
  // (kArgument) unless square, (kAnalysis) when H(s) is singular for every s.
  std::vector<Complex> zeros() const;

  // Geometric mean of the moduli of the non-zero poles and zeros, rad/s; 1 when there is none.
  double scale() const { return scale_; }

 private:
  std::optional<TransferMatrix> rational_;
  StateSpace state_space_;
  std::vector<Complex> poles_;
  double scale_ = 1.0;
  bool proper_ = true;
};

// Rational entries again where both are rational, else state space.
System in_parallel(const System& first, const System& second);  // first + second
System in_series(const System& first, const System& second);    // first second: second acts first
System in_loop(const System& first, const System& second);      // (I + first second)^-1 first
// The other form of the same system.
System as_state_space(const System& system);
System as_rational(const System& system);

}  // namespace ulna
