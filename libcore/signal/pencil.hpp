// Eigenvalues of matrices and pencils with widely spread entries.
#pragma once

#include <optional>
#include <vector>

#include "base/types.hpp"
#include "signal/polynomial.hpp"

namespace ulna {

// D^-1 A D with powers of two on the diagonal of D such that rows and columns have about the same
// size (Parlett and Reinsch 1969): the eigenvalues stay, their errors shrink.
void balance(Matrix& a);
void balance(Eigen::MatrixXcd& a);

std::vector<Complex> eigenvalues(Matrix a);

// Finite s with det(A - s E) = 0 with their multiplicity, conjugates in exact pairs; nothing when
// the determinant vanishes for every s. An empty E is the identity. Infinite eigenvalues are
// deflated by rank decisions: left in, rounding would turn them into large finite ones.
std::optional<std::vector<Complex>> finite_eigenvalues(const Matrix& a, const Matrix& e);

}  // namespace ulna
