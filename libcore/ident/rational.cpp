#include "ident/rational.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace ulna {
namespace {

using Complex = std::complex<double>;

Complex horner(const Vector& c, Complex s) {
  Complex sum = 0.0;
  for (Index i = c.size(); i-- > 0;) sum = sum * s + c[i];
  return sum;
}

// Real parts below this share of a pole's magnitude are rounding of the eigenvalues.
constexpr double kOnAxis = 1e-10;

}  // namespace

Eigen::VectorXcd polynomial_roots(const Vector& coefficients) {
  Index degree = coefficients.size() - 1;
  while (degree > 0 && coefficients[degree] == 0.0) --degree;
  if (degree <= 0) return {};
  Index zeros = 0;  // roots at the origin are exact
  while (coefficients[zeros] == 0.0 && zeros < degree) ++zeros;
  const Index k = degree - zeros;
  Eigen::VectorXcd roots = Eigen::VectorXcd::Zero(degree);
  if (k > 0) {
    const Vector c = coefficients.segment(zeros, k) / coefficients[degree];
    // In units of the bound on the roots the companion matrix has entries of at most 1.
    double scale = 0.0;
    for (Index i = 0; i < k; ++i) {
      scale = std::max(scale, std::pow(std::abs(c[i]), 1.0 / static_cast<double>(k - i)));
    }
    Matrix companion = Matrix::Zero(k, k);
    for (Index i = 0; i + 1 < k; ++i) companion(i, i + 1) = 1.0;
    for (Index i = 0; i < k; ++i) {
      companion(k - 1, i) = -c[i] / std::pow(scale, static_cast<double>(k - i));
    }
    if (!companion.allFinite()) return Eigen::VectorXcd::Constant(degree, Complex(NAN, NAN));
    const Eigen::EigenSolver<Matrix> solver(companion, false);
    roots.tail(k) = solver.eigenvalues() * scale;
  }
  std::sort(roots.begin(), roots.end(), [](const Complex& x, const Complex& y) {
    const double first = std::abs(x);
    const double second = std::abs(y);
    // Magnitudes of a conjugate pair may differ by rounding.
    if (std::abs(first - second) > 1e-12 * std::max(first, second)) return first < second;
    return x.imag() < y.imag();
  });
  return roots;
}

Vector monic_polynomial(const Eigen::VectorXcd& roots) {
  Eigen::VectorXcd c = Eigen::VectorXcd::Zero(roots.size() + 1);
  c[0] = 1.0;
  for (Index k = 0; k < roots.size(); ++k) {
    for (Index i = k + 1; i > 0; --i) c[i] = c[i - 1] - roots[k] * c[i];
    c[0] *= -roots[k];
  }
  return c.head(roots.size()).real();
}

Eigen::VectorXcd model_poles(const Rational& model) {
  Vector c(model.a.size() + 1);
  c << model.a, 1.0;
  return polynomial_roots(c);
}

bool reflect_poles(Vector& a) {
  Eigen::VectorXcd roots = model_poles({a, {}});
  bool reflected = false;
  for (Complex& root : roots) {
    if (!(root.real() > kOnAxis * std::abs(root))) continue;
    root = {-root.real(), root.imag()};
    reflected = true;
  }
  if (reflected) a = monic_polynomial(roots);
  return reflected;
}

double mean_frequency(const Vector& a) {
  // |a_k|, the first that is not zero, is the product of the poles that are not.
  for (Index k = 0; k < a.size(); ++k) {
    if (a[k] != 0.0) return std::pow(std::abs(a[k]), 1.0 / static_cast<double>(a.size() - k));
  }
  return 1.0;
}

Complex model_response(const Rational& model, Index input, double delay_s, double omega) {
  const Complex s(0.0, omega);
  Vector c(model.a.size() + 1);
  c << model.a, 1.0;
  return horner(model.b[static_cast<std::size_t>(input)], s) / horner(c, s) *
         std::exp(-s * delay_s);
}

}  // namespace ulna
