#include "passivity/two_port.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "base/error.hpp"
#include "base/words.hpp"
#include "passivity/port_function.hpp"

namespace ulna {
namespace {

// A polynomial in x = (omega / scale)^2 with what its coefficients would be if nothing cancelled:
// the ratio of both says whether a sign can be trusted, at 0 and at infinity as well.
struct Tracked {
  Vector value = Vector::Zero(1);
  Vector size = Vector::Zero(1);

  double ratio(double x) const {
    if (x == 0.0 || std::isinf(x)) {
      for (Index i = 0; i < size.size(); ++i) {
        const Index k = x == 0.0 ? size.size() - 1 - i : i;
        if (size(k) > 0.0) return value(k) / size(k);
      }
      return kInfinity;
    }
    // Highest power of x (or of 1/x) that stays finite.
    double v = 0.0;
    double s = 0.0;
    for (Index i = 0; i < size.size(); ++i) {
      const Index k = x <= 1.0 ? i : size.size() - 1 - i;
      const double step = x <= 1.0 ? x : 1.0 / x;
      v = v * step + value(k);
      s = s * step + size(k);
    }
    return s > 0.0 ? v / s : kInfinity;
  }

  bool is_zero() const { return (value.cwiseAbs().array() <= kPortRounding * size.array()).all(); }
};

Tracked product(const Tracked& p, const Tracked& q) {
  return {polynomial_product(p.value, q.value), polynomial_product(p.size, q.size)};
}

Tracked combination(const Tracked& p, double factor, const Tracked& q) {
  return {polynomial_sum(p.value, factor * q.value),
          polynomial_sum(p.size, std::abs(factor) * q.size)};
}

// Without cancellation every product of coefficients counts in full.
Vector magnitudes(const Vector& n, const Vector& d, bool odd) {
  const Index degree = n.size() + d.size() - 2;
  Vector out = Vector::Zero(degree / 2 + 1);
  for (Index i = 0; i < n.size(); ++i) {
    for (Index j = 0; j < d.size(); ++j) {
      const Index power = degree - i - j;
      if ((power % 2 == 1) != odd) continue;
      out(out.size() - 1 - power / 2) += std::abs(n(i) * d(j));
    }
  }
  return out;
}

Vector padded(const Vector& p, Index size) {
  Vector out = Vector::Zero(size);
  out.tail(std::min(size, p.size())) = p.tail(std::min(size, p.size()));
  return out;
}

Tracked tracked(const Vector& value, const Vector& size) {
  const Index n = std::max(value.size(), size.size());
  return {padded(value, n), padded(size, n)};
}

struct Offence {
  std::string words;
  double omega = 0.0;
};

enum class Quantity { kMargin, kShortage, kOpposite, kOwnReal, kFarReal };

class Network {
 public:
  Network(const System& z, const TwoPortOptions& options);

  const std::optional<Offence>& offence() const { return offence_; }
  // Re k + |k| without cancellation.
  double coupling(double omega) const;
  double own(double omega) const { return own_->value(omega); }
  double far(double omega) const { return far_->value(omega); }
  double margin(double omega, double a) const;
  double shortage(double omega) const;  // of the termination of the own port
  double opposite(double omega) const;

  // Over the band, for a termination of shortage a.
  Extremum least(Quantity what, double a, const Band& band) const;
  double least_ratio(const Band& band, double a, double& omega) const;

 private:
  void find_common_denominator();
  void find_offence(double tolerance);
  // A pole that some entry does not cancel.
  bool shows(Complex pole) const;
  Complex loop(double omega) const;  // k
  double value(Quantity what, double omega, double a) const;
  std::vector<double> crossings(Quantity what, double level, double a) const;
  std::vector<double> landmarks() const;
  // 2 r1 (r2 - a) as a numerator over q^2.
  Tracked damping(double a, bool own_shifted) const;
  // Changes sign where the margin equals the level.
  Tracked discriminant(const Tracked& damping) const;
  std::vector<double> roots(const Tracked& p) const;

  System z_;
  double scale_;
  // The termination ends `own`; k is the same either way.
  std::unique_ptr<System> own_system_, far_system_;
  std::unique_ptr<PortFunction> own_, far_;
  std::vector<Expansion> loops_;
  Tracked own_part_, far_part_, q_, loop_real_, loop_odd_;
  std::optional<Offence> offence_;
};

TransferMatrix entry(const TransferMatrix& h, Index i, Index j) {
  return {1, 1, {h.num[h.at(i, j)]}, {h.den[h.at(i, j)]}};
}

Network::Network(const System& z, const TwoPortOptions& options)
    : z_(as_rational(z)), scale_(z_.scale()) {
  const TransferMatrix& h = *z_.rational();
  const Index own = options.port - 1;
  own_system_ = std::make_unique<System>(entry(h, own, own));
  far_system_ = std::make_unique<System>(entry(h, 1 - own, 1 - own));
  own_ =
      std::make_unique<PortFunction>(*own_system_, PortView::kDirect, Vector(), options.tolerance);
  far_ =
      std::make_unique<PortFunction>(*far_system_, PortView::kDirect, Vector(), options.tolerance);
  find_offence(options.tolerance);
  find_common_denominator();
  if (options.port == 1) std::swap(own_part_, far_part_);
}

void Network::find_common_denominator() {
  const TransferMatrix& h = *z_.rational();
  // The product of the distinct denominators.
  std::vector<Vector> distinct;
  for (const Vector& d : h.den) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Vector& other) {
      return other.size() == d.size() && other == d;
    });
    if (!known && d.size() > 1) distinct.push_back(d);
  }
  std::array<Vector, 4> n;
  Vector common = Vector::Ones(1);
  for (const Vector& d : distinct) common = polynomial_product(common, in_units(d, scale_));
  for (std::size_t k = 0; k < 4; ++k) {
    n[k] = in_units(h.num[k], scale_);
    if (h.den[k].size() == 1) n[k] /= h.den[k](0);
    for (const Vector& d : distinct) {
      const bool mine = h.den[k].size() == d.size() && h.den[k] == d;
      if (!mine) n[k] = polynomial_product(n[k], in_units(d, scale_));
    }
  }
  const double unit = common.cwiseAbs().maxCoeff();
  common /= unit;
  for (Vector& p : n) p /= unit;
  const auto real_part = [](const Vector& p, const Vector& d) {
    return tracked(axis_product(p, d).real, magnitudes(p, d, false));
  };
  q_ = real_part(common, common);
  far_part_ = real_part(n[0], common);
  own_part_ = real_part(n[3], common);
  const Vector loop = polynomial_product(n[1], n[2]);
  const Vector square = polynomial_product(common, common);
  loop_real_ = real_part(loop, square);
  loop_odd_ = tracked(axis_product(loop, square).odd, magnitudes(loop, square, true));
}

bool Network::shows(Complex pole) const {
  double distance = std::abs(pole);
  for (const Complex p : z_.poles()) {
    const double d = std::abs(p - pole);
    if (d > 1e-5 * std::abs(pole)) distance = std::min(distance, d);
  }
  const MatrixFunction all = [this](Complex s) { return z_(s); };
  return Expansion::about(all, pole, 0.3 * distance).order(1e-9) > 0;
}

// Conditions 1 and 2.
void Network::find_offence(double tolerance) {
  const double limit = std::max(tolerance, kPortRounding);
  std::vector<double> axis = {0.0};
  for (const Complex p : z_.poles()) {
    if (p.imag() < 0.0) continue;
    if (std::abs(p.real()) <= tolerance * std::abs(p)) {
      if (p.imag() > 0.0) axis.push_back(p.imag());
    } else if (p.real() > 0.0 && !offence_ && shows(p)) {
      offence_ =
          Offence{sentence(6, "it has a pole in the right half-plane, at ", p.real(),
                           p.imag() == 0.0 ? "" : sentence(6, " + ", p.imag(), "j"), " rad/s"),
                  p.imag()};
    }
  }
  axis.push_back(kInfinity);
  const MatrixFunction all = [this](Complex s) { return z_(s); };
  const MatrixFunction product = [this](Complex s) -> Eigen::MatrixXcd {
    const Eigen::MatrixXcd z = z_(s);
    return Eigen::MatrixXcd::Constant(1, 1, z(0, 1) * z(1, 0));
  };
  for (const double omega : axis) {
    double distance = kInfinity;
    double far = 0.0;
    for (const Complex p : z_.poles()) {
      const double d = std::abs(p - Complex(0.0, std::isinf(omega) ? 0.0 : omega));
      if (d > 1e-5 * std::max(std::abs(p), 1e-6 * scale_)) distance = std::min(distance, d);
      far = std::max(far, std::abs(p));
    }
    const auto expand = [&](const MatrixFunction& f) {
      if (std::isinf(omega)) return Expansion::about_infinity(f, 0.3 / (far > 0.0 ? far : scale_));
      return Expansion::about(f, Complex(0.0, omega),
                              0.3 * (std::isinf(distance) ? scale_ : distance));
    };
    loops_.push_back(expand(product));
    const Expansion e = expand(all);
    const int order = e.order(1e-9);
    if (order == 0 || offence_) continue;
    const std::string where = std::isinf(omega) ? "infinity" : sentence(6, omega, " rad/s");
    if (order > 1) {
      offence_ = Offence{sentence(6, "it has a pole of order ", order, " at ", where), omega};
      continue;
    }
    const Eigen::MatrixXcd r = e[-1] / e.size();
    const Complex both = r(0, 1) * r(1, 0);
    const double coupled = r(0, 0).real() * r(1, 1).real() - both.real();
    if (std::min(r(0, 0).real(), r(1, 1).real()) < -limit ||
        std::max(std::abs(r(0, 0).imag()), std::abs(r(1, 1).imag())) > limit) {
      offence_ = Offence{
          "a residue of its own impedances at the pole at " + where + " is not real and positive",
          omega};
    } else if (std::abs(both.imag()) > limit || both.real() < -limit || coupled < -limit) {
      offence_ = Offence{
          "the residues at the pole at " + where + " do not meet 0 <= k12 k21 <= k11 k22", omega};
    }
  }
}

Complex Network::loop(double omega) const {
  const auto direct = [&](double w) {
    const Eigen::MatrixXcd z = z_(Complex(0.0, w));
    return z(0, 1) * z(1, 0);
  };
  for (const Expansion& e : loops_) {
    const bool here =
        std::isinf(omega) ? e.at_infinity() : !e.at_infinity() && e.center().imag() == omega;
    if (!here) continue;
    if (e.order(kPortRounding) == 0) return e[0](0, 0);
    // At a pole the limit, from so near that what it hides is below 1e-10.
    if (e.at_infinity()) return direct(1e6 / e.radius());
    return direct(omega + 1e-6 * e.radius());
  }
  return direct(omega);
}

double Network::coupling(double omega) const {
  const Complex k = loop(omega);
  const double size = std::abs(k);
  if (size == 0.0) return 0.0;
  return k.real() > 0.0 ? k.real() + size : k.imag() * (k.imag() / (size - k.real()));
}

double Network::margin(double omega, double a) const {
  return 2.0 * far(omega) * (own(omega) - a) - coupling(omega);
}

double limit_of(double near, double opposite, double coupling) {
  if (opposite > 0.0) return near - coupling / (2.0 * opposite);
  if (opposite == 0.0 && coupling == 0.0) return near;
  return -kInfinity;
}

double Network::shortage(double omega) const {
  return limit_of(own(omega), far(omega), coupling(omega));
}

double Network::opposite(double omega) const {
  return limit_of(far(omega), own(omega), coupling(omega));
}

Tracked Network::damping(double a, bool own_shifted) const {
  const Tracked& shifted = own_shifted ? own_part_ : far_part_;
  const Tracked& other = own_shifted ? far_part_ : own_part_;
  const Tracked out = product(other, combination(shifted, -a, q_));
  return {2.0 * out.value, 2.0 * out.size};
}

// With d = 2 r1 (r2 - a): d - Re k = |k| exactly where d^2 - 2 d Re k - (Im k)^2 = 0.
Tracked Network::discriminant(const Tracked& d) const {
  Tracked odd = product(loop_odd_, loop_odd_);
  odd.value.conservativeResize(odd.value.size() + 1);
  odd.size.conservativeResize(odd.size.size() + 1);
  odd.value(odd.value.size() - 1) = 0.0;
  odd.size(odd.size.size() - 1) = 0.0;
  return combination(combination(product(d, d), -2.0, product(d, loop_real_)), -1.0, odd);
}

std::vector<double> Network::roots(const Tracked& p) const {
  std::vector<double> out;
  for (const Complex x : all_roots(p.value)) {
    if (x.real() < 0.0 || std::abs(x.imag()) > 0.1 * std::abs(x)) continue;
    out.push_back(scale_ * std::sqrt(x.real()));
  }
  return out;
}

std::vector<double> Network::crossings(Quantity what, double level, double a) const {
  switch (what) {
    case Quantity::kMargin:
      return roots(discriminant(combination(damping(a, true), -level, product(q_, q_))));
    case Quantity::kShortage:
      return roots(discriminant(damping(level, true)));
    case Quantity::kOpposite:
      return roots(discriminant(damping(level, false)));
    case Quantity::kOwnReal:
      return roots(combination(own_part_, -level, q_));
    case Quantity::kFarReal:
      break;
  }
  return roots(combination(far_part_, -level, q_));
}

double Network::value(Quantity what, double omega, double a) const {
  switch (what) {
    case Quantity::kMargin:
      return margin(omega, a);
    case Quantity::kShortage:
      return shortage(omega);
    case Quantity::kOpposite:
      return opposite(omega);
    case Quantity::kOwnReal:
      return own(omega);
    case Quantity::kFarReal:
      break;
  }
  return far(omega);
}

Extremum Network::least(Quantity what, double a, const Band& band) const {
  LevelSetProblem problem;
  problem.value = [&](double omega) { return value(what, omega, a); };
  problem.crossings = [&](double level) { return crossings(what, level, a); };
  problem.resolution = [&](double omega) {
    const double size = what == Quantity::kMargin
                            ? own_->size(omega) * far_->size(omega) + std::abs(loop(omega))
                            : own_->size(omega) + far_->size(omega);
    return 1e-11 * (std::abs(value(what, omega, a)) + size);
  };
  return smallest(problem, landmarks(), band);
}

std::vector<double> Network::landmarks() const {
  std::vector<double> out = own_->likely_frequencies();
  const std::vector<double> more = far_->likely_frequencies();
  out.insert(out.end(), more.begin(), more.end());
  for (const Complex p : z_.poles()) {
    out.push_back(std::abs(p));
    out.push_back(std::abs(p.imag()));
    // Close to a pole on the axis, where the coupling may grow without bound.
    out.push_back(std::abs(p.imag()) * (1.0 + 1e-4));
    out.push_back(std::abs(p.imag()) * (1.0 - 1e-4));
  }
  for (const Tracked* p : {&own_part_, &far_part_, &loop_real_, &loop_odd_}) {
    const std::vector<double> at = roots(*p);
    out.insert(out.end(), at.begin(), at.end());
  }
  return out;
}

double Network::least_ratio(const Band& band, double a, double& worst) const {
  std::vector<Tracked> parts;
  for (const Tracked& p : {far_part_, combination(own_part_, -a, q_)}) {
    if (!p.is_zero()) parts.push_back(p);
  }
  if (!loop_real_.is_zero() || !loop_odd_.is_zero()) {
    const Tracked d = damping(a, true);
    for (const Tracked& p : {combination(d, -1.0, loop_real_), discriminant(d)}) {
      // Without damping a margin of zero is structure; with damping it is a limit that is met.
      if (!d.is_zero() || !p.is_zero()) parts.push_back(p);
    }
  }
  std::vector<double> omega = landmarks();
  for (const Tracked& p : parts) {
    const std::vector<double> at = roots(p);
    omega.insert(omega.end(), at.begin(), at.end());
  }
  double least = kInfinity;
  for (const double w : with_midpoints(std::move(omega), band)) {
    const double x = w / scale_ * (w / scale_);
    for (const Tracked& p : parts) {
      const double ratio = p.ratio(x);
      if (ratio >= least) continue;
      least = ratio;
      worst = w;
    }
  }
  return least;
}

void check(const System& z, const TwoPortOptions& o) {
  require(z.outputs() == 2 && z.inputs() == 2, "z",
          sentence(6, "a two-port is a system of 2 outputs and 2 inputs; this one has ",
                   z.outputs(), " and ", z.inputs()));
  require(std::isfinite(o.shortage), "shortage", "the shortage must be a finite number");
  require(o.port == 1 || o.port == 2, "port", "the port must be 1 or 2");
  require(o.tolerance >= 0.0 && o.tolerance <= 0.1, "tolerance",
          "the tolerance must lie between 0 and 0.1");
  if (!o.band) return;
  require(o.band->low >= 0.0 && o.band->high > o.band->low && std::isfinite(o.band->low), "band",
          "the band must be two frequencies in rad/s, the first not negative and the second above "
          "it");
}

}  // namespace

TwoPortStability two_port_stability(const System& z, const TwoPortOptions& o) {
  check(z, o);
  const Network network(z, o);
  const Band band = o.band.value_or(Band{0.0, kInfinity});
  TwoPortStability out;
  out.margin = network.least(Quantity::kMargin, o.shortage, band);
  out.shortage = network.least(Quantity::kShortage, o.shortage, band);
  out.opposite = network.least(Quantity::kOpposite, o.shortage, band);
  out.own_real = network.least(Quantity::kOwnReal, o.shortage, band);
  out.far_real = network.least(Quantity::kFarReal, o.shortage, band);
  if (network.offence() && !o.band) {
    out.answer = Answer::kNotPassive;
    out.shortage = out.opposite = {-kInfinity, network.offence()->omega};
    out.reason = "Not absolutely stable: " + network.offence()->words + ".";
    return out;
  }
  double worst = 0.0;
  const double ratio = network.least_ratio(band, o.shortage, worst);
  const double limit = std::max(o.tolerance, kPortRounding);
  if (ratio < -limit) {
    out.answer = Answer::kNotPassive;
    out.reason =
        sentence(5, "Not absolutely stable: ",
                 network.far(worst) < 0.0          ? "a real part is negative"
                 : network.own(worst) < o.shortage ? "the real part is below the shortage"
                                                   : "the margin is negative",
                 " at ", worst, " rad/s (margin ", network.margin(worst, o.shortage), ").");
  } else if (ratio <= limit) {
    out.reason = sentence(5, "Undecided: the margin is zero within the tolerance of ", o.tolerance,
                          " at ", worst, " rad/s.");
  } else {
    out.answer = Answer::kPassive;
    out.reason = sentence(5, "Absolutely stable: the margin is at least ", out.margin.value,
                          ", smallest at ", out.margin.omega, " rad/s.");
  }
  return out;
}

Matrix two_port_curves(const System& z, const Vector& omega, const TwoPortOptions& o) {
  check(z, o);
  require(omega.size() == 0 || (omega.minCoeff() >= 0.0 && !omega.hasNaN()), "omega",
          "frequencies must not be negative");
  const Network network(z, o);
  Matrix out(omega.size(), 2);
  for (Index i = 0; i < omega.size(); ++i) {
    out(i, 0) = network.margin(omega(i), o.shortage);
    out(i, 1) = network.shortage(omega(i));
  }
  return out;
}

}  // namespace ulna
