#include "signal/polynomial.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ulna {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

// Radii of the starting circles: the upper convex hull of (k, log |a_k|), lowest power first.
std::vector<Complex> starting_points(const Vector& a) {
  const Index n = a.size() - 1;
  std::vector<Index> hull;
  const auto height = [&](Index k) { return std::log(std::abs(a(k))); };
  for (Index k = 0; k <= n; ++k) {
    if (a(k) == 0.0) continue;
    while (hull.size() >= 2) {
      const Index j = hull[hull.size() - 1];
      const Index i = hull[hull.size() - 2];
      const double above = (height(j) - height(i)) * static_cast<double>(k - i) -
                           (height(k) - height(i)) * static_cast<double>(j - i);
      if (above > 0.0) break;
      hull.pop_back();
    }
    hull.push_back(k);
  }
  std::vector<Complex> z;
  for (std::size_t e = 0; e + 1 < hull.size(); ++e) {
    const double count = static_cast<double>(hull[e + 1] - hull[e]);
    const double radius = std::exp((height(hull[e]) - height(hull[e + 1])) / count);
    for (Index m = 0; m < hull[e + 1] - hull[e]; ++m) {
      // 0.7 rad keeps the points off the axes, where symmetric iterations would stay.
      const double angle = 2.0 * kPi * static_cast<double>(m) / count +
                           2.0 * kPi * static_cast<double>(hull[e]) / static_cast<double>(n) + 0.7;
      z.push_back(std::polar(radius, angle));
    }
  }
  return z;
}

// p'(z) / p(z), or `at_root` when |p(z)| is within the error of its evaluation.
Complex logarithmic_derivative(const Vector& a, Complex z, bool& at_root) {
  const Index n = a.size() - 1;
  const bool outside = std::abs(z) > 1.0;
  // Beyond the unit circle the reversed polynomial at 1 / z, which cannot overflow.
  const Complex x = outside ? 1.0 / z : z;
  const double size = std::abs(x);
  Complex p = outside ? a(0) : a(n);
  Complex d = 0.0;
  double bound = std::abs(p);
  for (Index k = 1; k <= n; ++k) {
    const double c = outside ? a(k) : a(n - k);
    d = d * x + p;
    p = p * x + c;
    bound = bound * size + std::abs(c);
  }
  at_root = std::abs(p) <= 2.0 * kEps * static_cast<double>(n) * bound;
  if (at_root) return 0.0;
  if (!outside) return d / p;
  return x * (static_cast<double>(n) - x * d / p);
}

// Rounding scatters a root of multiplicity m by the m-th root of epsilon, and the iteration stops
// each of them anywhere there. Their mean is a simple root of the (m - 1)-th derivative, which
// rounding does not move: each cluster is shifted to it.
void centre_clusters(const Vector& a, std::vector<Complex>& z) {
  std::vector<bool> done(z.size(), false);
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (done[i]) continue;
    const double near = 1e-4 * std::abs(z[i]);
    std::vector<std::size_t> members;
    Complex mean = 0.0;
    for (std::size_t j = i; j < z.size(); ++j) {
      if (done[j] || std::abs(z[j] - z[i]) > near) continue;
      members.push_back(j);
      mean += z[j];
    }
    const std::size_t m = members.size();
    if (m < 2) continue;
    mean /= static_cast<double>(m);
    // Further apart they are roots of their own, known better than what follows.
    const double most = 10.0 * std::pow(kEps, 1.0 / static_cast<double>(m)) * std::abs(mean);
    if (std::any_of(members.begin(), members.end(),
                    [&](std::size_t j) { return std::abs(z[j] - mean) > most; })) {
      continue;
    }
    for (const std::size_t j : members) done[j] = true;
    // In units of a power of two next to the root, so that no power of it overflows.
    const int unit = std::ilogb(std::abs(mean));
    int largest = std::numeric_limits<int>::min();
    for (Index k = 0; k < a.size(); ++k) {
      if (a(k) != 0.0) {
        largest = std::max(largest, std::ilogb(a(k)) + unit * static_cast<int>(k));
      }
    }
    Complex w = mean / std::ldexp(1.0, unit);
    for (int newton = 0; newton < 3; ++newton) {
      std::vector<Complex> taylor(m + 1, 0.0);  // p^(j)(w) / j!
      for (Index k = a.size(); k-- > 0;) {
        for (std::size_t j = m; j > 0; --j) taylor[j] = taylor[j] * w + taylor[j - 1];
        taylor[0] = taylor[0] * w + std::ldexp(a(k), unit * static_cast<int>(k) - largest);
      }
      w -= taylor[m - 1] / (static_cast<double>(m) * taylor[m]);
    }
    const Complex shift = w * std::ldexp(1.0, unit) - mean;
    if (!(std::abs(shift) <= most)) continue;
    for (const std::size_t j : members) z[j] += shift;
  }
}

// Conjugates in exact pairs: rounding breaks the symmetry that real coefficients give.
void pair_conjugates(std::vector<Complex>& z) {
  std::vector<bool> done(z.size(), false);
  for (std::size_t i = 0; i < z.size(); ++i) {
    if (done[i]) continue;
    std::size_t best = i;
    double distance = 2.0 * std::abs(z[i].imag());
    for (std::size_t j = i + 1; j < z.size(); ++j) {
      const double d = std::abs(z[j] - std::conj(z[i]));
      if (!done[j] && d < distance) {
        best = j;
        distance = d;
      }
    }
    done[i] = done[best] = true;
    if (best == i) {
      z[i] = z[i].real();
    } else {
      z[i] = 0.5 * (z[i] + std::conj(z[best]));
      z[best] = std::conj(z[i]);
    }
  }
}

// Lowest power first, without zeros at either end; `at_zero` counts the roots at 0.
Vector inner_coefficients(const Vector& p, Index& at_zero) {
  Index first = 0;
  Index last = p.size() - 1;
  while (first <= last && p(first) == 0.0) ++first;
  while (last >= first && p(last) == 0.0) --last;
  at_zero = first > last ? 0 : p.size() - 1 - last;
  if (first > last) return Vector();
  return p.segment(first, last - first + 1).reverse();
}

}  // namespace

Vector trimmed(const Vector& p) {
  Index first = 0;
  while (first + 1 < p.size() && p(first) == 0.0) ++first;
  if (p.size() == 0) return Vector::Zero(1);
  return p.tail(p.size() - first);
}

Complex polynomial_at(const Vector& p, Complex s) {
  Complex value = 0.0;
  for (Index k = 0; k < p.size(); ++k) value = value * s + p(k);
  return value;
}

Vector polynomial_product(const Vector& p, const Vector& q) {
  Vector out = Vector::Zero(p.size() + q.size() - 1);
  for (Index i = 0; i < p.size(); ++i) out.segment(i, q.size()) += p(i) * q;
  return out;
}

Vector polynomial_sum(const Vector& p, const Vector& q) {
  Vector out = Vector::Zero(std::max(p.size(), q.size()));
  out.tail(p.size()) += p;
  out.tail(q.size()) += q;
  return out;
}

void polynomial_divide(const Vector& p, const Vector& q, Vector& quotient, Vector& remainder) {
  const Vector divisor = trimmed(q);
  remainder = p;
  const Index extra = p.size() - divisor.size();
  if (extra < 0) {
    quotient = Vector::Zero(1);
    return;
  }
  quotient.resize(extra + 1);
  for (Index i = 0; i <= extra; ++i) {
    quotient(i) = remainder(i) / divisor(0);
    remainder.segment(i, divisor.size()) -= quotient(i) * divisor;
    remainder(i) = 0.0;
  }
}

std::vector<Complex> all_roots(const Vector& p) {
  Index at_zero = 0;
  Vector a = inner_coefficients(p, at_zero);
  std::vector<Complex> roots(static_cast<std::size_t>(at_zero), 0.0);
  if (a.size() < 2) return roots;
  a /= a.cwiseAbs().maxCoeff();
  std::vector<Complex> z = starting_points(a);
  std::vector<bool> done(z.size(), false);
  // Bini's method needs about ten sweeps; clusters a few dozen.
  for (int sweep = 0; sweep < 300; ++sweep) {
    bool moving = false;
    for (std::size_t j = 0; j < z.size(); ++j) {
      if (done[j]) continue;
      bool at_root = false;
      Complex slope = logarithmic_derivative(a, z[j], at_root);
      if (at_root) {
        done[j] = true;
        continue;
      }
      for (std::size_t k = 0; k < z.size(); ++k) {
        if (k != j && z[k] != z[j]) slope -= 1.0 / (z[j] - z[k]);
      }
      const Complex step = 1.0 / slope;
      if (!std::isfinite(std::abs(step))) {
        z[j] *= Complex(1.0, 1e-3);
      } else {
        z[j] -= step;
        if (std::abs(step) <= 0.5 * kEps * std::abs(z[j])) done[j] = true;
      }
      moving = true;
    }
    if (!moving) break;
  }
  centre_clusters(a, z);
  pair_conjugates(z);
  std::stable_sort(z.begin(), z.end(), [](Complex x, Complex y) {
    return std::abs(x) != std::abs(y) ? std::abs(x) < std::abs(y) : x.imag() < y.imag();
  });
  roots.insert(roots.end(), z.begin(), z.end());
  return roots;
}

double polynomial_scale(const Vector& p) {
  Index at_zero = 0;
  const Vector a = inner_coefficients(p, at_zero);
  if (a.size() < 2) return 1.0;
  const double log_ratio = std::log(std::abs(a(0))) - std::log(std::abs(a(a.size() - 1)));
  return std::exp(log_ratio / static_cast<double>(a.size() - 1));
}

}  // namespace ulna
