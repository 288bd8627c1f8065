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

TEST(Resample, UniformRecordOntoAShiftedGrid) {
  const Jittered j = jittered(3000, 0.0, 1);
  EXPECT_LT(worst_error(j, 777.0 * 2, 100), 1e-6);
  EXPECT_LT(worst_error(j, kRate, 100), 1e-6);
}

TEST(Resample, JitterOfFivePercentIsUndone) {
  EXPECT_LT(worst_error(jittered(3000, 0.05, 2), kRate, 64), 1e-6);
}

TEST(Resample, JitterOfThirtyPercentIsUndone) {
  const double e = worst_error(jittered(3000, 0.3, 3), kRate, 64);
  EXPECT_LT(e, 1e-5);
  RecordProperty("error", std::to_string(e));
  std::printf("30 %% jitter: %g\n", e);
}

}  // namespace
}  // namespace ulna
