// Sums, products and loops of systems.
#include <Eigen/LU>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/system.hpp"

namespace ulna {
namespace {

struct Fraction {
  Vector num = Vector::Zero(1);
  Vector den = Vector::Ones(1);
};

Fraction sum(const Fraction& x, const Fraction& y) {
  if (x.num.isZero(0.0)) return y;
  if (y.num.isZero(0.0)) return x;
  if (x.den.size() == y.den.size() && x.den == y.den) return {polynomial_sum(x.num, y.num), x.den};
  return {polynomial_sum(polynomial_product(x.num, y.den), polynomial_product(y.num, x.den)),
          polynomial_product(x.den, y.den)};
}

Fraction entry(const TransferMatrix& h, Index i, Index j) {
  return {h.num[h.at(i, j)], h.den[h.at(i, j)]};
}

void push(TransferMatrix& h, Fraction f) {
  h.num.push_back(std::move(f.num));
  h.den.push_back(std::move(f.den));
}

Matrix descriptor(const StateSpace& m) {
  return m.e.size() == 0 ? Matrix(Matrix::Identity(m.a.rows(), m.a.rows())) : m.e;
}

// Block diagonal E of several models and `extra` algebraic equations.
Matrix joined(const StateSpace& x, const StateSpace& y, Index extra) {
  if (extra == 0 && x.e.size() == 0 && y.e.size() == 0) return Matrix();
  const Index n = x.a.rows();
  const Index k = y.a.rows();
  Matrix e = Matrix::Zero(n + k + extra, n + k + extra);
  e.topLeftCorner(n, n) = descriptor(x);
  e.block(n, n, k, k) = descriptor(y);
  return e;
}

void check(bool fits, const System& x, const System& y, const char* what) {
  require(
      fits, "other",
      sentence(6, "a system of ", x.outputs(), " outputs and ", x.inputs(), " inputs and one of ",
               y.outputs(), " outputs and ", y.inputs(), " inputs cannot be ", what));
}

}  // namespace

System in_parallel(const System& first, const System& second) {
  check(first.outputs() == second.outputs() && first.inputs() == second.inputs(), first, second,
        "added");
  if (first.rational() && second.rational()) {
    TransferMatrix out{first.outputs(), first.inputs(), {}, {}};
    for (Index i = 0; i < out.outputs; ++i) {
      for (Index j = 0; j < out.inputs; ++j) {
        push(out, sum(entry(*first.rational(), i, j), entry(*second.rational(), i, j)));
      }
    }
    return System(std::move(out));
  }
  const StateSpace& x = first.state_space();
  const StateSpace& y = second.state_space();
  const Index n = x.a.rows();
  const Index k = y.a.rows();
  StateSpace out;
  out.a = Matrix::Zero(n + k, n + k);
  out.a.topLeftCorner(n, n) = x.a;
  out.a.bottomRightCorner(k, k) = y.a;
  out.b.resize(n + k, first.inputs());
  out.b << x.b, y.b;
  out.c.resize(first.outputs(), n + k);
  out.c << x.c, y.c;
  out.d = x.d + y.d;
  out.e = joined(x, y, 0);
  return System(std::move(out));
}

System in_series(const System& first, const System& second) {
  check(first.inputs() == second.outputs(), first, second, "multiplied");
  if (first.rational() && second.rational()) {
    TransferMatrix out{first.outputs(), second.inputs(), {}, {}};
    for (Index i = 0; i < out.outputs; ++i) {
      for (Index j = 0; j < out.inputs; ++j) {
        Fraction total;
        for (Index k = 0; k < first.inputs(); ++k) {
          const Fraction x = entry(*first.rational(), i, k);
          const Fraction y = entry(*second.rational(), k, j);
          total = sum(
              total, {trimmed(polynomial_product(x.num, y.num)), polynomial_product(x.den, y.den)});
        }
        push(out, total);
      }
    }
    return System(std::move(out));
  }
  const StateSpace& x = first.state_space();
  const StateSpace& y = second.state_space();
  const Index n = x.a.rows();
  const Index k = y.a.rows();
  StateSpace out;
  out.a = Matrix::Zero(n + k, n + k);
  out.a.topLeftCorner(n, n) = x.a;
  out.a.topRightCorner(n, k) = x.b * y.c;
  out.a.bottomRightCorner(k, k) = y.a;
  out.b.resize(n + k, second.inputs());
  out.b << x.b * y.d, y.b;
  out.c.resize(first.outputs(), n + k);
  out.c << x.c, x.d * y.c;
  out.d = x.d * y.d;
  out.e = joined(x, y, 0);
  return System(std::move(out));
}

System in_loop(const System& first, const System& second) {
  check(first.inputs() == second.outputs() && first.outputs() == second.inputs(), first, second,
        "put into a loop");
  if (first.rational() && second.rational() && first.inputs() == 1 && first.outputs() == 1) {
    const Fraction x = entry(*first.rational(), 0, 0);
    const Fraction y = entry(*second.rational(), 0, 0);
    TransferMatrix out{1, 1, {}, {}};
    push(out, {polynomial_product(x.num, y.den),
               polynomial_sum(polynomial_product(x.den, y.den), polynomial_product(x.num, y.num))});
    return System(std::move(out));
  }
  // The input u1 = u - y2 of the first is a state of its own, so that no inverse is needed.
  const StateSpace& x = first.state_space();
  const StateSpace& y = second.state_space();
  const Index n = x.a.rows();
  const Index k = y.a.rows();
  const Index m = first.inputs();
  StateSpace out;
  out.a = Matrix::Zero(n + k + m, n + k + m);
  out.a.topLeftCorner(n, n) = x.a;
  out.a.block(0, n + k, n, m) = x.b;
  out.a.block(n, 0, k, n) = y.b * x.c;
  out.a.block(n, n, k, k) = y.a;
  out.a.block(n, n + k, k, m) = y.b * x.d;
  out.a.block(n + k, 0, m, n) = -y.d * x.c;
  out.a.block(n + k, n, m, k) = -y.c;
  out.a.block(n + k, n + k, m, m) = -Matrix::Identity(m, m) - y.d * x.d;
  out.b = Matrix::Zero(n + k + m, m);
  out.b.bottomRows(m).setIdentity();
  out.c = Matrix::Zero(first.outputs(), n + k + m);
  out.c.leftCols(n) = x.c;
  out.c.rightCols(m) = x.d;
  out.d = Matrix::Zero(first.outputs(), m);
  out.e = joined(x, y, m);
  const Matrix loop = Matrix::Identity(m, m) + y.d * x.d;
  const Eigen::FullPivLU<Matrix> lu(loop);
  if (x.e.size() != 0 || y.e.size() != 0 || !lu.isInvertible()) return System(std::move(out));
  // Both proper and the loop well posed: u1 is eliminated and E is the identity.
  const Index s = n + k;
  const Matrix gain = lu.solve(Matrix::Identity(m, m));
  const Matrix solved = gain * out.a.bottomLeftCorner(m, s);
  const Matrix input = out.a.topRightCorner(s, m);
  StateSpace small;
  small.a = out.a.topLeftCorner(s, s) + input * solved;
  small.b = input * gain;
  small.c = out.c.leftCols(s) + x.d * solved;
  small.d = x.d * gain;
  return System(std::move(small));
}

}  // namespace ulna
