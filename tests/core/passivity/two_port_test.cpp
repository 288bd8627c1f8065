// Absolute stability against the worst termination found by brute force, and closed loops.
#include "passivity/two_port.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "systems.hpp"

namespace ulna {
namespace {

System network(const Vector& z11, const Vector& z12, const Vector& z21, const Vector& z22,
               const Vector& den) {
  return System(TransferMatrix{2, 2, {z11, z12, z21, z22}, {den, den, den, den}});
}

System resistors(double r11, double r12, double r21, double r22) {
  return network(poly({r11}), poly({r12}), poly({r21}), poly({r22}), poly({1.0}));
}

TwoPortOptions with_shortage(double a, int port = 2) {
  TwoPortOptions options;
  options.shortage = a;
  options.port = port;
  return options;
}

TEST(TwoPort, ResistorsTolerateAShortageOfOneAndAHalf) {
  const System z = resistors(2.0, 1.0, 1.0, 2.0);
  const TwoPortStability found = two_port_stability(z);
  EXPECT_EQ(found.answer, Answer::kPassive);
  EXPECT_NEAR(found.margin.value, 6.0, 1e-14);
  EXPECT_NEAR(found.shortage.value, 1.5, 1e-14);
  EXPECT_NEAR(found.opposite.value, 1.5, 1e-14);
  EXPECT_EQ(two_port_stability(z, with_shortage(1.499)).answer, Answer::kPassive);
  EXPECT_EQ(two_port_stability(z, with_shortage(1.5)).answer, Answer::kUndecided);
  EXPECT_EQ(two_port_stability(z, with_shortage(1.501)).answer, Answer::kNotPassive);
}

TEST(TwoPort, AnExcessBuysCoupling) {
  // 2 r1 (r2 - a) >= 2 r12^2: 8 >= 2 (2 - a) takes an excess of 2.
  const System z = resistors(2.0, std::sqrt(8.0), std::sqrt(8.0), 2.0);
  EXPECT_EQ(two_port_stability(z).answer, Answer::kNotPassive);
  EXPECT_NEAR(two_port_stability(z).shortage.value, -2.0, 1e-14);
  EXPECT_EQ(two_port_stability(z, with_shortage(-2.01)).answer, Answer::kPassive);
  EXPECT_EQ(two_port_stability(z, with_shortage(-1.99)).answer, Answer::kNotPassive);
}

TEST(TwoPort, PortsAreNotAlike) {
  const System z = resistors(1.0, 1.0, 1.0, 4.0);
  const TwoPortStability second = two_port_stability(z, with_shortage(0.0, 2));
  const TwoPortStability first = two_port_stability(z, with_shortage(0.0, 1));
  EXPECT_NEAR(second.shortage.value, 3.0, 1e-14);
  EXPECT_NEAR(second.opposite.value, 0.75, 1e-14);
  EXPECT_NEAR(first.shortage.value, 0.75, 1e-14);
  EXPECT_NEAR(first.opposite.value, 3.0, 1e-14);
}

TEST(TwoPort, AGyratorCouplesWithoutCost) {
  // k = -1: Re k + |k| = 0.
  const TwoPortStability found = two_port_stability(resistors(1.0, 1.0, -1.0, 1.0));
  EXPECT_NEAR(found.margin.value, 2.0, 1e-15);
  EXPECT_NEAR(found.shortage.value, 1.0, 1e-15);
}

// Theorems 4.1 and 4.2 as printed pass both of these.
TEST(TwoPort, ConditionsThatThePrintedTheoremsMiss) {
  // Residues [1 2; 2 1] at 0. Port 2 open, port 1 short-circuited: a pole at +1.
  const System shared =
      network(poly({1.0, 1.0}), poly({2.0}), poly({2.0}), poly({1.0, 1.0}), poly({1.0, 0.0}));
  const Vector det =
      polynomial_sum(polynomial_product(poly({1.0, 1.0}), poly({1.0, 1.0})), poly({-4.0}));
  EXPECT_NEAR(all_roots(det)[0].real(), 1.0, 1e-12);
  const TwoPortStability found = two_port_stability(shared);
  EXPECT_EQ(found.answer, Answer::kNotPassive);
  EXPECT_EQ(found.shortage.value, -kInfinity);
  EXPECT_NE(found.reason.find("k12 k21"), std::string::npos);
  // A pole of z12 alone in the right half-plane, seen at port 1 through any termination.
  const Vector one = poly({1.0});
  const System hidden(
      TransferMatrix{2, 2, {one, poly({0.5, 0.5}), one, one}, {one, poly({1.0, -1.0}), one, one}});
  EXPECT_EQ(two_port_stability(hidden).answer, Answer::kNotPassive);
  // The same at infinity: a mass shared more than it is there.
  const System mass =
      network(poly({1.0, 1.0}), poly({2.0, 0.0}), poly({2.0, 0.0}), poly({1.0, 1.0}), poly({1.0}));
  EXPECT_EQ(two_port_stability(mass).answer, Answer::kNotPassive);
}

TEST(TwoPort, ASharedSpringIsLossless) {
  const System z = network(poly({1.0, 2.0, 3.0}), poly({3.0}), poly({3.0}), poly({1.0, 2.0, 3.0}),
                           poly({1.0, 0.0}));
  const TwoPortStability found = two_port_stability(z);
  EXPECT_EQ(found.answer, Answer::kPassive) << found.reason;
  EXPECT_NEAR(found.margin.value, 8.0, 1e-12);
  EXPECT_NEAR(found.shortage.value, 2.0, 1e-12);
}

TEST(TwoPort, WorstFrequencyInside) {
  // k = 4 / (s^2 + s + 4)^2 peaks near resonance; found against a fine grid.
  const Vector den = poly({1.0, 1.0, 4.0});
  const Vector own = 3.0 * den;
  const System z = network(own, poly({4.0}), poly({1.0}), own, den);
  const TwoPortStability found = two_port_stability(z);
  Extremum seen{kInfinity, 0.0};
  for (int i = 0; i < 200000; ++i) {
    const double w = 1e-4 * i;
    const Complex k = 4.0 / std::pow(Complex(4.0 - w * w, w), 2.0);
    const double a = 3.0 - (k.real() + std::abs(k)) / 6.0;
    if (a < seen.value) seen = {a, w};
  }
  EXPECT_NEAR(found.shortage.value, seen.value, 1e-9);  // the grid's step squared
  EXPECT_NEAR(found.shortage.omega, seen.omega, 1e-3);
  EXPECT_LE(found.shortage.value, seen.value);
  TwoPortOptions band;
  band.band = Band{10.0, 100.0};
  EXPECT_GT(two_port_stability(z, band).shortage.value, found.shortage.value + 1e-3);
}

TEST(TwoPort, BadInput) {
  EXPECT_THROW(two_port_stability(one_port(poly({1.0}), poly({1.0}))), Error);
  const System z = resistors(2.0, 1.0, 1.0, 2.0);
  EXPECT_THROW(two_port_stability(z, with_shortage(std::nan(""))), Error);
  EXPECT_THROW(two_port_stability(z, with_shortage(0.0, 3)), Error);
  TwoPortOptions options;
  options.tolerance = 1.0;
  EXPECT_THROW(two_port_stability(z, options), Error);
  options = {};
  options.band = Band{3.0, 2.0};
  EXPECT_THROW(two_port_stability(z, options), Error);
  EXPECT_THROW(two_port_curves(z, poly({-1.0})), Error);
}

// Random networks -------------------------------------------------------------------------------

System random_network(Random& random) {
  const bool shared = random.uniform() < 0.6;
  const auto pole = [&] { return poly({1.0, std::exp(random.normal())}); };
  Vector common = Vector::Ones(1);
  for (Index i = random.below(4); i > 0; --i) common = polynomial_product(common, pole());
  const double coupling = std::exp(1.2 * random.normal());
  TransferMatrix z{2, 2, {}, {}};
  for (int k = 0; k < 4; ++k) {
    const bool own = k == 0 || k == 3;
    const Vector den = shared ? common : pole();
    Vector num(den.size());
    for (Index i = 0; i < num.size(); ++i) num(i) = random.normal() * (own ? 1.0 : coupling);
    if (own) num = num.cwiseAbs() + 2.0 * std::exp(random.normal()) * den;
    if (own && random.uniform() < 0.3) {  // a mass
      num = polynomial_sum(num,
                           std::exp(random.normal()) * polynomial_product(den, poly({1.0, 0.0})));
    }
    z.num.push_back(num);
    z.den.push_back(den);
  }
  return System(std::move(z));
}

// Smallest Re(z11 - k / (c + j x)) over x, by trial: the worst termination on the boundary.
double worst_termination(Complex z11, Complex k, double c) {
  double best = kInfinity;
  double at = 0.0;
  const auto visit = [&](double angle) {
    const double value = (z11 - k / Complex(c, c * std::tan(angle))).real();
    if (value >= best) return;
    best = value;
    at = angle;
  };
  double step = 3.14 / 200;
  for (int i = 0; i <= 200; ++i) visit(-1.57 + step * i);
  for (int i = 0; i < 30; ++i) {
    const double here = at;
    visit(here - step);
    visit(here + step);
    step *= 0.7;
  }
  return best;
}

// A loop of the network with (m1 s + b1 + k1 / s) and (m2 s + b2 + k2 / s): a pole on the right?
bool loop_unstable(const System& z, const Vector& first, const Vector& second) {
  const TransferMatrix& h = *z.rational();
  const Vector s = poly({1.0, 0.0});
  const Vector x =
      polynomial_sum(polynomial_product(h.num[0], s), polynomial_product(first, h.den[0]));
  const Vector y =
      polynomial_sum(polynomial_product(h.num[3], s), polynomial_product(second, h.den[3]));
  const Vector direct =
      polynomial_product(polynomial_product(x, y), polynomial_product(h.den[1], h.den[2]));
  const Vector across = polynomial_product(polynomial_product(h.num[1], h.num[2]),
                                           polynomial_product(h.den[0], h.den[3]));
  const Vector square = polynomial_product(s, s);
  for (const Complex root :
       all_roots(polynomial_sum(direct, -polynomial_product(across, square)))) {
    if (root.real() > 1e-3 * std::abs(root)) return true;
  }
  return false;
}

void compare(std::uint64_t stream, int points) {
  Random random(11, stream);
  const System z = random_network(random);
  const TwoPortOptions options =
      with_shortage(random.uniform() < 0.5 ? 0.0 : random.normal(), random.uniform() < 0.5 ? 1 : 2);
  const double a = options.shortage;
  const TwoPortStability found = two_port_stability(z, options);
  double worst = kInfinity;  // relative to what it is the difference of
  double tolerable = kInfinity;
  for (int i = 0; i < points; ++i) {
    const double w = z.scale() * std::pow(10.0, -4.0 + 8.0 * i / (points - 1));
    Eigen::MatrixXcd at = z(Complex(0.0, w));
    if (options.port == 1) std::swap(at(0, 0), at(1, 1));
    const Complex k = at(0, 1) * at(1, 0);
    const double c = at(1, 1).real() - a;
    const double r1 = at(0, 0).real();
    tolerable = std::min(tolerable, at(1, 1).real() - (k.real() + std::abs(k)) / (2.0 * r1));
    worst = std::min(worst, c / std::abs(at(1, 1)));
    if (c <= 0.0) continue;
    worst =
        std::min(worst, worst_termination(at(0, 0), k, c) / (std::abs(at(0, 0)) + std::abs(k) / c));
  }
  EXPECT_FALSE(worst < -1e-9 && found.answer == Answer::kPassive) << stream << found.reason;
  // The sweep may miss a dip between its samples, none of which is deep at 1e-4 of the size.
  const bool inside = found.margin.omega > 1e-4 * z.scale() && found.margin.omega < 1e4 * z.scale();
  EXPECT_FALSE(worst > 1e-4 && inside && found.answer == Answer::kNotPassive)
      << stream << found.reason;
  EXPECT_LE(found.shortage.value, tolerable + 1e-9 * (1.0 + std::abs(tolerable))) << stream;
  if (std::isfinite(found.shortage.value) && std::isfinite(found.shortage.omega) &&
      found.shortage.omega > 0.0) {
    const Matrix curve = two_port_curves(z, poly({found.shortage.omega}), options);
    EXPECT_NEAR(curve(0, 1), found.shortage.value, 1e-9 * (1.0 + std::abs(found.shortage.value)));
  }
  if (found.answer != Answer::kPassive) return;
  const auto store = [&] { return random.uniform() < 0.5 ? 0.0 : std::exp(2.0 * random.normal()); };
  for (int i = 0; i < 4; ++i) {
    const Vector passive = poly({store(), 0.0, store()});
    const Vector active = poly({store(), -a, store()});
    const bool unstable =
        options.port == 2 ? loop_unstable(z, passive, active) : loop_unstable(z, active, passive);
    EXPECT_FALSE(unstable) << stream;
  }
}

TEST(RandomNetworks, AgreeWithTheWorstTermination) {
  for (std::uint64_t stream = 0; stream < 400; ++stream) compare(stream, 60);
}

}  // namespace
}  // namespace ulna
