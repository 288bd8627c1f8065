// Spring arrays against their closed forms and against independent searches.
#include "plant/spring_array.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "base/error.hpp"
#include "base/random.hpp"
#include "plant/spring_design.hpp"

namespace ulna {
namespace {

std::vector<double> eight(double value) { return std::vector<double>(8, value); }

// A random array that the frame can hold; some places stay empty.
SpringArray drawn(Random& random) {
  std::vector<double> rates = eight(0.0);
  std::vector<double> rests = eight(0.09);
  for (std::size_t i = 0; i < 8; ++i) {
    if (random.uniform() < 0.7) rates[i] = 30.0 + 300.0 * random.uniform();
    rests[i] = 0.05 + 0.15 * random.uniform();
  }
  rates[1] = 50.0;  // never along one line
  rates[3] = 60.0;
  rates[5] = 70.0;
  return SpringArray::on_frame(rates, rests);
}

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

bool has(const std::string& text, const std::string& word) {
  return text.find(word) != std::string::npos;
}

TEST(SpringArray, ReferenceValuesOfTheThesisFrame) {
  // reference-values.md, printed with nine figures.
  SpringEquilibrium at = SpringArray::on_frame(eight(80.0), eight(0.09)).equilibrium();
  EXPECT_NEAR(at.position.norm(), 0.0, 1e-15);
  EXPECT_NEAR(at.stiffness(0, 0), 501.900681, 5e-7);
  EXPECT_NEAR(at.stiffness(1, 1), 503.384339, 5e-7);
  EXPECT_NEAR(at.stiffness(0, 1), 0.0, 1e-10);
  at = SpringArray::on_frame({0, 200, 0, 90, 0, 200, 0, 90}, eight(0.10)).equilibrium();
  EXPECT_NEAR(at.stiffness(0, 0), 481.639344, 5e-7);
  EXPECT_NEAR(at.stiffness(1, 1), 351.428571, 5e-7);
}

TEST(SpringArray, FourSpringsInClosedForm) {
  // Mid-sides only: along an axis two springs stretch, two turn; K = 2 k + 2 k' (1 - l'/L').
  const double l = 0.11;
  const SpringEquilibrium at =
      SpringArray::on_frame({0, 150, 0, 40, 0, 150, 0, 40}, eight(l)).equilibrium();
  EXPECT_NEAR(at.stiffness(0, 0), 2 * 150.0 + 2 * 40.0 * (1.0 - l / 0.183), 1e-9);
  EXPECT_NEAR(at.stiffness(1, 1), 2 * 40.0 + 2 * 150.0 * (1.0 - l / 0.175), 1e-9);
  EXPECT_NEAR(at.slack_radius, 0.175 - l, 1e-15);
}

TEST(SpringArray, ForceIsMinusTheGradientOfTheEnergyAndStiffnessOfTheForce) {
  Random random(3);
  for (int trial = 0; trial < 200; ++trial) {
    const SpringArray array = drawn(random);
    const Vector2 r(0.1 * (random.uniform() - 0.5), 0.1 * (random.uniform() - 0.5));
    const double h = 1e-6;
    for (Index j = 0; j < 2; ++j) {
      const Vector2 d = h * Vector2::Unit(j);
      const double slope = (array.energy(r + d) - array.energy(r - d)) / (2.0 * h);
      // Central differences of a smooth function: h^2, and 1e-16 / h of rounding.
      EXPECT_NEAR(array.force(r)[j], -slope, 1e-6);
      const Vector2 column = -(array.force(r + d) - array.force(r - d)) / (2.0 * h);
      EXPECT_NEAR((array.stiffness(r).col(j) - column).norm(), 0.0, 1e-3);
    }
  }
}

TEST(SpringArray, EquilibriumIsTheMinimumOfTheEnergyFromAnyStart) {
  Random random(4);
  for (int trial = 0; trial < 100; ++trial) {
    const SpringArray array = drawn(random);
    SpringEquilibrium at;
    if (!array.find_equilibrium(at)) continue;
    EXPECT_LT(at.residual_n, 1e-10);
    // Convex: nothing anywhere is lower.
    for (int k = 0; k < 50; ++k) {
      const Vector2 r(random.uniform() - 0.5, random.uniform() - 0.5);
      EXPECT_GE(array.energy(r), array.energy(at.position));
    }
  }
}

TEST(SpringArray, SlackSpringsPullNothingAndAreNamed) {
  // k3 is longer than its way to the handle.
  const SpringArray array =
      SpringArray::on_frame({0, 100, 100, 100, 0, 100, 0, 100}, {.1, .1, .4, .1, .1, .1, .1, .1});
  const SpringEquilibrium at = array.equilibrium();
  EXPECT_EQ(at.slack, (std::vector<bool>{false, true, false, false, false}));
  const SpringEquilibrium without =
      SpringArray::on_frame({0, 100, 0, 100, 0, 100, 0, 100}, eight(0.1)).equilibrium();
  EXPECT_NEAR((at.stiffness - without.stiffness).norm(), 0.0, 1e-9);
}

TEST(SpringArray, LinearityIsWhatADenseGridFinds) {
  const SpringArray array = SpringArray::on_frame({0, 200, 0, 90, 0, 200, 0, 90}, eight(0.10));
  const SpringEquilibrium at = array.equilibrium();
  const Linearity found = array.linearity(at, 0.03);
  double deviation = 0.0;
  for (int i = -300; i <= 300; ++i) {
    for (int j = -300; j <= 300; ++j) {
      const Vector2 d(i * 1e-4, j * 1e-4);
      if (d.norm() > 0.03) continue;
      deviation = std::max(deviation, (array.force(at.position + d) + at.stiffness * d).norm());
    }
  }
  EXPECT_GE(found.deviation_n, deviation * (1.0 - 1e-9));
  // The grid misses the edge of the circle by up to 0.1 mm of 30, the deviation grows with d^3.
  EXPECT_LT(found.deviation_n, deviation * 1.02);
  const double radius = array.linear_radius(at, 0.05);
  EXPECT_NEAR(array.linearity(at, radius).share, 0.05, 1e-6);
}

TEST(SpringArray, RefusesWhatIsNoArray) {
  EXPECT_TRUE(has(message_of([] { SpringArray({}); }), "1 to 8 springs"));
  EXPECT_TRUE(has(message_of([] { SpringArray({{{0, 1}, -3.0, 0.1}}); }), "spring 1 has a rate"));
  EXPECT_TRUE(has(message_of([] { SpringArray({{{0, 1}, 3.0, 0.0}}); }), "rest length of 0"));
  EXPECT_TRUE(has(message_of([] { SpringArray({{{0, NAN}, 3.0, 0.1}}); }), "anchor finite"));
  EXPECT_TRUE(has(message_of([] {
                    SpringArray::on_frame({0, 200, 0, 0, 0, 200, 0, 0}, eight(0.3)).equilibrium();
                  }),
                  "do not hold the handle"));
  EXPECT_TRUE(has(message_of([] {
                    SpringArray::on_frame({1, 2, 3}, eight(0.1));
                  }),
                  "eight places"));
}

TEST(SpringDesign, WantedStiffnessThatSpringsCanGiveIsGiven) {
  // Built forward from rates with equilibrium at the centre, so that an exact answer exists.
  const SpringArray made = SpringArray::on_frame({60, 100, 20, 80, 60, 100, 20, 80}, eight(0.09));
  const SpringEquilibrium at = made.equilibrium();
  const SpringDesign design = design_springs(at.stiffness, {});
  EXPECT_LT(design.error, 1e-9);
  EXPECT_NEAR(design.achieved.position.norm(), 0.0, 1e-12);
  EXPECT_TRUE(design.taut);
  EXPECT_TRUE(design.central);
  for (const double rate : design.rates) EXPECT_GE(rate, 0.0);
}

TEST(SpringDesign, ContinuousRatesBeatEveryRandomChoice) {
  Matrix2 wanted;
  wanted << 443.86, 16.74, 16.74, 232.34;  // configuration 1 of Table 3.1
  const SpringDesign design = design_springs(wanted, {});
  Random random(5);
  double best = 1.0;
  for (int trial = 0; trial < 20000; ++trial) {
    // Opposite springs alike: the handle stays at the centre, as in the design.
    std::vector<double> rates = eight(0.0);
    for (std::size_t i = 0; i < 4; ++i) rates[i] = rates[i + 4] = 250.0 * random.uniform();
    const Matrix2 k = SpringArray::on_frame(rates, eight(0.09)).stiffness(Vector2::Zero());
    best = std::min(best, (k - wanted).norm() / wanted.norm());
  }
  EXPECT_LE(design.error, best);
}

TEST(SpringDesign, RespectsTheLargestRateAndTheOffset) {
  SpringDesignOptions options;
  options.max_rate = 120.0;
  Matrix2 wanted;
  wanted << 400, 0, 0, 350;
  SpringDesign design = design_springs(wanted, options);
  for (const double rate : design.rates) EXPECT_LE(rate, 120.0 * (1.0 + 1e-12));
  options.max_rate = 0.0;
  options.offset = {0.01, -0.015};
  design = design_springs(wanted, options);
  EXPECT_NEAR((design.achieved.position - options.offset).norm(), 0.0, 1e-9);
}

TEST(SpringDesign, TheDrawerIsSearchedThrough) {
  // Against a loop of the test's own over every arrangement.
  Matrix2 wanted;
  wanted << 440, 20, 20, 280;
  SpringDesignOptions options;
  options.kinds = {{80.0, 0.09, 0}, {200.0, 0.10, 2}};
  const SpringDesign design = design_springs(wanted, options);
  EXPECT_TRUE(design.exhaustive);
  EXPECT_EQ(design.evaluations, 6561);
  double best = 10.0;
  for (int code = 0; code < 6561; ++code) {
    std::vector<double> rates = eight(0.0);
    std::vector<double> rests = eight(0.09);
    int used = 0;
    for (std::size_t i = 0, rest = static_cast<std::size_t>(code); i < 8; ++i, rest /= 3) {
      const std::size_t kind = rest % 3;
      if (kind == 1) rates[i] = 80.0;
      if (kind == 2) rates[i] = 200.0, rests[i] = 0.10, ++used;
    }
    if (used > 2 || code == 0) continue;
    SpringEquilibrium at;
    if (!SpringArray::on_frame(rates, rests).find_equilibrium(at)) continue;
    if (at.slack_radius < 0.025 || std::abs(at.position[0]) > 0.175 / 3 ||
        std::abs(at.position[1]) > 0.183 / 3) {
      continue;
    }
    bool slack = false;
    for (const bool loose : at.slack) slack = slack || loose;
    if (!slack) best = std::min(best, (at.stiffness - wanted).norm() / wanted.norm());
  }
  EXPECT_NEAR(design.error, best, 1e-12);
}

TEST(SpringDesign, ALargeDrawerIsSearchedTheSameOnAnyNumberOfThreads) {
  Matrix2 wanted;
  wanted << 300, -40, -40, 340;
  SpringDesignOptions options;
  for (int i = 0; i < 6; ++i) options.kinds.push_back({40.0 + 30.0 * i, 0.08 + 0.005 * i, 2});
  options.threads = 1;
  const SpringDesign one = design_springs(wanted, options);
  options.threads = 3;
  const SpringDesign three = design_springs(wanted, options);
  EXPECT_FALSE(one.exhaustive);
  EXPECT_EQ(one.rates, three.rates);
  EXPECT_LT(one.error, 0.1);
}

TEST(SpringDesign, RefusesWhatSpringsCannotBe) {
  const auto refused = [](const Matrix2& wanted, const SpringDesignOptions& options = {}) {
    return message_of([&] { design_springs(wanted, options); });
  };
  Matrix2 skew;
  skew << 400, 50, -50, 300;
  EXPECT_TRUE(has(refused(skew), "must be symmetric"));
  Matrix2 saddle;
  saddle << 400, 0, 0, -10;
  EXPECT_TRUE(has(refused(saddle), "positive in every direction"));
  const Matrix2 good = 400.0 * Matrix2::Identity();
  SpringDesignOptions options;
  options.rest = 0.3;
  EXPECT_TRUE(has(refused(good, options), "fewer than three places"));
  options = {};
  options.kinds = {{80.0, -0.1, 0}};
  EXPECT_TRUE(has(refused(good, options), "spring 1 of the drawer"));
  options.kinds = {{80.0, 0.5, 1}};
  EXPECT_TRUE(has(refused(good, options), "no arrangement"));
  EXPECT_TRUE(has(message_of([] { stiffness_of_ellipse(1.0, 2.0, 0.0); }), "major >= minor"));
}

}  // namespace
}  // namespace ulna
