// Butterworth design, zero-phase filtering and the response of the whole smoother.
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"
#include "signal/butterworth.hpp"
#include "signal/response.hpp"
#include "signal/zero_phase.hpp"

namespace ulna {
namespace {

constexpr double kRate = 1000.0;

// The reference lists sections of unit gain; here the gain is in the first one, as in SciPy.
TEST(Butterworth, SectionsOfTheReference) {
  const Matrix s = butterworth_lowpass(5, 5.0, kRate).sections;
  ASSERT_EQ(s.rows(), 3);
  const double b0 = 2.4434806283660238e-4 * 2.4060558696042955e-4 * 1.5466291403103405e-2;
  EXPECT_NEAR(s(0, 0) / b0, 1.0, 1e-12);
  EXPECT_NEAR(s(0, 4), -0.9690674171937932, 1e-15);
  EXPECT_EQ(s(0, 5), 0.0);
  EXPECT_NEAR(s(1, 4), -1.9494734182360647, 1e-15);
  EXPECT_NEAR(s(1, 5), 0.9504358405839064, 1e-15);
  EXPECT_NEAR(s(2, 4), -1.9797963102817417, 1e-15);
  EXPECT_NEAR(s(2, 5), 0.9807737025330882, 1e-15);
}

TEST(Butterworth, EveryOrderIsHalfPowerAtTheCutoff) {
  for (int order = 1; order <= 20; ++order) {
    for (const double cutoff : {0.5, 5.0, 100.0, 499.0}) {
      const Sos sos = butterworth_lowpass(order, cutoff, kRate);
      Vector f(2);
      f << 0.0, cutoff;
      const Vector gain = sos_gain(sos, kRate, f);
      // At 0.5 Hz the response is a small difference of coefficients near 2: 1e-16 / (pi f / fs)^2.
      EXPECT_NEAR(gain(0), 1.0, 1e-8) << order << " " << cutoff;
      EXPECT_NEAR(gain(1), std::sqrt(0.5), 1e-8) << order << " " << cutoff;
      EXPECT_LT(max_pole_radius(sos), 1.0);
    }
  }
}

TEST(Butterworth, TwoPassCutoff) {
  // (sqrt(2) - 1)^(1/10) = 0.9156 in the analogue limit.
  EXPECT_NEAR(two_pass_cutoff(5, 0.01, kRate) / 0.01, 0.9156, 5e-5);
  for (const double wanted : {1.0, 5.0, 450.0}) {
    const Sos sos = butterworth_lowpass(5, corrected_cutoff(5, wanted, kRate), kRate);
    const double gain = sos_gain(sos, kRate, Vector::Constant(1, wanted))(0);
    EXPECT_NEAR(gain * gain, std::sqrt(0.5), 1e-10);
  }
}

TEST(Butterworth, SettlesWithTheSlowestPole) {
  const Sos sos = butterworth_lowpass(5, 5.0, kRate);
  // ln 1e-3 / ln sqrt(0.9807737025330882) = 711.64.
  EXPECT_EQ(settle_samples(sos, 1e-3), 712);
  EXPECT_LT(std::pow(max_pole_radius(sos), 712), 1e-3);
  EXPECT_GT(std::pow(max_pole_radius(sos), 711), 1e-3);
}

TEST(Response, CombinedSmootherOfTheReference) {
  const Sos sos = butterworth_lowpass(5, 5.0, kRate);
  Vector f(5);
  f << 2, 3, 4, 5, 6;
  const double gain[] = {0.99989522, 0.99399278, 0.90306227, 0.49999747, 0.13900221};
  const Matrix response = smoother_response({101, 6}, &sos, kRate, f);
  for (Index i = 0; i < 5; ++i) EXPECT_NEAR(response(i, 0), gain[i], 5e-9);
}

TEST(Response, IdealAtLowFrequency) {
  Vector f(3);
  f << 0.0, 1e-6, 0.01;
  const Matrix r = smoother_response({101, 6}, nullptr, kRate, f);
  EXPECT_LT((r.array() - 1.0).abs().maxCoeff(), 1e-12);
  const Matrix g = smoother_gain({101, 6}, nullptr, kRate, f);
  EXPECT_EQ(g(0, 1), 0.0);
  EXPECT_NEAR(g(2, 2), std::pow(2 * kPi * 0.01, 2), 1e-14);
}

// Direct form, one sample after the other: what the lockstep loop must reproduce to the last bit.
Vector plain(const Sos& sos, const Vector& y, Index pad) {
  const Index n = y.size();
  Vector x(n + 2 * pad);
  for (Index i = 0; i < x.size(); ++i) {
    const Index at = i - pad;
    x(i) = at < 0 ? 2 * y(0) - y(-at) : at >= n ? 2 * y(n - 1) - y(2 * (n - 1) - at) : y(at);
  }
  for (int pass = 0; pass < 2; ++pass) {
    double input = 1.0;
    const double first = x(0);
    for (Index s = 0; s < sos.sections.rows(); ++s) {
      const auto c = sos.sections.row(s);
      const double gain = (c(0) + c(1) + c(2)) / (1.0 + c(4) + c(5));
      const double unit1 = (c(2) - c(5) * gain) * input;
      const double unit0 = (c(1) - c(4) * gain) * input + unit1;
      double z0 = unit0 * first, z1 = unit1 * first;
      input *= gain;
      for (double& v : x) {
        const double out = v * c(0) + z0;
        z0 = (v * c(1) - out * c(4)) + z1;
        z1 = v * c(2) - out * c(5);
        v = out;
      }
    }
    x.reverseInPlace();
  }
  return x.segment(pad, n);
}

TEST(ZeroPhase, LockstepIsThePlainLoop) {
  Random random(5);
  for (const int order : {1, 2, 4, 5, 7, 13}) {
    const Sos sos = butterworth_lowpass(order, 12.0, kRate);
    for (const Index columns : {1, 7, 8, 17}) {
      for (const Index rows : {2, 63, 64, 65, 500}) {
        Matrix y(rows, columns);
        for (double& x : y.reshaped()) x = random.normal();
        const Matrix before = y;
        filter_zero_phase(sos, {}, y);
        const Index pad = effective_pad_samples(sos, {}, rows);
        for (Index c = 0; c < columns; ++c) {
          ASSERT_EQ((y.col(c) - plain(sos, before.col(c), pad)).cwiseAbs().maxCoeff(), 0.0)
              << order << " " << columns << " " << rows;
        }
      }
    }
  }
}

TEST(ZeroPhase, PadOfScipy) {
  ZeroPhase scipy;
  scipy.pad = Pad::kScipy;
  EXPECT_EQ(pad_samples(butterworth_lowpass(5, 5.0, kRate), scipy), 18);
  EXPECT_EQ(pad_samples(butterworth_lowpass(4, 5.0, kRate), scipy), 15);
  EXPECT_EQ(effective_pad_samples(butterworth_lowpass(4, 5.0, kRate), scipy, 10), 9);
}

TEST(ZeroPhase, AFailureChangesNothing) {
  const Sos sos = butterworth_lowpass(5, 5.0, kRate);
  Matrix y = Matrix::Random(100, 9);
  y(40, 8) = std::nan("");
  const Matrix before = y;
  EXPECT_THROW(filter_zero_phase(sos, {}, y), Error);
  EXPECT_EQ((y.leftCols(8) - before.leftCols(8)).cwiseAbs().maxCoeff(), 0.0);
  Sos unstable = sos;
  unstable.sections(2, 5) = 1.0;
  EXPECT_THROW(filter_zero_phase(unstable, {}, y), Error);
}

}  // namespace
}  // namespace ulna
