// Derivative kernels that pass the same band as the value kernel.
#include "signal/matched.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "base/error.hpp"
#include "signal/butterworth.hpp"
#include "signal/response.hpp"

namespace ulna {
namespace {

struct Case {
  SavgolSpec spec;
  double rate_hz;
  double band_hz;
  double tolerance;  // of the response, relative to the largest in the band
};

// The published pair, the virtual sensor's window, other orders and rates; last the window that
// goes with the 50 Hz of a fast joint: constants and curvatures are kept, and the four weights that
// remain free cannot do better.
const Case kCases[] = {{{101, 6}, 1000.0, 10.0, 1e-9},
                       {{151, 6}, 1000.0, 9.0, 1e-9},
                       {{51, 5}, 500.0, 10.0, 1e-9},
                       {{21, 4}, 100.0, 5.0, 1e-9},
                       {{11, 6}, 1000.0, 100.0, 1e-7}};

std::complex<double> response(const Matrix& kernels, Index d, double omega_t) {
  const Index half = (kernels.rows() - 1) / 2;
  std::complex<double> sum = 0.0;
  for (Index k = -half; k <= half; ++k) {
    sum += kernels(k + half, d) * std::polar(1.0, omega_t * static_cast<double>(k));
  }
  return sum;
}

double matched_band(const Case& c) {
  return std::min(c.band_hz, 1.25 * savgol_cutoff(c.spec) * 0.5 * c.rate_hz);
}

TEST(Matched, DerivativesAreThePowersOfTheValuesResponse) {
  for (const Case& c : kCases) {
    SCOPED_TRACE(c.spec.window);
    const Matrix kernels = matched_kernels(c.spec, 2, c.rate_hz, c.band_hz);
    const double top = 2.0 * kPi * matched_band(c);
    for (int i = 0; i <= 400; ++i) {
      const double omega = top * i / 400.0;
      const std::complex<double> value = response(kernels, 0, omega / c.rate_hz);
      for (Index d = 1; d <= 2; ++d) {
        const std::complex<double> ideal = std::pow(std::complex<double>(0.0, omega), d) * value;
        EXPECT_LT(std::abs(response(kernels, d, omega / c.rate_hz) - ideal),
                  c.tolerance * std::pow(top, static_cast<double>(d)))
            << "derivative " << d << " at " << omega / (2.0 * kPi) << " Hz";
      }
    }
  }
}

// The plain kernels do not have that property: the test above would see it.
TEST(Matched, PlainKernelsDiffer) {
  const Matrix kernels = savgol_kernels({101, 6}, 2, 1000.0);
  const double omega = 2.0 * kPi * 5.0;
  const std::complex<double> value = response(kernels, 0, omega / 1000.0);
  const std::complex<double> j(0.0, omega);
  EXPECT_GT(std::abs(response(kernels, 1, omega / 1000.0) - j * value), 1e-5 * omega);
  EXPECT_GT(std::abs(response(kernels, 2, omega / 1000.0) - j * j * value), 1e-5 * omega * omega);
}

TEST(Matched, ValueKernelIsUntouchedAndParityIsExact) {
  for (const Case& c : kCases) {
    const Matrix plain = savgol_kernels(c.spec, 2, c.rate_hz);
    const Matrix kernels = matched_kernels(c.spec, 2, c.rate_hz, c.band_hz);
    ASSERT_EQ(kernels.rows(), plain.rows());
    ASSERT_EQ(kernels.cols(), 3);
    EXPECT_EQ((kernels.col(0) - plain.col(0)).norm(), 0.0);
    EXPECT_EQ((kernels.col(1) + kernels.col(1).reverse()).norm(), 0.0);
    EXPECT_EQ((kernels.col(2) - kernels.col(2).reverse()).norm(), 0.0);
  }
}

// Power of white noise in derivative d after the two passes of the low pass.
double noise_gain(const Matrix& kernels, Index d, double lowpass_hz, double rate_hz) {
  const Sos sos = butterworth_lowpass(5, lowpass_hz, rate_hz);
  constexpr int kPoints = 4000;
  const Vector freq_hz =
      Vector::LinSpaced(kPoints, 0.0, 10.0 * lowpass_hz);  // beyond, the power gain is below 1e-20
  const Vector lowpass = sos_gain(sos, rate_hz, freq_hz);
  double sum = 0.0;
  for (Index i = 0; i < kPoints; ++i) {
    sum += std::norm(response(kernels, d, 2.0 * kPi * freq_hz[i] / rate_hz)) *
           std::pow(lowpass[i], 4.0);
  }
  return sum;
}

// Out of the band the matched kernels pass more than the plain ones (20 times the amplitude of
// white noise in the second derivative), which is why they are for use with the low pass: through
// it, the match costs less than a thousandth.
TEST(Matched, AddsNoNoiseThroughTheLowPass) {
  const Matrix plain = savgol_kernels({101, 6}, 2, 1000.0);
  const Matrix kernels = matched_kernels({101, 6}, 2, 1000.0, 10.0);
  for (Index d = 1; d <= 2; ++d) {
    const double growth =
        noise_gain(kernels, d, 5.0, 1000.0) / noise_gain(plain, d, 5.0, 1000.0) - 1.0;
    EXPECT_LT(std::abs(growth), 1e-3) << "derivative " << d;
  }
}

// In the band the change is that of the two responses: the plain kernels are nearly right there.
TEST(Matched, ChangeIsSmallInTheBandOfTheMotion) {
  const Matrix plain = savgol_kernels({101, 6}, 2, 1000.0);
  const Matrix kernels = matched_kernels({101, 6}, 2, 1000.0, 10.0);
  for (double f = 0.1; f <= 5.0; f += 0.1) {
    const double omega = 2.0 * kPi * f;
    for (Index d = 1; d <= 2; ++d) {
      const auto change = response(kernels, d, omega / 1000.0) - response(plain, d, omega / 1000.0);
      EXPECT_LT(std::abs(change), 1e-3 * std::pow(omega, static_cast<double>(d))) << f << " Hz";
    }
  }
}

TEST(Matched, RefusesABandOfNothing) {
  for (const double band : {0.0, -1.0, std::nan("")}) {
    EXPECT_THROW(matched_kernels({101, 6}, 2, 1000.0, band), Error);
  }
}

}  // namespace
}  // namespace ulna
