// What a delay allows: closed forms, and Llewellyn's criterion evaluated on the two-port itself.
#include "passivity/teleoperation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "base/error.hpp"
#include "systems.hpp"

namespace ulna {
namespace {

// Smallest margin of the hybrid matrix over frequency, relative to its terms; masses as given.
double least_margin(const PositionForce& p, double excess, double delay, double gain, double mass) {
  double least = kInfinity;
  for (int i = 0; i < 40000; ++i) {
    const double w = std::pow(10.0, -3.0 + 7.0 * i / 40000.0) / std::max(delay, 1e-3);
    const Complex s(0.0, w);
    const Complex zs = mass * s + p.slave_damping;
    const Complex c = p.coupling_damping + p.coupling_stiffness / s;
    const Complex q = c / (zs + c);
    const Complex back = std::exp(-2.0 * s * delay);
    const Complex h11 = 0.7 * mass * s + p.master_damping + gain * back * q * zs;
    const Complex k = -gain * back * q * q;
    const double r1 = h11.real() + excess;
    const double r2 = (1.0 / (zs + c)).real();
    const double terms = std::abs(2.0 * r1 * r2) + 2.0 * std::abs(k);
    least = std::min(least, (2.0 * r1 * r2 - k.real() - std::abs(k)) / terms);
    least = std::min(least, r1 / (std::abs(h11) + std::abs(excess)));
  }
  return least;
}

TEST(Gain, IsWhereLlewellynsMarginVanishes) {
  const PositionForce loops[] = {{2.0, 1.0, 30.0, 200.0},
                                 {5.0, 0.0, 10.0, 1000.0},
                                 {1.0, 8.0, 4.0, 30.0},
                                 {3.0, 2.0, 15.0, 0.0}};
  for (const PositionForce& p : loops) {
    for (const double delay : {0.002, 0.03, 0.2}) {
      for (const double excess : {0.0, 4.0, -0.5}) {
        const double gain = allowed_gain(p, excess, poly({delay}))(0);
        ASSERT_GT(gain, 0.0);
        // Just below it holds, just above it fails, whatever the masses.
        for (const double mass : {0.3, 6.0}) {
          EXPECT_GT(least_margin(p, excess, delay, 0.999 * gain, mass), -1e-12);
          EXPECT_LT(least_margin(p, excess, delay, 1.02 * gain, mass), 0.0);
        }
      }
    }
  }
}

TEST(Gain, ClosedForms) {
  // Without coupling stiffness the worst phase is pi: b / k_v.
  const PositionForce soft{2.0, 1.0, 20.0, 0.0};
  EXPECT_NEAR(allowed_gain(soft, 4.0, poly({0.1}))(0), 6.0 / 20.0, 1e-12);
  // Without slave damping and with much stiffness the worst is at 0: (b k_v) / (k_p T)^2.
  const PositionForce stiff{2.0, 0.0, 5.0, 5000.0};
  EXPECT_NEAR(allowed_gain(stiff, 0.0, poly({0.1}))(0), 2.0 * 5.0 / (500.0 * 500.0), 1e-15);
  // The arm's excess adds to the master's damping, no more and no less.
  const Vector delays = poly({0.001, 0.01, 0.1});
  const PositionForce p{2.0, 1.0, 30.0, 200.0};
  EXPECT_LT((allowed_gain(p, 4.0, delays) - 3.0 * allowed_gain(p, 0.0, delays)).norm(), 1e-12);
  EXPECT_EQ(allowed_gain(p, 0.0, poly({0.0}))(0), kInfinity);
  EXPECT_EQ(allowed_gain(p, -2.5, poly({0.01}))(0), 0.0);
}

TEST(Stiffness, ClosedForms) {
  // Colgate and Schenkel with T as half a period: K = b / T.
  EXPECT_NEAR(allowed_stiffness(2.0, 0.0, 3.0, poly({0.01}))(0), 500.0, 1e-9);
  EXPECT_EQ(allowed_stiffness(2.0, 0.0, 0.0, poly({0.0}))(0), kInfinity);
  EXPECT_EQ(allowed_stiffness(2.0, 3.0, 0.0, poly({0.01}))(0), 0.0);
  EXPECT_EQ(allowed_stiffness(2.0, 0.0, -3.0, poly({0.01}))(0), 0.0);
}

TEST(Stiffness, WithWallDampingAgainstASweep) {
  for (const double wall : {0.2, 1.0, 2.0, 4.9}) {
    const double damping = 5.0;
    const double delay = 0.02;
    const double k = allowed_stiffness(2.0, wall, 3.0, poly({delay}))(0);
    double seen = kInfinity;
    for (int i = 1; i < 200000; ++i) {
      const double x = 30.0 * i / 200000.0;
      if (std::sin(x) <= 0.0) continue;
      seen = std::min(seen, (damping + wall * std::cos(x)) * x / (delay * std::sin(x)));
    }
    EXPECT_LE(k, seen * (1.0 + 1e-9));
    EXPECT_NEAR(k, seen, 1e-5 * seen);  // the sweep's step squared
  }
}

TEST(BadInput, IsRefused) {
  const PositionForce good{2.0, 1.0, 30.0, 200.0};
  const Vector delay = poly({0.01});
  const double nan = std::nan("");
  EXPECT_THROW(allowed_gain({-1.0, 1.0, 30.0, 200.0}, 0.0, delay), Error);
  EXPECT_THROW(allowed_gain({2.0, nan, 30.0, 200.0}, 0.0, delay), Error);
  EXPECT_THROW(allowed_gain({2.0, 1.0, 0.0, 200.0}, 0.0, delay), Error);
  EXPECT_THROW(allowed_gain({2.0, 1.0, 30.0, -1.0}, 0.0, delay), Error);
  EXPECT_THROW(allowed_gain(good, nan, delay), Error);
  EXPECT_THROW(allowed_gain(good, 0.0, poly({-0.01})), Error);
  EXPECT_THROW(allowed_gain(good, 0.0, poly({kInfinity})), Error);
  EXPECT_THROW(allowed_stiffness(-1.0, 0.0, 0.0, delay), Error);
  EXPECT_THROW(allowed_stiffness(1.0, nan, 0.0, delay), Error);
  EXPECT_THROW(allowed_stiffness(1.0, 0.0, kInfinity, delay), Error);
}

}  // namespace
}  // namespace ulna
