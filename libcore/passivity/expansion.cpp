#include "passivity/expansion.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ulna {
namespace {

// Coefficients beyond 32 fold back onto those kept; with three radii free of poles they are below
// 3^-32 = 5e-16 of the size.
constexpr int kNodes = 32;

// exp(j pi i / kNodes).
Complex turned(int i) {
  static const auto table = [] {
    std::array<Complex, 2 * kNodes> t;
    for (std::size_t k = 0; k < t.size(); ++k) {
      t[k] = std::polar(1.0, kPi * static_cast<double>(k) / kNodes);
    }
    return t;
  }();
  return table[static_cast<std::size_t>(((i % (2 * kNodes)) + 2 * kNodes) % (2 * kNodes))];
}

// Nodes are the roots of odd index: none lies on an axis, where zeros and poles are.
Complex node_power(int m, int k) { return turned((2 * m + 1) * k); }

}  // namespace

Expansion Expansion::about(const MatrixFunction& f, Complex center, double radius) {
  Expansion out;
  out.center_ = center;
  out.radius_ = radius;
  // Real coefficients: the lower half of a circle about a real point mirrors the upper one, and the
  // two halves of a sum are conjugates.
  const bool real = center.imag() == 0.0;
  const int nodes = real ? kNodes / 2 : kNodes;
  std::vector<Eigen::MatrixXcd> values;
  for (int m = 0; m < nodes; ++m) {
    values.push_back(f(center + radius * node_power(m, 1)));
    out.size_ = std::max(out.size_, values.back().norm());
  }
  for (int k = -kPrincipal; k <= kRegular; ++k) {
    Eigen::MatrixXcd c = Eigen::MatrixXcd::Zero(values[0].rows(), values[0].cols());
    for (int m = 0; m < nodes; ++m) {
      const Complex w = std::conj(node_power(m, k));
      const Eigen::MatrixXcd& value = values[static_cast<std::size_t>(m)];
      if (real) {
        c.real() += w.real() * value.real() - w.imag() * value.imag();
      } else {
        c += w * value;
      }
    }
    c /= static_cast<double>(nodes);
    out.c_.push_back(std::move(c));
  }
  return out;
}

Expansion Expansion::about_infinity(const MatrixFunction& f, double radius) {
  Expansion out = about([&](Complex z) { return f(1.0 / z); }, 0.0, radius);
  out.at_infinity_ = true;
  return out;
}

const Eigen::MatrixXcd& Expansion::operator[](int k) const {
  return c_[static_cast<std::size_t>(k + kPrincipal)];
}

bool Expansion::covers(Complex s) const {
  if (at_infinity_) return std::abs(s) * radius_ >= 2.0;
  return std::abs(s - center_) <= 0.5 * radius_;
}

Eigen::MatrixXcd Expansion::regular(Complex s) const {
  const Complex z = (at_infinity_ ? 1.0 / s : s - center_) / radius_;
  Eigen::MatrixXcd value = c_.back();
  for (int k = kRegular - 1; k >= 0; --k) value = value * z + (*this)[k];
  return value;
}

int Expansion::order(double share) const {
  for (int k = kPrincipal; k >= 1; --k) {
    if ((*this)[-k].norm() > share * size_) return k;
  }
  return 0;
}

}  // namespace ulna
