// Polynomials with real coefficients, highest power first as in MATLAB and SciPy.
#pragma once

#include <complex>
#include <vector>

#include "base/types.hpp"

namespace ulna {

using Complex = std::complex<double>;

// Without leading zeros; the zero polynomial is one coefficient, 0.
Vector trimmed(const Vector& p);

Complex polynomial_at(const Vector& p, Complex s);

Vector polynomial_product(const Vector& p, const Vector& q);
Vector polynomial_sum(const Vector& p, const Vector& q);

// p = quotient q + remainder; q must not be zero.
void polynomial_divide(const Vector& p, const Vector& q, Vector& quotient, Vector& remainder);

// All roots, conjugates in exact pairs, by increasing modulus. Ehrlich-Aberth iteration from the
// Newton polygon (Bini 1996, "Numerical computation of polynomial zeros by means of Aberth's
// method"): each root is as good as its own conditioning allows even when the moduli differ by
// many decades, where a companion matrix loses the small ones. A multiple root comes as a cluster
// whose mean is good to rounding. The zero polynomial has none.
std::vector<Complex> all_roots(const Vector& p);

// Geometric mean of the moduli of the non-zero roots without computing them; 1 when there is none.
double polynomial_scale(const Vector& p);

}  // namespace ulna
