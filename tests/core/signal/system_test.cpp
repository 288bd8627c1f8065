// Polynomials, realisations, zeros and joined systems, each against a second way to the same
// number.
#include "signal/system.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/random.hpp"
#include "signal/pencil.hpp"

namespace ulna {
namespace {

Vector poly(std::initializer_list<double> coefficients) {
  Vector out(static_cast<Index>(coefficients.size()));
  Index i = 0;
  for (const double c : coefficients) out(i++) = c;
  return out;
}

System one_port(const Vector& num, const Vector& den) {
  return System(TransferMatrix{1, 1, {num}, {den}});
}

// Largest difference of two responses, relative to their size, over four decades off the poles.
double difference(const System& x, const System& y, double scale = 1.0) {
  double worst = 0.0;
  for (int i = 0; i < 40; ++i) {
    const Complex s(0.0, scale * std::pow(10.0, -2.0 + 0.1 * i + 0.013));
    worst = std::max(worst, (x(s) - y(s)).norm() / std::max(x(s).norm(), 1e-300));
  }
  return worst;
}

TEST(Polynomial, RootsOverTwentyDecades) {
  // Moduli 1e-10 to 1e10: a companion matrix loses the small ones.
  Vector p = Vector::Ones(1);
  for (int k = -10; k <= 10; k += 2) p = polynomial_product(p, poly({1.0, std::pow(10.0, k)}));
  const std::vector<Complex> roots = all_roots(p);
  ASSERT_EQ(roots.size(), 11u);
  for (int i = 0; i < 11; ++i) {
    const Complex r = roots[static_cast<std::size_t>(i)];
    EXPECT_EQ(r.imag(), 0.0);
    // Well separated roots are exact to a few rounding errors of the coefficients.
    EXPECT_NEAR(r.real() / -std::pow(10.0, 2 * i - 10), 1.0, 1e-13);
  }
}

TEST(Polynomial, RootsOfRandomPolynomialsLeaveNoResidual) {
  Random random(5);
  for (int trial = 0; trial < 500; ++trial) {
    Vector p(2 + random.below(14));
    for (Index i = 0; i < p.size(); ++i) p(i) = random.normal() * std::exp(3.0 * random.normal());
    const std::vector<Complex> roots = all_roots(p);
    ASSERT_EQ(static_cast<Index>(roots.size()), p.size() - 1);
    for (const Complex r : roots) {
      double size = 0.0;
      for (Index i = 0; i < p.size(); ++i) {
        size = size * std::abs(r) + std::abs(p(i));
      }
      // Backward error of each root: rounding times the degree.
      EXPECT_LE(std::abs(polynomial_at(p, r)), 1e-14 * static_cast<double>(p.size()) * size);
      if (r.imag() == 0.0) continue;
      EXPECT_EQ(std::count(roots.begin(), roots.end(), std::conj(r)), 1);
    }
  }
}

TEST(Polynomial, MultipleRootsAreCentred) {
  const auto mean_of = [](const Vector& p, Complex near) {
    Complex sum = 0.0;
    double count = 0.0;
    for (const Complex r : all_roots(p)) {
      if (std::abs(r - near) > 1e-3 * std::abs(near)) continue;
      sum += r;
      count += 1.0;
    }
    return sum / count;
  };
  for (const double scale : {1e-9, 0.3, 1.0, 7.0, 1e9}) {
    // (s^2 + w^2)^2, alone and beside other roots; (s + w)^3.
    const Vector pair = poly({1.0, 0.0, scale * scale});
    Vector twice = polynomial_product(pair, pair);
    const Complex at(0.0, scale);
    // Of the roots themselves rounding leaves 1e-8; of their mean the rounding of p.
    EXPECT_NEAR(std::abs(mean_of(twice, at) / at - 1.0), 0.0, 1e-15);
    twice = polynomial_product(twice, poly({1.0, 3.0 * scale, 5.0 * scale * scale}));
    EXPECT_NEAR(std::abs(mean_of(twice, at) / at - 1.0), 0.0, 1e-14);
    const Vector one = poly({1.0, scale});
    const Vector thrice = polynomial_product(polynomial_product(one, one), one);
    EXPECT_NEAR(std::abs(mean_of(thrice, -scale) / -scale - 1.0), 0.0, 1e-14);
  }
  // Two that are only close stay as they are.
  const std::vector<Complex> close = all_roots(poly({1.0, 2.0 + 1e-6, 1.0 + 1e-6}));
  EXPECT_NEAR(close[0].real(), -1.0, 1e-9);
  EXPECT_NEAR(close[1].real() - close[0].real(), -1e-6, 2e-9);
}

TEST(Polynomial, DegenerateOnes) {
  EXPECT_TRUE(all_roots(poly({0.0})).empty());
  EXPECT_TRUE(all_roots(poly({0.0, 0.0, 3.0})).empty());
  const std::vector<Complex> roots = all_roots(poly({0.0, 2.0, 0.0, 0.0}));
  ASSERT_EQ(roots.size(), 2u);
  EXPECT_EQ(roots[0], Complex(0.0));
  EXPECT_EQ(all_roots(poly({1.0, -4.0, 6.0, -4.0, 1.0})).size(), 4u);  // (s - 1)^4
  EXPECT_DOUBLE_EQ(polynomial_scale(poly({2.0, 0.0, 8.0})), 2.0);
  EXPECT_EQ(polynomial_scale(poly({5.0})), 1.0);
}

TEST(Polynomial, Division) {
  Vector q, r;
  polynomial_divide(poly({1.0, 2.0, 3.0, 4.0}), poly({0.0, 1.0, 1.0}), q, r);
  EXPECT_EQ(q, poly({1.0, 1.0, 2.0}));
  EXPECT_EQ(trimmed(r), poly({2.0}));
}

TEST(Realisation, IsTheSameSystem) {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const Index p = 1 + random.below(3);
    const Index m = 1 + random.below(3);
    TransferMatrix h{p, m, {}, {}};
    const double scale = std::exp(4.0 * random.normal());
    for (Index k = 0; k < p * m; ++k) {
      Vector num(1 + random.below(5));
      Vector den(1 + random.below(4));
      for (Index i = 0; i < num.size(); ++i) {
        num(i) = random.normal() * std::pow(scale, i - num.size());
      }
      for (Index i = 0; i < den.size(); ++i) {
        den(i) = (1.0 + random.uniform()) * std::pow(scale, i - den.size());
      }
      h.num.push_back(num);
      h.den.push_back(den);
    }
    const System rational(h);
    // Rounding of the solve grows with the spread of the frequencies of a random system.
    EXPECT_LT(difference(rational, as_state_space(rational), scale), 1e-8) << trial;
  }
}

TEST(Realisation, SharesDenominators) {
  const Vector den = poly({1.0, 2.0, 5.0});
  const std::vector<Vector> num = {poly({1.0}), poly({2.0}), poly({3.0}), poly({4.0})};
  EXPECT_EQ(System(TransferMatrix{2, 2, num, {den, den, den, den}}).states(), 4);
  // Rows alike, columns not: the observable form has 2 + 1 states, the controllable one 6.
  const Vector other = poly({1.0, 7.0});
  EXPECT_EQ(System(TransferMatrix{2, 2, num, {den, den, other, other}}).states(), 3);
}

TEST(Realisation, ImproperPart) {
  const System z = one_port(poly({1.5, 6.0, 40.0}), poly({1.0, 0.0}));
  EXPECT_FALSE(z.is_proper());
  const System again = as_rational(as_state_space(z));
  EXPECT_LT(difference(z, again, 5.0), 1e-12);
  EXPECT_EQ(again.rational()->num[0].size(), 3);
  EXPECT_FALSE(as_state_space(z).is_proper());
}

TEST(Scale, IsThatOfTheRootsThatHaveOne) {
  // s / w + 0.2 + w / s: two zeros of modulus w, and a pole at 0 that says nothing.
  for (const double w : {1e-12, 3.0, 1e12}) {
    EXPECT_NEAR(one_port(poly({1.0 / w, 0.2, w}), poly({1.0, 0.0})).scale() / w, 1.0, 1e-12);
  }
  EXPECT_EQ(one_port(poly({1.0}), poly({1.0, 0.0, 0.0})).scale(), 1.0);
}

TEST(Zeros, OfAStateSpaceAreThoseOfTheNumerator) {
  const System h = one_port(poly({1.0, 2.0, 10.0}), poly({1.0, 6.0, 11.0, 6.0}));
  const std::vector<Complex> zeros = as_state_space(h).zeros();
  ASSERT_EQ(zeros.size(), 2u);
  for (const Complex z : zeros) EXPECT_NEAR(std::abs(z - Complex(-1.0, z.imag())), 0.0, 1e-12);
  EXPECT_NEAR(std::abs(zeros[0].imag()), 3.0, 1e-12);
}

TEST(Zeros, OfAMatrix) {
  // det = (s + 2) (s + 3) - 2 over (s + 1)^2: zeros at -1 and -4.
  const Vector den = poly({1.0, 1.0});
  const System h(TransferMatrix{
      2, 2, {poly({1.0, 2.0}), poly({1.0}), poly({2.0}), poly({1.0, 3.0})}, {den, den, den, den}});
  std::vector<Complex> zeros = h.zeros();
  ASSERT_EQ(zeros.size(), 2u);
  std::sort(zeros.begin(), zeros.end(), [](Complex x, Complex y) { return x.real() < y.real(); });
  EXPECT_NEAR(zeros[0].real(), -4.0, 1e-12);
  EXPECT_NEAR(zeros[1].real(), -1.0, 1e-7);  // cancels a pole, which a state space shows
}

TEST(Zeros, OfARelativeDegree) {
  const System h = as_state_space(one_port(poly({1.0}), poly({1.0, 3.0, 3.0, 1.0})));
  EXPECT_TRUE(h.zeros().empty());
  EXPECT_THROW(one_port(poly({0.0}), poly({1.0, 1.0})).zeros(), Error);
}

TEST(Pencil, BalancedAndDeflated) {
  const Matrix a{{1e-6, 1e9}, {-1e-9, 2e-6}};
  std::vector<Complex> found = eigenvalues(a);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0].real(), 1.5e-6, 1e-15);
  EXPECT_NEAR(std::abs(found[0].imag()), 1.0, 1e-12);
  // E of rank 1: one eigenvalue is infinite and left out.
  const auto finite =
      finite_eigenvalues(Matrix{{-2.0, 1.0}, {0.0, 1.0}}, Matrix{{1.0, 0.0}, {0.0, 0.0}});
  ASSERT_TRUE(finite);
  ASSERT_EQ(finite->size(), 1u);
  EXPECT_NEAR((*finite)[0].real(), -2.0, 1e-13);
  EXPECT_FALSE(finite_eigenvalues(Matrix{{1.0, 0.0}, {0.0, 0.0}}, Matrix{{1.0, 0.0}, {0.0, 0.0}}));
}

TEST(Joined, SumsProductsAndLoops) {
  const System x = one_port(poly({1.0, 2.0}), poly({1.0, 3.0, 7.0}));
  const System y = one_port(poly({4.0, 0.0}), poly({1.0, 5.0}));
  for (const bool spaces : {false, true}) {
    const System a = spaces ? as_state_space(x) : x;
    const System b = spaces ? as_state_space(y) : y;
    EXPECT_EQ(in_parallel(a, b).rational().has_value(), !spaces);
    for (const double w : {0.1, 1.0, 10.0}) {
      const Complex s(0.0, w);
      const Complex p = x(s)(0, 0);
      const Complex q = y(s)(0, 0);
      EXPECT_NEAR(std::abs(in_parallel(a, b)(s)(0, 0) - (p + q)), 0.0, 1e-13);
      EXPECT_NEAR(std::abs(in_series(a, b)(s)(0, 0) - p * q), 0.0, 1e-13);
      EXPECT_NEAR(std::abs(in_loop(a, b)(s)(0, 0) - p / (1.0 + p * q)), 0.0, 1e-13);
    }
  }
  // Two improper ones in a loop, which only a descriptor holds.
  const System z = one_port(poly({1.0, 1.0, 2.0}), poly({1.0, 0.0}));
  const System loop = in_loop(as_state_space(z), as_state_space(z));
  const Complex s(0.0, 1.7);
  EXPECT_NEAR(std::abs(loop(s)(0, 0) - z(s)(0, 0) / (1.0 + z(s)(0, 0) * z(s)(0, 0))), 0.0, 1e-12);
}

TEST(BadSystems, AreRefusedInWords) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(one_port(Vector(), poly({1.0})), Error);
  EXPECT_THROW(one_port(poly({1.0}), poly({0.0, 0.0})), Error);
  EXPECT_THROW(one_port(poly({nan}), poly({1.0})), Error);
  EXPECT_THROW(System(TransferMatrix{1, 2, {poly({1.0})}, {poly({1.0})}}), Error);
  const Matrix one = Matrix::Identity(1, 1);
  EXPECT_THROW(System(StateSpace{one, one, one, Matrix(), Matrix()}), Error);
  EXPECT_THROW(System(StateSpace{Matrix::Zero(2, 1), one, one, one, Matrix()}), Error);
  EXPECT_THROW(System(StateSpace{one, Matrix::Zero(2, 1), one, one, Matrix()}), Error);
  EXPECT_THROW(System(StateSpace{nan * one, one, one, one, Matrix()}), Error);
  EXPECT_THROW(System(StateSpace{0.0 * one, one, one, one, 0.0 * one}), Error);
  const System wide(TransferMatrix{1, 2, {poly({1.0}), poly({1.0})}, {poly({1.0}), poly({1.0})}});
  EXPECT_THROW(wide.zeros(), Error);
  EXPECT_THROW(in_parallel(wide, one_port(poly({1.0}), poly({1.0}))), Error);
  EXPECT_THROW(in_series(wide, wide), Error);
  EXPECT_THROW(in_loop(wide, wide), Error);
}

}  // namespace
}  // namespace ulna
