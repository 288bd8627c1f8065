// Rational models with several inputs and one output,
//   y(t) = sum_i B_i(p) / A(p) u_i(t - delay_i),  p = d/dt,
// A monic of degree n, B_i of degree at most n. Coefficients ascend: a_0 ... a_(n-1), b_0 ... b_m.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "base/types.hpp"

namespace ulna {

struct Rational {
  Vector a;               // n, ascending, without the leading 1
  std::vector<Vector> b;  // one an input, m_i + 1, ascending
};

// Roots of c_0 + c_1 s + ... + c_k s^k; coefficients that end in zeros give fewer roots. Sorted by
// magnitude, then by imaginary part.
Eigen::VectorXcd polynomial_roots(const Vector& coefficients);

// The monic polynomial with these roots, without its leading 1, ascending. Roots are real or come
// in conjugate pairs.
Vector monic_polynomial(const Eigen::VectorXcd& roots);

Eigen::VectorXcd model_poles(const Rational& model);

// Mirrors the poles of the right half plane into the left one; true when there were any. Poles on
// the imaginary axis, to rounding, stay.
bool reflect_poles(Vector& a);

// Geometric mean of the magnitudes of the poles that are not zero; 1 when all are.
double mean_frequency(const Vector& a);

// B_i(j w) / A(j w) exp(-j w delay_i), w in rad/s.
std::complex<double> model_response(const Rational& model, Index input, double delay_s,
                                    double omega);

}  // namespace ulna
