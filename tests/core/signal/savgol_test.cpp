// Reference values of the specification, derived there in extended precision.
#include "signal/savgol.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

Vector noise(Index rows, std::uint64_t seed) {
  Random random(seed);
  Vector y(rows);
  for (double& x : y) x = random.normal();
  return y;
}

// The reference gives 11 to 13 digits: half a unit of the last one.
TEST(Savgol, KernelsOfTheReference) {
  Matrix k = savgol_kernels({101, 6}, 2, 1.0);
  EXPECT_NEAR(k(50, 0), 0.047419682296, 5e-13);
  EXPECT_NEAR(k.col(0).squaredNorm(), 0.047419682296, 5e-13);
  EXPECT_NEAR(k.col(1).squaredNorm(), 2.2334857615e-4, 5e-15);
  EXPECT_NEAR(k(50, 2), -3.352535494957e-4, 5e-17);
  k = savgol_kernels({151, 6}, 2, 1.0);
  EXPECT_NEAR(k(75, 0), 0.031702298138, 5e-13);
  EXPECT_NEAR(k.col(1).squaredNorm(), 6.6768039558e-5, 5e-16);
  EXPECT_NEAR(k(75, 2), -1.001828536120e-4, 5e-17);
}

TEST(Savgol, KernelOfFivePoints) {
  const Matrix k = savgol_kernels({5, 2}, 2, 1.0);
  const double value[] = {-3, 12, 17, 12, -3};
  const double first[] = {-2, -1, 0, 1, 2};
  const double second[] = {2, -1, -2, -1, 2};
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(k(i, 0), value[i] / 35, 1e-16);
    EXPECT_NEAR(k(i, 1), first[i] / 10, 1e-16);
    EXPECT_NEAR(k(i, 2), second[i] / 7, 1e-16);
  }
}

TEST(Savgol, ParityIsExact) {
  const Matrix k = savgol_kernels({31, 5}, 3, 250.0);
  for (Index i = 0; i < 31; ++i) {
    for (Index d = 0; d < 4; ++d) {
      EXPECT_EQ(k(i, d), (d % 2 == 0 ? 1.0 : -1.0) * k(30 - i, d));
    }
  }
}

TEST(Savgol, CutoffOfTheReference) {
  EXPECT_NEAR(savgol_cutoff({101, 6}), 0.04605, 5e-6);
  EXPECT_NEAR(savgol_cutoff({151, 6}), 0.03079, 5e-6);
  EXPECT_EQ(savgol_cutoff({5, 4}), 1.0);  // passes everything
}

// The vector loop, its tail, and the padded short case against the plain sum.
TEST(Savgol, EveryLengthIsThePlainSum) {
  const SavgolSpec spec{11, 3};
  const Matrix k = savgol_kernels(spec, 3, 2.0);
  for (Index rows = 11; rows < 40; ++rows) {
    const Vector y = noise(rows, static_cast<std::uint64_t>(rows));
    Matrix out(rows, 4);
    savgol_apply(spec, 2.0, y, 3, out);
    for (Index i = 5; i + 5 < rows; ++i) {
      // Another order of summation: a few roundings of 11 terms.
      for (Index d = 0; d < 4; ++d)
        EXPECT_NEAR(out(i, d), k.col(d).dot(y.segment(i - 5, 11)), 1e-13);
    }
  }
}

TEST(Savgol, SharedAndSingleLoopsGiveTheSameBits) {
  const Vector y = noise(500, 7);
  Matrix three(500, 3), one(500, 1), two(500, 2);
  savgol_apply({31, 4}, 100.0, y, 2, three);
  savgol_apply({31, 4}, 100.0, y, 0, one);
  savgol_apply({31, 4}, 100.0, y, 1, two);
  EXPECT_EQ((three.col(0) - one.col(0)).cwiseAbs().maxCoeff(), 0.0);
  EXPECT_EQ((three.leftCols(2) - two).cwiseAbs().maxCoeff(), 0.0);
}

TEST(Savgol, ExactOnPolynomialsUpToTheEnds) {
  const double rate = 100.0;
  Vector y(151);
  Matrix exact(151, 3);
  for (Index i = 0; i < 151; ++i) {
    const double t = static_cast<double>(i - 75) / rate;
    y(i) = 1 + t * (2 + t * (-3 + t * (4 + t * (1 + t * (-2 + t * 0.5)))));
    exact(i, 0) = y(i);
    exact(i, 1) = 2 + t * (-6 + t * (12 + t * (4 + t * (-10 + t * 3))));
    exact(i, 2) = -6 + t * (24 + t * (12 + t * (-40 + t * 15)));
  }
  Matrix out(151, 3);
  savgol_apply({101, 6}, rate, y, 2, out);
  // Rounding of y times the end polynomial's noise gain: 1, 30/s and 1000/s^2.
  EXPECT_LT((out - exact).col(0).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT((out - exact).col(1).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_LT((out - exact).col(2).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Savgol, HighOrdersStayOrthonormal) {
  // A window that the polynomial passes through reproduces every sample.
  const Vector y = noise(31, 3);
  Matrix out(31, 1);
  savgol_apply({31, 30}, 1.0, y, 0, out);
  EXPECT_LT((out.col(0) - y).cwiseAbs().maxCoeff(), 1e-12);
}

template <class Call>
void expect_error(Call call, Fault fault, const std::string& argument,
                  const std::string& detail = {}) {
  try {
    call();
    ADD_FAILURE() << "nothing was thrown for " << argument;
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), fault) << error.what();
    EXPECT_EQ(error.argument(), argument) << error.what();
    EXPECT_EQ(error.detail(), detail) << error.what();
  }
}

TEST(Savgol, Refusals) {
  expect_error([] { savgol_kernels({100, 6}, 0, 1.0); }, Fault::kArgument, "window");
  expect_error([] { savgol_kernels({-1, 0}, 0, 1.0); }, Fault::kArgument, "window");
  expect_error([] { savgol_kernels({7, 7}, 0, 1.0); }, Fault::kArgument, "order");
  expect_error([] { savgol_kernels({101, 31}, 0, 1.0); }, Fault::kArgument, "order");
  expect_error([] { savgol_kernels({101, 6}, 7, 1.0); }, Fault::kArgument, "derivative");
  expect_error([] { savgol_kernels({101, 6}, 0, std::nan("")); }, Fault::kArgument, "rate_hz");
  Vector y = Vector::Zero(120);
  Matrix out(120, 1);
  expect_error(
      [&] {
        savgol_apply({101, 6}, 1.0, y.head(100), 0, out.topRows(100));
      },
      Fault::kData, "y");
  y(17) = std::numeric_limits<double>::infinity();
  expect_error(
      [&] {
        savgol_apply({101, 6}, 1.0, y, 0, out);
      },
      Fault::kData, "y", "row 17, channel 0");
}

}  // namespace
}  // namespace ulna
