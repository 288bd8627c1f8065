// Band-limited signals with known values between the samples are the reference.
#include "signal/resample.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

constexpr double kRate = 1000.0;

// Sines up to 0.7 of the Nyquist frequency (350 Hz), amplitude about 1 in sum.
double truth(double t) {
  return 0.4 * std::sin(2 * kPi * 3.1 * t) + 0.25 * std::cos(2 * kPi * 61.0 * t + 0.3) +
         0.2 * std::sin(2 * kPi * 187.3 * t + 1.0) + 0.15 * std::sin(2 * kPi * 349.0 * t + 2.0);
}

struct Jittered {
  Vector times;
  Vector values;
};

// Stamps displaced independently by a uniform amount of the given rms (share of the step).
Jittered jittered(Index rows, double rms, std::uint64_t seed) {
  Random random(seed);
  Jittered j{Vector(rows), Vector(rows)};
  for (Index i = 0; i < rows; ++i) {
    const double shift = rms * std::sqrt(12.0) * (random.uniform() - 0.5);
    j.times(i) = (static_cast<double>(i) + shift) / kRate;
    if (i > 0) j.times(i) = std::max(j.times(i), j.times(i - 1) + 1e-6);
    j.values(i) = truth(j.times(i));
  }
  return j;
}

double worst_error(const Jittered& j, double rate_hz, Index skip) {
  const double t0 = j.times(0);
  const Index n = static_cast<Index>(std::floor((j.times(j.times.size() - 1) - t0) * rate_hz)) + 1;
  const Vector y = resample_uniform(j.times, j.values, t0, rate_hz, n);
  double worst = 0.0;
  for (Index k = skip; k + skip < n; ++k) {
    worst = std::max(worst, std::abs(y(k) - truth(t0 + static_cast<double>(k) / rate_hz)));
  }
  return worst;
}

// The kernels' ripple is 1e-7 of the signal; what it takes near the band's end is some times more.
TEST(Resample, UniformRecordOntoAShiftedGrid) {
  const Jittered j = jittered(3000, 0.0, 1);
  EXPECT_LT(worst_error(j, 777.0 * 2, 100), 1e-6);
  EXPECT_LT(worst_error(j, kRate, 100), 1e-6);
}

TEST(Resample, JitterOfFivePercentIsUndone) {
  EXPECT_LT(worst_error(jittered(3000, 0.05, 2), kRate, 100), 1e-6);
}

// Stamps up to two steps apart amplify the ripple.
TEST(Resample, JitterOfThirtyPercentIsUndone) {
  for (std::uint64_t seed = 3; seed < 8; ++seed) {
    EXPECT_LT(worst_error(jittered(3000, 0.3, seed), kRate, 100), 1e-4) << seed;
  }
}

TEST(Resample, ShortRecords) {
  for (Index rows = 2; rows < 12; ++rows) {
    const Vector times = Vector::LinSpaced(rows, 1.0, 2.0);
    const Vector y = resample_uniform(times, Vector::Constant(rows, 5.0), 1.0, 10.0, 11);
    // A constant comes out as one; the fit stops at 1e-7 or has nothing left to do.
    EXPECT_LT((y.array() - 5.0).abs().maxCoeff(), 1e-4) << rows;
  }
}

TEST(Resample, ALineSurvivesDecimationUpToTheEnds) {
  const Vector times = Vector::LinSpaced(5001, 0.0, 5.0);
  const Vector y = resample_uniform(times, 2.0 * times, 0.0, 50.0, 251);
  for (Index k = 0; k < 251; ++k) EXPECT_NEAR(y(k), 0.04 * static_cast<double>(k), 1e-5);
}

TEST(Clock, CountsGapsApartFromJitter) {
  Vector times = Vector::LinSpaced(101, 0.0, 1.0);
  times.tail(50).array() += 0.03;
  times(20) += 0.002;
  const Jitter j = check_clock(times);
  EXPECT_NEAR(j.median_step_s, 0.01, 1e-12);
  ASSERT_EQ(j.gaps, 1);
  EXPECT_EQ(j.gap_rows.front(), 50);
  EXPECT_NEAR(j.largest_gap_s, 0.04, 1e-12);
  EXPECT_NEAR(j.max_fraction, 0.2, 1e-9);
  EXPECT_NEAR(j.rms_fraction, 0.2 * std::sqrt(2.0 / 99.0), 1e-9);
}

template <class Call>
std::string detail_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kData) << error.what();
    return error.detail();
  }
  return "nothing was thrown";
}

TEST(Clock, RefusalsSayWhere) {
  Vector times = Vector::LinSpaced(100, 0.0, 0.99);
  const Vector y = Vector::Zero(100);
  Vector back = times, gap = times, broken = times;
  back(41) = back(40);
  gap.tail(50).array() += 0.05;
  broken(7) = std::nan("");
  EXPECT_EQ(detail_of([&] { check_clock(back); }), "row 41");
  EXPECT_EQ(detail_of([&] { check_clock(broken); }), "row 7");
  EXPECT_EQ(detail_of([&] { resample_uniform(gap, y, 0.0, 100.0, 10); }), "row 49");
  EXPECT_THROW(resample_uniform(times, y, 0.5, 100.0, 100), Error);
  EXPECT_THROW(resample_uniform(times, y.head(99), 0.0, 100.0, 10), Error);
}

}  // namespace
}  // namespace ulna
