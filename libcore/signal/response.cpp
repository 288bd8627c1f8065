#include "signal/response.hpp"

#include <cmath>
#include <complex>
#include <string>

#include "base/error.hpp"

namespace ulna {
namespace {

void check_frequencies(VectorRef freq_hz, double rate_hz) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "the sampling rate must be positive");
  for (Index i = 0; i < freq_hz.size(); ++i) {
    require(freq_hz(i) >= 0.0 && freq_hz(i) <= 0.5 * rate_hz, "freq_hz",
            "frequency " + std::to_string(i) + " (counted from 0) is " +
                std::to_string(freq_hz(i)) + " Hz: it must lie between 0 and " +
                std::to_string(0.5 * rate_hz) + " Hz, half the sampling rate");
  }
}

// sin(x) / x, exact where the division is not.
double sinc(double x) { return std::abs(x) < 1e-4 ? 1.0 - x * x / 6.0 : std::sin(x) / x; }

// Gains of the kernels divided by 1, omega and omega^2. The second derivative's weights sum to
// zero, so w(0) + 2 sum w(k) cos(k x) = -4 sum w(k) sin^2(k x / 2): no cancellation at low
// frequency.
Eigen::RowVector3d kernel_response(const Matrix& kernels, double omega, double step_s) {
  const Index half = (kernels.rows() - 1) / 2;
  Eigen::RowVector3d gain(kernels(half, 0), 0.0, 0.0);
  for (Index k = 1; k <= half; ++k) {
    const double t = static_cast<double>(k) * step_s;
    const double s = sinc(0.5 * omega * t);
    gain(0) += 2.0 * kernels(half + k, 0) * std::cos(omega * t);
    gain(1) += 2.0 * kernels(half + k, 1) * t * sinc(omega * t);
    gain(2) += kernels(half + k, 2) * t * t * s * s;
  }
  return gain.cwiseAbs();
}

}  // namespace

Vector sos_gain(const Sos& sos, double rate_hz, VectorRef freq_hz) {
  check_sos(sos);
  check_frequencies(freq_hz, rate_hz);
  Vector gain(freq_hz.size());
  for (Index i = 0; i < freq_hz.size(); ++i) {
    const std::complex<double> z = std::polar(1.0, -2.0 * kPi * freq_hz(i) / rate_hz);
    double product = 1.0;
    for (Index k = 0; k < sos.sections.rows(); ++k) {
      const auto c = sos.sections.row(k);
      product *= std::abs((c(0) + z * (c(1) + z * c(2))) / (1.0 + z * (c(4) + z * c(5))));
    }
    gain(i) = product;
  }
  return gain;
}

Matrix smoother_response(const SavgolSpec& spec, const Sos* sos, double rate_hz,
                         VectorRef freq_hz) {
  check_frequencies(freq_hz, rate_hz);
  const Matrix kernels = savgol_kernels(spec, 2, rate_hz);
  Matrix response(freq_hz.size(), 3);
  for (Index i = 0; i < freq_hz.size(); ++i) {
    response.row(i) = kernel_response(kernels, 2.0 * kPi * freq_hz(i), 1.0 / rate_hz);
  }
  if (sos != nullptr) {
    const Vector once = sos_gain(*sos, rate_hz, freq_hz);
    response.array().colwise() *= once.array().square();
  }
  return response;
}

Matrix smoother_gain(const SavgolSpec& spec, const Sos* sos, double rate_hz, VectorRef freq_hz) {
  Matrix gain = smoother_response(spec, sos, rate_hz, freq_hz);
  const Vector omega = 2.0 * kPi * freq_hz;
  gain.col(1).array() *= omega.array();
  gain.col(2).array() *= omega.array().square();
  return gain;
}

}  // namespace ulna
