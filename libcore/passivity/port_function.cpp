#include "passivity/port_function.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/words.hpp"
#include "signal/realise.hpp"

namespace ulna {
namespace {

using Eigen::MatrixXcd;

// A residue below this share of the response around it is that of a mode that cancels. Coefficients
// that came through a file with ten digits still cancel.
constexpr double kCancelled = 1e-9;

double smallest_eigenvalue(const MatrixXcd& hermitian) {
  if (hermitian.rows() == 1) return hermitian(0, 0).real();
  if (!hermitian.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  return Eigen::SelfAdjointEigenSolver<MatrixXcd>(hermitian, Eigen::EigenvaluesOnly)
      .eigenvalues()(0);
}

MatrixXcd hermitian_part(const MatrixXcd& h) { return 0.5 * (h + h.adjoint()); }

double largest_gain(const MatrixXcd& s) {
  if (s.size() == 1) return std::abs(s(0, 0));
  if (!s.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt(std::max(
      0.0, Eigen::SelfAdjointEigenSolver<MatrixXcd>(s.adjoint() * s, Eigen::EigenvaluesOnly)
               .eigenvalues()
               .maxCoeff()));
}

std::string at_place(double omega) {
  if (std::isinf(omega)) return "at infinity";
  return sentence(6, "at ", omega, " rad/s");
}

// d' H d as one rational function where the entries share a denominator.
std::optional<std::pair<Vector, Vector>> compressed(const TransferMatrix& h, const Vector& d) {
  Vector num = Vector::Zero(1);
  Vector den;
  for (Index i = 0; i < h.outputs; ++i) {
    for (Index j = 0; j < h.inputs; ++j) {
      const std::size_t k = h.at(i, j);
      if (d(i) * d(j) == 0.0 || h.num[k].isZero(0.0)) continue;
      if (den.size() == 0) den = h.den[k];
      if (den.size() != h.den[k].size() || den != h.den[k]) return std::nullopt;
      num = polynomial_sum(num, d(i) * d(j) * h.num[k]);
    }
  }
  if (den.size() == 0) den = Vector::Ones(1);
  return std::pair(trimmed(num), den);
}

}  // namespace

void PortFunction::take_rational(const Vector& n, const Vector& d) {
  Vector num = n;
  Vector den = d;
  if (view_ == PortView::kInverse) std::swap(num, den);
  if (view_ == PortView::kScattering) {
    num = trimmed(polynomial_sum(d, -n));
    den = trimmed(polynomial_sum(d, n));
  }
  if (den.isZero(0.0)) {
    exists_ = false;
    return;
  }
  f_ = [num, den](Complex s) -> MatrixXcd {
    return MatrixXcd::Constant(1, 1, polynomial_at(num, s) / polynomial_at(den, s));
  };
  poles_ = all_roots(den);
  const Vector ns = in_units(num, scale_);
  const Vector ds = in_units(den, scale_);
  q_ = axis_product(ds, ds).real;
  // Minus the squared gain, so that the smallest value is sought for every view.
  p_ = view_ == PortView::kScattering ? Vector(-axis_product(ns, ns).real)
                                      : axis_product(ns, ds).real;
}

PortFunction::PortFunction(const System& system, PortView view, const Vector& direction,
                           double tolerance)
    : view_(view), ports_(direction.size() == 0 ? system.inputs() : 1), scale_(system.scale()) {
  const bool one = system.inputs() == 1;
  std::optional<std::pair<Vector, Vector>> scalar;
  if (system.rational() && one) scalar = {system.rational()->num[0], system.rational()->den[0]};
  if (system.rational() && direction.size() > 0 && view != PortView::kInverse) {
    scalar = compressed(*system.rational(), direction);
  }
  for (const Complex p : system.poles()) {
    landmarks_.push_back(std::abs(p));
    landmarks_.push_back(std::abs(p.imag()));
  }
  if (scalar) {
    take_rational(scalar->first, scalar->second);
  } else {
    AxisSystem h = axis_system(system.state_space(), scale_);
    StateSpace model = system.state_space();
    const bool early = direction.size() > 0 && view != PortView::kInverse;
    if (early) {
      h = along(h, direction);
      model.b = model.b * direction;
      model.c = direction.transpose() * model.c;
      model.d = Matrix::Constant(1, 1, direction.dot(model.d * direction));
    }
    const MatrixXcd u = direction.cast<Complex>();
    const MatrixFunction at = [&system, early, u](Complex s) -> MatrixXcd {
      if (!early) return system(s);
      return u.transpose() * system(s) * u;
    };
    std::optional<std::vector<Complex>> poles = system.poles();
    if (view == PortView::kDirect) {
      axis_ = h;
      f_ = at;
    } else {
      if (view == PortView::kScattering)
        model.d += Matrix::Identity(model.d.rows(), model.d.cols());
      axis_ = view == PortView::kInverse ? inverse(h) : scattering(h);
      poles = pencil_zeros(model);
      exists_ = axis_ && poles;
    }
    if (!exists_) return;
    poles_ = *poles;
    if (view == PortView::kInverse) {
      const bool late = direction.size() > 0;
      if (late) axis_ = along(*axis_, direction);
      f_ = [at, late, u](Complex s) -> MatrixXcd {
        const MatrixXcd inverted = at(s).inverse();
        return late ? MatrixXcd(u.transpose() * inverted * u) : inverted;
      };
    }
    if (view == PortView::kScattering) {
      f_ = [at](Complex s) -> MatrixXcd {
        const MatrixXcd value = at(s);
        const MatrixXcd one_matrix = MatrixXcd::Identity(value.rows(), value.cols());
        return 2.0 * (value + one_matrix).inverse() - one_matrix;
      };
    }
  }
  if (!exists_) return;
  for (const Complex p : poles_) {
    landmarks_.push_back(std::abs(p));
    landmarks_.push_back(std::abs(p.imag()));
  }
  expand(system.poles(), tolerance);
  if (view_ == PortView::kDirect) find_structure();
}

std::vector<PortFunction::Cluster> PortFunction::clusters(double tolerance) const {
  double largest = scale_;
  for (const Complex p : poles_) largest = std::max(largest, std::abs(p));
  std::vector<Cluster> out;
  std::vector<bool> done(poles_.size(), false);
  for (std::size_t i = 0; i < poles_.size(); ++i) {
    // 1e-11 of the fastest pole is 0 to the rounding of an eigenvalue.
    const bool zero = std::abs(poles_[i]) <= 1e-11 * largest;
    if (done[i] || poles_[i].imag() < 0.0) continue;
    Complex sum = 0.0;
    double count = 0.0;
    // Roots of multiplicity 3 lie some eps^(1/3) apart.
    const double near = std::max(1e-5 * std::abs(poles_[i]), 1e-11 * largest);
    for (std::size_t j = i; j < poles_.size(); ++j) {
      if (done[j] || std::abs(poles_[j] - poles_[i]) > near) continue;
      done[j] = true;
      sum += poles_[j];
      count += 1.0;
    }
    Cluster c{sum / count, kInfinity};
    const double size = std::abs(c.center);
    // Of a multiple pole rounding leaves a ring; whether it surrounds the axis is all that shows.
    const bool ring = count > 1.0 && std::abs(c.center.real()) <= near;
    c.axis = zero || ring || std::abs(c.center.real()) <= tolerance * size;
    c.right = !c.axis && c.center.real() > 0.0;
    c.exact = zero || ring || c.center.real() <= 1e-12 * size;
    if (zero) c.center = 0.0;
    if (c.axis) c.center = Complex(0.0, c.center.imag());
    // Its own members lie within `near`, the rest (conjugates too) beyond.
    for (const Complex p : poles_) {
      const double d = std::abs(p - c.center);
      if (d > 2.0 * near) c.distance = std::min(c.distance, d);
    }
    out.push_back(c);
  }
  return out;
}

void PortFunction::expand(const std::vector<Complex>& also, double tolerance) {
  const std::vector<Cluster> found = clusters(tolerance);
  const auto radius = [&](Complex center) {
    double distance = kInfinity;
    for (const Complex p : poles_) {
      const double d = std::abs(p - center);
      if (d > 0.0) distance = std::min(distance, d);
    }
    return 0.3 * (std::isinf(distance) ? scale_ : distance);
  };
  double largest = 0.0;
  for (const Cluster& c : found) largest = std::max(largest, std::abs(c.center));
  Cluster origin{0.0, kInfinity};
  for (const Cluster& c : found) {
    if (c.center == 0.0) origin = c;
  }
  const bool pole_at_zero = origin.axis;
  origin.axis = true;
  const double around_zero =
      pole_at_zero ? 0.3 * (std::isinf(origin.distance) ? scale_ : origin.distance) : radius(0.0);
  expansions_.push_back(Expansion::about(f_, 0.0, around_zero));
  stands_in_.push_back(judge(expansions_.back(), origin, tolerance));
  expansions_.push_back(Expansion::about_infinity(f_, 0.3 / (largest > 0.0 ? largest : scale_)));
  stands_in_.push_back(judge(expansions_.back(),
                             {Complex(0.0, kInfinity), kInfinity, false, true, true}, tolerance));
  for (const Cluster& c : found) {
    if (c.center == 0.0 || (!c.axis && !c.right)) continue;
    const double r = 0.3 * (std::isinf(c.distance) ? scale_ : c.distance);
    const Expansion expansion = Expansion::about(f_, c.center, r);
    const bool lossless = judge(expansion, c, tolerance);
    if (!c.axis) continue;
    expansions_.push_back(expansion);
    stands_in_.push_back(lossless);
  }
  // Poles of the system itself on the axis, where an inverse is regular but not to be evaluated.
  for (const Complex p : also) {
    if (p.imag() <= 0.0 || std::abs(p.real()) > tolerance * std::abs(p)) continue;
    const Complex center(0.0, p.imag());
    const auto known = [&](const Expansion& e) {
      return !e.at_infinity() && std::abs(e.center() - center) <= 0.1 * e.radius();
    };
    if (std::any_of(expansions_.begin(), expansions_.end(), known)) continue;
    expansions_.push_back(Expansion::about(f_, center, radius(center)));
    stands_in_.push_back(true);
  }
}

// Whether the Hermitian part goes to minus infinity at a pole, by its sign close to it.
bool PortFunction::falls_towards(const Expansion& e, double omega) const {
  for (const double side : {1.0, -1.0}) {
    const auto least = [&](double share) {
      const double w =
          e.at_infinity() ? side / (share * e.radius()) : omega + side * share * e.radius();
      return smallest_eigenvalue(hermitian_part(f_(Complex(0.0, w))));
    };
    const double close = least(1e-4);
    if (close < 0.0 && close < 2.0 * least(1e-3)) return true;
  }
  return false;
}

bool PortFunction::judge(const Expansion& expansion, const Cluster& c, double tolerance) {
  const double omega = expansion.at_infinity() ? kInfinity : std::abs(c.center.imag());
  const std::string where = at_place(omega);
  const int order = expansion.order(kCancelled);
  if (c.right) {
    if (order == 0) {
      hidden_.push_back(c.center);
      return true;
    }
    const std::string place = c.center.imag() == 0.0
                                  ? sentence(6, c.center.real())
                                  : sentence(6, c.center.real(), " + ", c.center.imag(), "j");
    flaws_.push_back(
        {omega, false, true, true, "a pole in the right half-plane, at " + place + " rad/s"});
    return true;
  }
  if (order == 0) return true;
  if (view_ == PortView::kScattering) {
    flaws_.push_back({omega, true, true, true, "a pole " + where});
    return false;
  }
  if (!c.exact) {
    flaws_.push_back(
        {omega, true, false, false,
         "a pole " + where + " that the tolerance cannot tell from the right half-plane"});
  }
  if (order >= 2) {
    flaws_.push_back(
        {omega, true, true, falls_towards(expansion, omega),
         sentence(6, "a pole of order ", order, " ", where, " (only simple ones are passive)")});
    return false;
  }
  const MatrixXcd residue = expansion[-1] / expansion.size();
  const double skew = (residue - residue.adjoint()).norm();
  const double least = smallest_eigenvalue(hermitian_part(residue));
  const double limit = std::max(tolerance, kPortRounding);
  if (skew > kPortRounding) {
    flaws_.push_back(
        {omega, true, skew > limit, skew > limit,
         "a pole " + where + " whose residue is not " + (ports_ > 1 ? "Hermitian" : "real")});
    return skew <= limit;
  }
  if (least < -kPortRounding) {
    flaws_.push_back({omega, true, least < -limit, false,
                      "a pole " + where + " whose residue is " +
                          (ports_ > 1 ? "not positive semidefinite" : "negative")});
  }
  return true;
}

const Expansion* PortFunction::covering(double omega) const {
  const Expansion* best = nullptr;
  double nearest = kInfinity;
  for (std::size_t i = 0; i < expansions_.size(); ++i) {
    const Expansion& e = expansions_[i];
    if (!stands_in_[i]) continue;
    if (std::isinf(omega)) {
      if (e.at_infinity()) return &e;
      continue;
    }
    const Complex s(0.0, omega);
    if (!e.covers(s)) continue;
    const double z =
        e.at_infinity() ? 1.0 / (omega * e.radius()) : std::abs(s - e.center()) / e.radius();
    if (z < nearest) {
      nearest = z;
      best = &e;
    }
  }
  return best;
}

MatrixXcd PortFunction::response(double omega) const {
  const Expansion* e = covering(omega);
  if (e == nullptr) return f_(Complex(0.0, omega));
  if (std::isinf(omega)) return (*e)[0];
  return e->regular(Complex(0.0, omega));
}

double PortFunction::value(double omega) const {
  const MatrixXcd h = response(omega);
  if (!h.allFinite()) return std::numeric_limits<double>::quiet_NaN();  // at a pole
  return view_ == PortView::kScattering ? -largest_gain(h) : smallest_eigenvalue(hermitian_part(h));
}

double PortFunction::size(double omega) const {
  const Expansion* e = covering(omega);
  return e == nullptr ? f_(Complex(0.0, omega)).norm() : e->size();
}

std::vector<double> PortFunction::crossings(double level) const {
  const bool gain = view_ == PortView::kScattering;
  if (axis_) return gain ? gain_crossings(*axis_, -level) : hermitian_crossings(*axis_, level);
  const double wanted = gain ? -level * level : level;
  std::vector<double> out;
  for (const Complex x : all_roots(polynomial_sum(p_, -wanted * q_))) {
    if (x.real() < 0.0 || std::abs(x.imag()) > 0.1 * std::abs(x)) continue;
    out.push_back(scale_ * std::sqrt(x.real()));
  }
  return out;
}

std::vector<double> PortFunction::likely_frequencies() const { return landmarks_; }

void PortFunction::find_structure() {
  // Hermitian coefficients in the real variable e: z = j e about 0, z = -j e about infinity.
  const auto coefficient = [&](const Expansion& x, int k) {
    Complex turn = 1.0;
    for (int i = 0; i < k; ++i) turn *= x.at_infinity() ? Complex(0.0, -1.0) : Complex(0.0, 1.0);
    return MatrixXcd(0.5 * (turn * x[k] + std::conj(turn) * x[k].adjoint()));
  };
  for (Index i = 0; i < ports_; ++i) {
    double most = 0.0;
    // Zero in a neighbourhood is zero everywhere.
    for (int k = 0; k <= Expansion::kRegular; ++k) {
      most = std::max(most, coefficient(expansions_[1], k).row(i).norm());
    }
    if (most > kPortRounding * expansions_[1].size()) lossy_.push_back(i);
  }
  for (int end = 0; end < 2; ++end) {
    const Expansion& x = expansions_[static_cast<std::size_t>(end)];
    const MatrixXcd first = coefficient(x, 0);
    for (const Index i : lossy_) {
      vanishing_[end].push_back(first.row(i).norm() <= kPortRounding * x.size());
    }
  }
}

double PortFunction::scaled_margin(const Expansion& x, double omega) const {
  const std::vector<bool>& vanishing = vanishing_[x.at_infinity() ? 1 : 0];
  const double e =
      x.at_infinity() ? (std::isinf(omega) ? 0.0 : 1.0 / (omega * x.radius())) : omega / x.radius();
  const Index n = static_cast<Index>(lossy_.size());
  MatrixXcd out = MatrixXcd::Zero(n, n);
  Complex turn = 1.0;
  for (int k = 0; k <= Expansion::kRegular; ++k) {
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) {
        const Index row = lossy_[static_cast<std::size_t>(i)];
        const Index column = lossy_[static_cast<std::size_t>(j)];
        const int taken = (vanishing[static_cast<std::size_t>(i)] ? 1 : 0) +
                          (vanishing[static_cast<std::size_t>(j)] ? 1 : 0);
        const Complex c =
            0.5 * (turn * x[k](row, column) + std::conj(turn) * std::conj(x[k](column, row)));
        // Orders below those taken out are zero to rounding, but a skew part of order 1 is none.
        if (k < taken) {
          if (k == 1 && std::abs(c) > kPortRounding * x.size()) return -std::abs(c) / x.size();
          continue;
        }
        out(i, j) += c * std::pow(e, k - taken);
      }
    }
    turn *= x.at_infinity() ? Complex(0.0, -1.0) : Complex(0.0, 1.0);
  }
  return smallest_eigenvalue(hermitian_part(out)) / x.size();
}

double PortFunction::margin(double omega) const {
  if (lossy_.empty()) return kInfinity;
  const Expansion* e = covering(omega);
  if (e != nullptr && (e->at_infinity() || e->center() == 0.0)) return scaled_margin(*e, omega);
  const MatrixXcd h = response(omega);
  const double scale = size(omega);
  if (!(scale > 0.0)) return 0.0;
  return smallest_eigenvalue(hermitian_part(h)(lossy_, lossy_)) / scale;
}

}  // namespace ulna
