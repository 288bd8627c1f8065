// Systems for the tests of this folder.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <initializer_list>

#include "base/random.hpp"
#include "signal/system.hpp"

namespace ulna {

inline Vector poly(std::initializer_list<double> coefficients) {
  Vector out(static_cast<Index>(coefficients.size()));
  Index i = 0;
  for (const double c : coefficients) out(i++) = c;
  return out;
}

inline System one_port(const Vector& num, const Vector& den) {
  return System(TransferMatrix{1, 1, {num}, {den}});
}

inline System impedance(const Matrix& m, const Matrix& b, const Matrix& k) {
  TransferMatrix z{m.rows(), m.rows(), {}, {}};
  for (Index i = 0; i < m.rows(); ++i) {
    for (Index j = 0; j < m.rows(); ++j) {
      z.num.push_back(poly({m(i, j), b(i, j), k(i, j)}));
      z.den.push_back(poly({1.0, 0.0}));
    }
  }
  return System(std::move(z));
}

// A polynomial of random real and complex roots; unless `stable`, some in the right half-plane.
inline Vector random_polynomial(Random& random, Index degree, bool stable) {
  Vector p = Vector::Ones(1);
  while (degree > 0) {
    const double w = std::exp(2.0 * random.normal());
    double zeta = 0.05 + 1.5 * random.uniform();
    if (!stable && random.uniform() < 0.3) zeta = -zeta;
    if (degree >= 2 && random.uniform() < 0.6) {
      p = polynomial_product(p, poly({1.0, 2.0 * zeta * w, w * w}));
      degree -= 2;
    } else {
      p = polynomial_product(p, poly({1.0, zeta > 0.0 ? w : -w}));
      degree -= 1;
    }
  }
  return p;
}

// One to three ports, proper and improper, orders to six, some unstable, some symmetric.
inline System random_system(std::uint64_t stream) {
  Random random(7, stream);
  const Index p = 1 + random.below(3);
  TransferMatrix h{p, p, {}, {}};
  const int kind = static_cast<int>(random.below(4));
  const bool shared = random.uniform() < 0.5;
  const Vector common = random_polynomial(random, random.below(7), random.uniform() < 0.9);
  for (Index k = 0; k < p * p; ++k) {
    const Vector den =
        shared ? common
               : random_polynomial(random, random.below(p > 1 ? 3 : 7), random.uniform() < 0.95);
    const Index degree = std::max<Index>(0, den.size() - 1 - random.below(2) + random.below(2));
    const double gain = (random.uniform() < 0.5 ? -1.0 : 1.0) * std::exp(random.normal());
    Vector num = gain * random_polynomial(random, degree, random.uniform() < 0.8);
    if (k % (p + 1) == 0) num = num.cwiseAbs();
    h.num.push_back(num);
    h.den.push_back(den);
  }
  for (Index i = 0; kind == 0 && i < p; ++i) {
    for (Index j = 0; j < i; ++j) {
      h.num[h.at(i, j)] = h.num[h.at(j, i)];
      h.den[h.at(i, j)] = h.den[h.at(j, i)];
    }
  }
  for (Index i = 0; kind <= 2 && i < p; ++i) {
    Vector& num = h.num[h.at(i, i)];
    num = polynomial_sum(num, std::exp(1.5 * random.normal()) * h.den[h.at(i, i)]);
  }
  const System out(std::move(h));
  return random.uniform() < 0.3 ? as_state_space(out) : out;
}

}  // namespace ulna
