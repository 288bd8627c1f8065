#include "signal/system.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/pencil.hpp"
#include "signal/realise.hpp"

namespace ulna {
namespace {

using Eigen::MatrixXcd;

std::string place(const char* name, Index i, Index j) {
  return sentence(6, name, " of row ", i, ", column ", j);
}

void check_entry(const Vector& p, const char* name, Index i, Index j) {
  if (p.size() == 0) {
    throw Error(Fault::kArgument, name,
                sentence(6, "the ", place(name, i, j), " has no coefficient"),
                sentence(6, "row ", i, ", column ", j));
  }
  for (Index k = 0; k < p.size(); ++k) {
    if (std::isfinite(p(k))) continue;
    throw Error(
        Fault::kData, name,
        sentence(6, "coefficient ", k, " of the ", place(name, i, j), " is not a finite number"),
        sentence(6, "row ", i, ", column ", j));
  }
}

// Leading zeros go, and powers of s that numerator and denominator share exactly.
void normalise(Vector& num, Vector& den) {
  num = trimmed(num);
  den = trimmed(den);
  while (num.size() > 1 && den.size() > 1 && num(num.size() - 1) == 0.0 &&
         den(den.size() - 1) == 0.0) {
    num.conservativeResize(num.size() - 1);
    den.conservativeResize(den.size() - 1);
  }
}

TransferMatrix checked(TransferMatrix h) {
  require(h.outputs >= 1 && h.inputs >= 1, "num",
          "a system needs at least one input and one output");
  const std::size_t count = static_cast<std::size_t>(h.outputs * h.inputs);
  require(h.num.size() == count && h.den.size() == count, "den",
          "numerators and denominators must be matrices of the same shape");
  for (Index i = 0; i < h.outputs; ++i) {
    for (Index j = 0; j < h.inputs; ++j) {
      Vector& num = h.num[h.at(i, j)];
      Vector& den = h.den[h.at(i, j)];
      check_entry(num, "numerator", i, j);
      check_entry(den, "denominator", i, j);
      normalise(num, den);
      if (den.isZero(0.0)) {
        throw Error(Fault::kArgument, "den",
                    sentence(6, "the ", place("denominator", i, j), " is zero"),
                    sentence(6, "row ", i, ", column ", j));
      }
      if (num.isZero(0.0)) den = Vector::Ones(1);
    }
  }
  return h;
}

void check_finite(const Matrix& m, const char* name) {
  for (Index j = 0; j < m.cols(); ++j) {
    for (Index i = 0; i < m.rows(); ++i) {
      if (std::isfinite(m(i, j))) continue;
      throw Error(
          Fault::kData, name,
          sentence(6, name, " holds a number that is not finite in row ", i, ", column ", j),
          sentence(6, "row ", i, ", column ", j));
    }
  }
}

void check_shape(const Matrix& m, const char* name, Index rows, Index cols) {
  require(m.rows() == rows && m.cols() == cols, name,
          sentence(9, name, " is ", m.rows(), " x ", m.cols(), " and must be ", rows, " x ", cols,
                   " to fit the other matrices"));
}

StateSpace checked(StateSpace m) {
  const Index n = m.a.rows();
  require(m.d.rows() >= 1 && m.d.cols() >= 1, "D",
          "a system needs at least one input and one output: D must not be empty");
  check_shape(m.a, "A", n, n);
  check_shape(m.b, "B", n, m.d.cols());
  check_shape(m.c, "C", m.d.rows(), n);
  if (m.e.size() != 0) check_shape(m.e, "E", n, n);
  check_finite(m.a, "A");
  check_finite(m.b, "B");
  check_finite(m.c, "C");
  check_finite(m.d, "D");
  check_finite(m.e, "E");
  if (m.e.size() != 0 && m.e.isIdentity(0.0)) m.e.resize(0, 0);
  return m;
}

// Free of impulses: the part of A on the null space of E is invertible.
bool impulse_free(const StateSpace& m) {
  if (m.e.size() == 0) return true;
  const Eigen::JacobiSVD<Matrix> svd(m.e, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Index rank = svd.rank();
  const Index null = m.e.rows() - rank;
  if (null == 0) return true;
  const Matrix block =
      svd.matrixU().rightCols(null).transpose() * m.a * svd.matrixV().rightCols(null);
  const Eigen::JacobiSVD<Matrix> inner(block);
  return inner.singularValues()(null - 1) > 1e-12 * std::max(m.a.norm(), 1e-300);
}

double scale_of(const std::vector<Complex>& points) {
  double sum = 0.0;
  double count = 0.0;
  for (const Complex p : points) {
    if (std::abs(p) == 0.0 || !std::isfinite(std::abs(p))) continue;
    sum += std::log(std::abs(p));
    count += 1.0;
  }
  return count > 0.0 ? std::exp(sum / count) : 1.0;
}

// The denominators that the entries do not share, column by column.
std::vector<Complex> poles_of(const TransferMatrix& h) {
  std::vector<Complex> out;
  for (Index j = 0; j < h.inputs; ++j) {
    std::vector<const Vector*> seen;
    for (Index i = 0; i < h.outputs; ++i) {
      const Vector& den = h.den[h.at(i, j)];
      const bool again = std::any_of(seen.begin(), seen.end(), [&](const Vector* other) {
        return other->size() == den.size() && *other == den;
      });
      if (again) continue;
      seen.push_back(&den);
      const std::vector<Complex> roots = all_roots(den);
      out.insert(out.end(), roots.begin(), roots.end());
    }
  }
  return out;
}

double scale_of(const TransferMatrix& h) {
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t k = 0; k < h.num.size(); ++k) {
    for (const Vector* p : {&h.num[k], &h.den[k]}) {
      Index nonzero = p->size() - 1;  // roots, of which those at 0 have no scale
      while (nonzero > 0 && (*p)(nonzero) == 0.0) --nonzero;
      if (nonzero == 0) continue;
      const double degree = static_cast<double>(nonzero);
      sum += degree * std::log(polynomial_scale(*p));
      count += degree;
    }
  }
  return count > 0.0 ? std::exp(sum / count) : 1.0;
}

// A^-1 B by elimination with partial pivots. For the few states of these systems a blocked
// factorisation spends most of its time on preparing itself.
MatrixXcd solved(MatrixXcd a, MatrixXcd b) {
  const Index n = a.rows();
  if (n > 24) return a.partialPivLu().solve(b);
  for (Index k = 0; k < n; ++k) {
    const Index rest = n - k - 1;
    Index pivot = 0;
    (a.col(k).tail(rest + 1).real().cwiseAbs() + a.col(k).tail(rest + 1).imag().cwiseAbs())
        .maxCoeff(&pivot);
    if (pivot > 0) {
      a.row(k).tail(rest + 1).swap(a.row(k + pivot).tail(rest + 1));
      b.row(k).swap(b.row(k + pivot));
    }
    const Complex scale = 1.0 / a(k, k);
    b.row(k) *= scale;
    a.row(k).tail(rest) *= scale;
    const auto factors = a.col(k).tail(rest);
    b.bottomRows(rest) -= factors.lazyProduct(b.row(k));
    a.bottomRightCorner(rest, rest) -= factors.lazyProduct(a.row(k).tail(rest));
  }
  for (Index k = n; k-- > 1;) b.topRows(k) -= a.col(k).head(k).lazyProduct(b.row(k));
  return b;
}

}  // namespace

System::System(TransferMatrix rational) : rational_(checked(std::move(rational))) {
  scale_ = scale_of(*rational_);
  poles_ = poles_of(*rational_);
  state_space_ = realise(*rational_, scale_);
  for (std::size_t k = 0; k < rational_->num.size(); ++k) {
    proper_ = proper_ && rational_->num[k].size() <= rational_->den[k].size();
  }
}

System::System(StateSpace model) : state_space_(checked(std::move(model))) {
  const std::optional<std::vector<Complex>> found =
      finite_eigenvalues(state_space_.a, state_space_.e);
  if (!found) {
    throw Error(Fault::kAnalysis, "E",
                "A - s E is singular for every s: the model has no solution");
  }
  poles_ = *found;
  std::vector<Complex> landmarks = poles_;
  if (state_space_.d.rows() == state_space_.d.cols()) {
    const auto square = pencil_zeros(state_space_);
    if (square) landmarks.insert(landmarks.end(), square->begin(), square->end());
  }
  scale_ = scale_of(landmarks);
  proper_ = impulse_free(state_space_);
}

MatrixXcd System::operator()(Complex s) const {
  if (rational_) {
    MatrixXcd h(outputs(), inputs());
    for (Index i = 0; i < h.rows(); ++i) {
      for (Index j = 0; j < h.cols(); ++j) {
        const std::size_t k = rational_->at(i, j);
        h(i, j) = polynomial_at(rational_->num[k], s) / polynomial_at(rational_->den[k], s);
      }
    }
    return h;
  }
  const StateSpace& m = state_space_;
  if (m.a.rows() == 0) return m.d.cast<Complex>();
  MatrixXcd pencil = -m.a.cast<Complex>();
  if (m.e.size() == 0) {
    pencil.diagonal().array() += s;
  } else {
    pencil += s * m.e;
  }
  const MatrixXcd states = solved(std::move(pencil), m.b.cast<Complex>());
  return m.c.cast<Complex>().lazyProduct(states) + m.d;
}

std::vector<Complex> System::zeros() const {
  require(outputs() == inputs(), "system",
          sentence(6, "zeros are found for square systems; this one has ", outputs(),
                   " outputs and ", inputs(), " inputs"));
  if (rational_ && outputs() == 1) {
    if (!rational_->num[0].isZero(0.0)) return all_roots(rational_->num[0]);
  } else if (const auto found = pencil_zeros(state_space_)) {
    return *found;
  }
  throw Error(Fault::kAnalysis, "system",
              "the system is singular at every frequency and has no zeros of its own");
}

}  // namespace ulna
