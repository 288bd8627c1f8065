// Passivity indices and positive realness against closed forms and dense sweeps.
#include "passivity/indices.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "../impedance/made_record.hpp"
#include "base/error.hpp"
#include "systems.hpp"

namespace ulna {
namespace {

// As rational functions and as state space: the paths have little in common.
std::vector<System> both(const System& system) { return {system, as_state_space(system)}; }

TEST(Indices, ResonanceWithZerosAtBothEnds) {
  // H^-1 = s + 0.2 + 1/s: lossless but for 0.2. Commercial tools return minus infinity.
  for (const System& h : both(one_port(poly({1.0, 0.0}), poly({1.0, 0.2, 1.0})))) {
    const PassivityIndices found = passivity_indices(h);
    EXPECT_NEAR(found.output.value, 0.2, 1e-14);
    EXPECT_EQ(found.input.value, 0.0);
    EXPECT_NEAR(found.relative.value, 1.0, 1e-14);
    EXPECT_EQ(found.answer, Answer::kPassive) << found.reason;
  }
}

TEST(Indices, ThirdOrder) {
  for (const System& h : both(one_port(poly({1.0, 1.0, 5.0, 0.1}), poly({1.0, 2.0, 3.0, 4.0})))) {
    const PassivityIndices found = passivity_indices(h);
    EXPECT_NEAR(found.input.value, 0.025, 1e-14);
    EXPECT_EQ(found.input.omega, 0.0);
    EXPECT_EQ(found.answer, Answer::kPassive);
  }
}

TEST(Indices, BiquadraticWithBothIndices) {
  // Re H = (2 x^2 + 16 x + 200) / ((10 - x)^2 + 16 x), x = w^2: 2 at both ends and above between.
  // Re 1/H = (2 x^2 + 16 x + 200) / ((20 - 2x)^2 + 196 x): 2/7 at x = 10.
  for (const System& h : both(one_port(poly({2.0, 14.0, 20.0}), poly({1.0, 4.0, 10.0})))) {
    const PassivityIndices found = passivity_indices(h);
    EXPECT_NEAR(found.input.value, 2.0, 1e-13);
    EXPECT_NEAR(found.output.value, 2.0 / 7.0, 1e-14);
    EXPECT_NEAR(found.output.omega, std::sqrt(10.0), 1e-6);
    EXPECT_EQ(found.answer, Answer::kPassive);
  }
}

TEST(Indices, AHairLessThanPassive) {
  // Re H = (6.2 - 0.1 x) / (x^2 + 5 x + 4): smallest where 0.1 x^2 - 12.4 x - 31.4 = 0.
  const double x = 62.0 + std::sqrt(62.0 * 62.0 + 314.0);
  for (const System& h : both(one_port(poly({1.0, 3.1}), poly({1.0, 3.0, 2.0})))) {
    const PassivityIndices found = passivity_indices(h);
    EXPECT_NEAR(found.input.value, (6.2 - 0.1 * x) / (x * x + 5.0 * x + 4.0), 1e-16);
    EXPECT_NEAR(found.input.value, -3.9e-4, 5e-6);
    EXPECT_NEAR(found.input.omega, std::sqrt(x), 1e-5);
    EXPECT_NEAR(found.input.omega, 11.25, 5e-3);
    EXPECT_EQ(found.answer, Answer::kNotPassive);
    EXPECT_GT(found.relative.value, 1.0);
  }
  EXPECT_EQ(passivity_indices(one_port(poly({1.0, 2.9}), poly({1.0, 3.0, 2.0}))).answer,
            Answer::kPassive);
  // Exactly at the limit one digit of a coefficient decides.
  EXPECT_EQ(passivity_indices(one_port(poly({1.0, 3.0}), poly({1.0, 3.0, 2.0}))).answer,
            Answer::kUndecided);
  IndexOptions coarse;
  coarse.tolerance = 0.1;
  EXPECT_EQ(passivity_indices(one_port(poly({1.0, 3.1}), poly({1.0, 3.0, 2.0})), coarse).answer,
            Answer::kUndecided);
}

struct Case {
  const char* name;
  Vector num, den;
  Answer answer;
  double input;
};

TEST(PositiveReal, PolesOnTheAxisAndAtInfinity) {
  const Answer yes = Answer::kPassive;
  const Answer no = Answer::kNotPassive;
  const Case cases[] = {
      {"spring", poly({1.0}), poly({1.0, 0.0}), yes, 0.0},
      {"mass", poly({1.0, 0.0}), poly({1.0}), yes, 0.0},
      {"lossless resonance", poly({1.0, 0.0}), poly({1.0, 0.0, 1.0}), yes, 0.0},
      {"with a resistance", poly({1.0, 1.0, 1.0}), poly({1.0, 0.0, 1.0}), yes, 1.0},
      {"impedance of an arm", poly({1.3, 5.7, 42.0}), poly({1.0, 0.0}), yes, 5.7},
      {"negative spring", poly({1.0, -1.0}), poly({1.0, 0.0}), no, -kInfinity},
      {"negative mass", poly({-1.0, 1.0}), poly({1.0}), no, -kInfinity},
      {"negative resonance", poly({-1.0, 0.0}), poly({1.0, 0.0, 1.0}), no, -kInfinity},
      {"residue not real", poly({1.0}), poly({1.0, 0.0, 1.0}), no, -kInfinity},
      {"double pole at 0", poly({1.0}), poly({1.0, 0.0, 0.0}), no, -kInfinity},
      {"double pole at infinity", poly({1.0, 0.0, 0.0}), poly({1.0}), no, -kInfinity},
      {"double resonance", poly({1.0, 0.0}), poly({1.0, 0.0, 2.0, 0.0, 1.0}), no, -kInfinity},
      {"pole in the right half-plane", poly({1.0}), poly({1.0, -1.0}), no, -kInfinity},
      {"unstable pair", poly({1.0, 1.0}), poly({1.0, -0.1, 4.0}), no, -kInfinity},
      {"negative gain", poly({-1.0}), poly({1.0}), no, -1.0},
      {"nothing", poly({0.0}), poly({1.0}), yes, 0.0},
      {"three Foster terms", poly({3.0, 0.0, 4.0, 0.0}), poly({1.0, 0.0, 3.0, 0.0, 2.0}), yes, 0.0},
  };
  for (const Case& c : cases) {
    for (const System& h : both(one_port(c.num, c.den))) {
      const PassivityIndices found = passivity_indices(h);
      EXPECT_EQ(found.answer, c.answer) << c.name << ": " << found.reason;
      if (std::isinf(c.input)) {
        EXPECT_EQ(found.input.value, c.input) << c.name;
      } else {
        EXPECT_NEAR(found.input.value, c.input, 1e-12) << c.name;
      }
      EXPECT_FALSE(found.reason.empty());
    }
  }
}

TEST(PositiveReal, ZerosInsideTouchAndAreLeftOpen) {
  // Re H = (1 - x)^2 / ...: zero at 1 rad/s, on either side of which any coefficient may push it.
  const PassivityIndices found =
      passivity_indices(one_port(poly({1.0, 0.0, 1.0}), poly({1.0, 1.0, 1.0})));
  EXPECT_EQ(found.answer, Answer::kUndecided);
  EXPECT_EQ(found.input.value, 0.0);
  EXPECT_NEAR(found.input.omega, 1.0, 1e-6);
}

TEST(PositiveReal, WhatCancelsIsNamed) {
  const PassivityIndices found =
      passivity_indices(one_port(poly({1.0, -1.0}), poly({1.0, 1.0, -2.0})));
  EXPECT_EQ(found.answer, Answer::kPassive);
  EXPECT_NE(found.notes.find("cancels"), std::string::npos);
  // A double resonance that a zero makes simple.
  for (const System& h :
       both(one_port(poly({1.0, 0.0, 1.0, 0.0}), poly({1.0, 0.0, 2.0, 0.0, 1.0})))) {
    EXPECT_EQ(passivity_indices(h).answer, Answer::kPassive);
  }
}

TEST(PositiveReal, DoesNotDependOnUnits) {
  for (const double scale : {1e-12, 1e-6, 1e6, 1e12}) {
    for (const double gain : {1e-12, 1e12}) {
      const System h =
          one_port(gain * poly({1.0 / scale, 3.1}), poly({1.0 / scale / scale, 3.0 / scale, 2.0}));
      const PassivityIndices found = passivity_indices(h);
      EXPECT_EQ(found.answer, Answer::kNotPassive) << scale << " " << gain << found.reason;
      EXPECT_NEAR(found.input.value / gain, -3.876493197e-4, 1e-12);
      EXPECT_NEAR(found.input.omega / scale, 11.24638, 1e-4);
      const System z = one_port(gain * poly({1.0 / scale, 0.2, scale}), poly({1.0, 0.0}));
      EXPECT_NEAR(passivity_indices(z).input.value / gain, 0.2, 1e-14);
      EXPECT_EQ(passivity_indices(z).answer, Answer::kPassive);
    }
  }
}

// Table 3.2 of Dyck 2013: with symmetric M and K the index is the smallest eigenvalue of sym B.
TEST(Ports, RelaxedArms) {
  for (int p = 1; p <= 6; ++p) {
    const Truth arm = participant(p);
    const Matrix m = 0.5 * (arm.m + arm.m.transpose());
    const Matrix k = 0.5 * (arm.k + arm.k.transpose());
    const double excess =
        Eigen::SelfAdjointEigenSolver<Matrix>(0.5 * (arm.b + arm.b.transpose())).eigenvalues()(0);
    for (const System& z : both(impedance(m, arm.b, k))) {
      const PassivityIndices found = passivity_indices(z);
      EXPECT_NEAR(found.input.value, excess, 1e-12 * arm.b.norm()) << p;
      EXPECT_EQ(found.answer, Answer::kPassive) << found.reason;
      EXPECT_EQ(found.output.value, 0.0);
      EXPECT_NEAR(found.relative.value, 1.0, 1e-12);
    }
    // A skew part of M or K needs unbounded energy at high or low frequency.
    EXPECT_EQ(passivity_indices(impedance(arm.m, arm.b, k)).input.value, -kInfinity);
    const PassivityIndices skew = passivity_indices(impedance(m, arm.b, arm.k));
    EXPECT_EQ(skew.answer, Answer::kNotPassive);
    EXPECT_EQ(skew.input.omega, 0.0);
    // The admittance has the impedance's input index as its output index.
    StateSpace y;
    y.a = Matrix::Zero(4, 4);
    y.a.topRightCorner(2, 2).setIdentity();
    y.a.bottomLeftCorner(2, 2) = -m.inverse() * k;
    y.a.bottomRightCorner(2, 2) = -m.inverse() * arm.b;
    y.b = Matrix::Zero(4, 2);
    y.b.bottomRows(2) = m.inverse();
    y.c = Matrix::Zero(2, 4);
    y.c.rightCols(2).setIdentity();
    y.d = Matrix::Zero(2, 2);
    const PassivityIndices turned = passivity_indices(System(y));
    EXPECT_NEAR(turned.output.value, excess, 1e-10 * arm.b.norm());
    EXPECT_EQ(turned.answer, Answer::kPassive) << turned.reason;
  }
}

TEST(Ports, AlongADirection) {
  const Truth arm = participant(1);
  const Matrix m = 0.5 * (arm.m + arm.m.transpose());
  const Matrix k = 0.5 * (arm.k + arm.k.transpose());
  const System z = impedance(m, arm.b, k);
  for (const double angle : {0.0, 0.4, 1.2, 2.9}) {
    IndexOptions options;
    options.direction = 3.0 * poly({std::cos(angle), std::sin(angle)});
    const Vector d = options.direction / 3.0;
    EXPECT_NEAR(passivity_indices(z, options).input.value, d.dot(arm.b * d), 1e-12);
    EXPECT_NEAR(passivity_indices(as_state_space(z), options).input.value, d.dot(arm.b * d), 1e-11);
  }
  // Output index along a line: d' H^-1 d, not the inverse of d' H d.
  const Matrix gain{{2.0, 1.0}, {1.0, 3.0}};
  const System h(StateSpace{Matrix(0, 0), Matrix(0, 2), Matrix(2, 0), gain, Matrix()});
  IndexOptions options;
  options.direction = poly({1.0, 0.0});
  const PassivityIndices found = passivity_indices(h, options);
  EXPECT_NEAR(found.output.value, gain.inverse()(0, 0), 1e-15);
  EXPECT_NEAR(found.input.value, 2.0, 1e-15);
  EXPECT_NEAR(found.relative.value, 1.0 / 3.0, 1e-15);
}

TEST(Ports, PartlyLossless) {
  const Vector one = poly({1.0});
  const Vector zero = poly({0.0});
  const System h(TransferMatrix{2,
                                2,
                                {one, zero, zero, poly({1.0, 0.0})},
                                {poly({1.0, 1.0}), one, one, poly({1.0, 0.0, 1.0})}});
  EXPECT_EQ(passivity_indices(h).answer, Answer::kPassive);
  // Rank one: the smallest eigenvalue is zero and rounding decides its sign.
  const System ones(TransferMatrix{2, 2, {one, one, one, one}, {one, one, one, one}});
  const PassivityIndices found = passivity_indices(ones);
  EXPECT_EQ(found.answer, Answer::kUndecided);
  EXPECT_TRUE(std::isnan(found.output.value));
  EXPECT_NE(found.notes.find("singular"), std::string::npos);
}

TEST(Bands, SpeakOfTheResponseOnly) {
  const System h = one_port(poly({1.0, 3.1}), poly({1.0, 3.0, 2.0}));
  IndexOptions low;
  low.band = Band{0.0, 5.0};
  const PassivityIndices found = passivity_indices(h, low);
  EXPECT_EQ(found.answer, Answer::kPassive);
  EXPECT_EQ(found.input.omega, 5.0);
  EXPECT_NEAR(found.input.value, (6.2 - 2.5) / (625.0 + 125.0 + 4.0), 1e-15);
  IndexOptions high;
  high.band = Band{10.0, kInfinity};
  EXPECT_EQ(passivity_indices(h, high).answer, Answer::kNotPassive);
  // An unstable pole does not matter to a band, a negative real part does.
  EXPECT_NEAR(passivity_indices(one_port(poly({1.0}), poly({1.0, -1.0})), low).input.value, -1.0,
              1e-14);
  // 1/s^2 has the real part -1/w^2: unbounded only where the band holds 0.
  const System twice = one_port(poly({1.0}), poly({1.0, 0.0, 0.0}));
  EXPECT_EQ(passivity_indices(twice, low).input.value, -kInfinity);
  low.band = Band{0.5, 5.0};
  EXPECT_NEAR(passivity_indices(twice, low).input.value, -4.0, 1e-14);
  const System negative = one_port(poly({-1.0}), poly({1.0, 0.0, 0.0}));
  low.band = Band{0.0, 5.0};
  EXPECT_NEAR(passivity_indices(negative, low).input.value, 0.04, 1e-15);
}

TEST(BadOptions, AreRefused) {
  const System h = one_port(poly({1.0}), poly({1.0, 1.0}));
  const auto refused = [&](const IndexOptions& options) {
    EXPECT_THROW(passivity_indices(h, options), Error);
  };
  IndexOptions o;
  o.tolerance = -1.0;
  refused(o);
  o = {};
  o.tolerance = std::nan("");
  refused(o);
  o = {};
  o.direction = poly({1.0, 2.0});
  refused(o);
  o.direction = poly({0.0});
  refused(o);
  o.direction = poly({std::nan("")});
  refused(o);
  for (const Band band : {Band{2.0, 1.0}, Band{-1.0, 1.0}, Band{kInfinity, kInfinity},
                          Band{std::nan(""), 1.0}, Band{1.0, 1.0}}) {
    o = {};
    o.band = band;
    refused(o);
  }
  const System wide(TransferMatrix{1, 2, {poly({1.0}), poly({1.0})}, {poly({1.0}), poly({1.0})}});
  EXPECT_THROW(passivity_indices(wide), Error);
  EXPECT_THROW(index_curves(h, poly({-1.0})), Error);
}

TEST(Curves, AreTheIndicesOverFrequency) {
  const System h = one_port(poly({2.0, 14.0, 20.0}), poly({1.0, 4.0, 10.0}));
  const Matrix curves = index_curves(h, poly({0.0, 1.0, kInfinity}));
  const Complex at = h(Complex(0.0, 1.0))(0, 0);
  EXPECT_NEAR(curves(1, 0), at.real(), 1e-14);
  EXPECT_NEAR(curves(1, 1), (1.0 / at).real(), 1e-14);
  EXPECT_NEAR(curves(1, 2), std::abs((1.0 - at) / (1.0 + at)), 1e-14);
  EXPECT_NEAR(curves(2, 0), 2.0, 1e-13);
}

// Random systems --------------------------------------------------------------------------------

double least(const Eigen::MatrixXcd& h) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXcd>(0.5 * (h + h.adjoint())).eigenvalues()(0);
}

struct Sweep {
  double input = kInfinity, output = kInfinity, relative = 0.0;
  double size = 0.0;  // of the response where the input index is smallest
};

// Ten decades, evaluated from the coefficients alone.
Sweep sweep(const System& h, int points) {
  Sweep out;
  const Index p = h.inputs();
  const Eigen::MatrixXcd one = Eigen::MatrixXcd::Identity(p, p);
  for (int i = 0; i < points; ++i) {
    const double w = h.scale() * std::pow(10.0, -5.0 + 10.0 * i / (points - 1));
    const Eigen::MatrixXcd at = h(Complex(0.0, w));
    const double value = least(at);
    if (value < out.input) {
      out.input = value;
      out.size = at.norm();
    }
    out.output = std::min(out.output, least(at.inverse()));
    const Eigen::MatrixXcd s = (one - at) * (one + at).inverse();
    out.relative = std::max(out.relative, s.jacobiSvd().singularValues()(0));
  }
  return out;
}

void compare(std::uint64_t stream, int points) {
  const System h = random_system(stream);
  const PassivityIndices found = passivity_indices(h);
  const Sweep seen = sweep(h, points);
  // The indices bound every sample; the samples carry rounding of the evaluation, 1e-7 of it at the
  // ends of the sweep.
  EXPECT_LE(found.input.value, seen.input + 1e-7 * (std::abs(seen.input) + 1e-3 * seen.size))
      << stream;
  EXPECT_LE(found.output.value, seen.output + 1e-7 * std::abs(seen.output) + 1e-9) << stream;
  EXPECT_GE(found.relative.value, seen.relative * (1.0 - 1e-7)) << stream;
  // And they are met where they say.
  if (std::isfinite(found.input.value) && found.input.omega > 0.0 &&
      std::isfinite(found.input.omega)) {
    const Eigen::MatrixXcd at = h(Complex(0.0, found.input.omega));
    EXPECT_NEAR(least(at), found.input.value,
                1e-6 * (std::abs(found.input.value) + 1e-3 * at.norm()))
        << stream;
  }
  bool stable = true;
  for (const Complex p : h.poles()) stable = stable && p.real() <= 0.0;
  const double clear = 1e-6 * seen.size;  // where the sweep decides
  if (stable && seen.input < -clear) {
    EXPECT_EQ(found.answer, Answer::kNotPassive) << stream << found.reason;
  }
  if (!stable && found.answer == Answer::kPassive) {
    EXPECT_FALSE(found.notes.empty()) << stream;
  }
  const bool at_a_pole = std::isinf(found.input.value) || std::isinf(found.input.omega);
  if (stable && seen.input > clear && !at_a_pole) {
    EXPECT_EQ(found.answer, Answer::kPassive) << stream << found.reason;
  }
}

TEST(RandomSystems, AgreeWithADenseSweep) {
  for (std::uint64_t stream = 0; stream < 400; ++stream) compare(stream, 500);
}

}  // namespace
}  // namespace ulna
