#include <cmath>

#include "passivity/port_function.hpp"

namespace ulna {
namespace {

// p(j w) = even(w^2) + j w odd(w^2), highest power first.
void split_parity(const Vector& p, Vector& even, Vector& odd) {
  const Index degree = p.size() - 1;
  even = Vector::Zero(degree / 2 + 1);
  odd = Vector::Zero(degree >= 1 ? (degree - 1) / 2 + 1 : 1);
  for (Index k = 0; k <= degree; ++k) {
    const double sign = (k / 2) % 2 == 0 ? 1.0 : -1.0;
    Vector& part = k % 2 == 0 ? even : odd;
    part(part.size() - 1 - k / 2) = sign * p(degree - k);
  }
}

Vector times_x(const Vector& p) {
  Vector out = Vector::Zero(p.size() + 1);
  out.head(p.size()) = p;
  return out;
}

}  // namespace

AxisProduct axis_product(const Vector& n, const Vector& d) {
  Vector ne, no, de, dodd;
  split_parity(n, ne, no);
  split_parity(d, de, dodd);
  return {polynomial_sum(polynomial_product(ne, de), times_x(polynomial_product(no, dodd))),
          polynomial_sum(polynomial_product(no, de), -polynomial_product(ne, dodd))};
}

Vector in_units(const Vector& p, double scale) {
  Vector out = p;
  for (Index k = 0; k < p.size(); ++k) {
    out(k) *= std::pow(scale, static_cast<double>(p.size() - 1 - k));
  }
  return out;
}

}  // namespace ulna
