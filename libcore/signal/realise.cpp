#include "signal/realise.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/pencil.hpp"

namespace ulna {
namespace {

struct Parts {
  Vector polynomial;  // highest power first
  Vector remainder;   // below the degree of the denominator
};

Parts split(const Vector& num, const Vector& den) {
  Parts out;
  polynomial_divide(num, den, out.polynomial, out.remainder);
  return out;
}

bool same(const Vector& p, const Vector& q) { return p.size() == q.size() && p == q; }

// Entries of one column of h, grouped by denominator.
struct Block {
  Index column;
  Vector den;
  std::vector<Index> rows;
};

std::vector<Block> blocks_of(const TransferMatrix& h) {
  std::vector<Block> out;
  for (Index j = 0; j < h.inputs; ++j) {
    const std::size_t begin = out.size();
    for (Index i = 0; i < h.outputs; ++i) {
      const Vector& den = h.den[h.at(i, j)];
      if (den.size() < 2) continue;
      std::size_t k = begin;
      while (k < out.size() && !same(out[k].den, den)) ++k;
      if (k == out.size()) out.push_back({j, den, {}});
      out[k].rows.push_back(i);
    }
  }
  return out;
}

Index states_of(const std::vector<Block>& blocks) {
  Index n = 0;
  for (const Block& block : blocks) n += block.den.size() - 1;
  return n;
}

TransferMatrix transposed(const TransferMatrix& h) {
  TransferMatrix out{h.inputs, h.outputs, h.num, h.den};
  for (Index i = 0; i < h.outputs; ++i) {
    for (Index j = 0; j < h.inputs; ++j) {
      out.num[out.at(j, i)] = h.num[h.at(i, j)];
      out.den[out.at(j, i)] = h.den[h.at(i, j)];
    }
  }
  return out;
}

// Companion block of d(s) = den, monic in s / scale; the states are powers of s / scale over d.
void place_block(StateSpace& m, Index at, const TransferMatrix& h, const Block& block,
                 double scale) {
  const Index n = block.den.size() - 1;
  const double leading = block.den(0);
  for (Index k = 0; k < n; ++k) {
    m.a(at, at + k) =
        -scale * block.den(k + 1) / leading * std::pow(scale, -static_cast<double>(k + 1));
    if (k + 1 < n) m.a(at + k + 1, at + k) = scale;
  }
  m.b(at, block.column) = scale;
  for (const Index i : block.rows) {
    const Parts parts = split(h.num[h.at(i, block.column)], block.den);
    const Vector& r = parts.remainder;
    for (Index k = 0; k < n; ++k) {
      // State k is (s / scale)^(n - 1 - k) over the monic polynomial.
      const Index from_end = n - 1 - k;
      if (from_end >= r.size()) continue;
      m.c(i, at + k) =
          r(r.size() - 1 - from_end) / leading * std::pow(scale, -static_cast<double>(k + 1));
    }
  }
}

// u, u', u'', ... of one input: 0 = -x_0 + u, x_{i-1}' = x_i, in units of scale.
void place_chain(StateSpace& m, Index at, const TransferMatrix& h, Index column, Index degree,
                 double scale) {
  m.a(at, at) = -1.0;
  m.b(at, column) = 1.0;
  for (Index k = 1; k <= degree; ++k) {
    m.e(at + k, at + k - 1) = 1.0 / scale;
    m.a(at + k, at + k) = 1.0;
  }
  for (Index i = 0; i < h.outputs; ++i) {
    const std::size_t entry = h.at(i, column);
    const Vector q = split(h.num[entry], h.den[entry]).polynomial;
    for (Index k = 1; k < q.size(); ++k) {
      m.c(i, at + k) = q(q.size() - 1 - k) * std::pow(scale, static_cast<double>(k));
    }
  }
}

StateSpace realise_columns(const TransferMatrix& h, const std::vector<Block>& blocks,
                           double scale) {
  std::vector<Index> degree(static_cast<std::size_t>(h.inputs), 0);
  StateSpace m;
  m.d = Matrix::Zero(h.outputs, h.inputs);
  Index chain_states = 0;
  for (Index j = 0; j < h.inputs; ++j) {
    Index& most = degree[static_cast<std::size_t>(j)];
    for (Index i = 0; i < h.outputs; ++i) {
      const Vector q = split(h.num[h.at(i, j)], h.den[h.at(i, j)]).polynomial;
      m.d(i, j) = q(q.size() - 1);
      most = std::max(most, q.size() - 1);
    }
    if (most > 0) chain_states += most + 1;
  }
  const Index proper = states_of(blocks);
  const Index n = proper + chain_states;
  m.a = Matrix::Zero(n, n);
  m.b = Matrix::Zero(n, h.inputs);
  m.c = Matrix::Zero(h.outputs, n);
  if (chain_states > 0) {
    m.e = Matrix::Zero(n, n);
    m.e.topLeftCorner(proper, proper).setIdentity();
  }
  Index at = 0;
  for (const Block& block : blocks) {
    place_block(m, at, h, block, scale);
    at += block.den.size() - 1;
  }
  for (Index j = 0; j < h.inputs; ++j) {
    const Index most = degree[static_cast<std::size_t>(j)];
    if (most == 0) continue;
    place_chain(m, at, h, j, most, scale);
    at += most + 1;
  }
  return m;
}

// Monic polynomial of roots that come in conjugate pairs.
Vector from_roots(const std::vector<Complex>& roots) {
  Vector out = Vector::Ones(1);
  for (const Complex r : roots) {
    if (r.imag() < 0.0) continue;
    Vector factor(r.imag() > 0.0 ? 3 : 2);
    if (r.imag() > 0.0) {
      factor << 1.0, -2.0 * r.real(), std::norm(r);
    } else {
      factor << 1.0, -r.real();
    }
    out = polynomial_product(out, factor);
  }
  return out;
}

// Takes out of both lists what occurs in both, to eight digits: modes that this entry does not
// show. Conjugates go together.
void cancel(std::vector<Complex>& zeros, std::vector<Complex>& poles, double scale) {
  for (std::size_t i = 0; i < zeros.size();) {
    std::size_t best = 0;
    double distance = 1e300;
    for (std::size_t j = 0; j < poles.size(); ++j) {
      const bool alike = (zeros[i].imag() > 0.0) == (poles[j].imag() > 0.0) &&
                         (zeros[i].imag() < 0.0) == (poles[j].imag() < 0.0);
      if (alike && std::abs(zeros[i] - poles[j]) < distance) {
        best = j;
        distance = std::abs(zeros[i] - poles[j]);
      }
    }
    if (distance > 1e-8 * std::max(std::abs(zeros[i]), 1e-4 * scale)) {
      ++i;
      continue;
    }
    zeros.erase(zeros.begin() + static_cast<std::ptrdiff_t>(i));
    poles.erase(poles.begin() + static_cast<std::ptrdiff_t>(best));
  }
}

}  // namespace

StateSpace realise(const TransferMatrix& h, double scale_rad_s) {
  const std::vector<Block> by_column = blocks_of(h);
  const TransferMatrix turned = transposed(h);
  const std::vector<Block> by_row = blocks_of(turned);
  if (states_of(by_row) >= states_of(by_column)) return realise_columns(h, by_column, scale_rad_s);
  const StateSpace dual = realise_columns(turned, by_row, scale_rad_s);
  return {dual.a.transpose(), dual.c.transpose(), dual.b.transpose(), dual.d.transpose(),
          dual.e.transpose()};
}

std::optional<std::vector<Complex>> pencil_zeros(const StateSpace& m) {
  const Index n = m.a.rows();
  const Index p = m.d.rows();
  Matrix a(n + p, n + p);
  a << m.a, m.b, -m.c, -m.d;
  Matrix e = Matrix::Zero(n + p, n + p);
  if (m.e.size() == 0) {
    e.topLeftCorner(n, n).setIdentity();
  } else {
    e.topLeftCorner(n, n) = m.e;
  }
  return finite_eigenvalues(a, e);
}

System as_state_space(const System& system) { return System(StateSpace(system.state_space())); }

System as_rational(const System& system) {
  if (system.rational()) return system;
  const StateSpace& m = system.state_space();
  TransferMatrix out{system.outputs(), system.inputs(), {}, {}};
  for (Index i = 0; i < out.outputs; ++i) {
    for (Index j = 0; j < out.inputs; ++j) {
      const StateSpace entry{m.a, m.b.col(j), m.c.row(i), m.d.block(i, j, 1, 1), m.e};
      std::optional<std::vector<Complex>> zeros = pencil_zeros(entry);
      if (!zeros) {
        out.num.push_back(Vector::Zero(1));
        out.den.push_back(Vector::Ones(1));
        continue;
      }
      std::vector<Complex> poles = system.poles();
      cancel(*zeros, poles, system.scale());
      Vector num = from_roots(*zeros);
      const Vector den = from_roots(poles);
      // The gain where neither is small: on a circle through the typical frequency.
      const Complex s = std::polar(1.3 * system.scale(), 0.4);
      const Complex shape = polynomial_at(num, s) / polynomial_at(den, s);
      num *= (system(s)(i, j) / shape).real();
      out.num.push_back(num);
      out.den.push_back(den);
    }
  }
  return System(std::move(out));
}

}  // namespace ulna
