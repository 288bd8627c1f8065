#include "signal/matched.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

// Frequencies at which the responses are matched: the response of a short kernel is smooth, so a
// Chebyshev grid of this size leaves no room between its points.
constexpr int kGrid = 24;
// Beyond this multiple of its -3 dB frequency the value kernel passes nothing worth matching.
constexpr double kWidest = 1.25;

}  // namespace

Matrix matched_kernels(const SavgolSpec& spec, int max_derivative, double rate_hz, double band_hz) {
  Matrix kernels = savgol_kernels(spec, max_derivative, rate_hz);
  require(band_hz > 0.0, "band_hz", "the band to match must be above 0 Hz");
  const Index half = (spec.window - 1) / 2;
  const double top = 2.0 * kPi * std::min(band_hz / rate_hz, kWidest * 0.5 * savgol_cutoff(spec));

  // Kernels are even or odd, so cosine or sine weights of the positive half are the unknowns.
  Matrix cosines(kGrid, half + 1);
  Matrix sines(kGrid, half + 1);
  Vector omega(kGrid);  // rad / sample
  for (int j = 0; j < kGrid; ++j) {
    omega[j] = 0.5 * top * (1.0 - std::cos(kPi * (j + 0.5) / kGrid));
    for (Index k = 0; k <= half; ++k) {
      const double phase = omega[j] * static_cast<double>(k);
      cosines(j, k) = (k == 0 ? 1.0 : 2.0) * std::cos(phase);
      sines(j, k) = 2.0 * std::sin(phase);
    }
  }
  const Vector value_response = cosines * kernels.col(0).tail(half + 1);
  for (int d = 1; d <= max_derivative; ++d) {
    const bool even = d % 2 == 0;
    const Matrix& basis = even ? cosines : sines;
    const double sign = (d / 2) % 2 == 0 ? 1.0 : -1.0;  // (j omega)^d over its phase
    const double scale = std::pow(rate_hz, d);
    Vector positive = kernels.col(d).tail(half + 1) / scale;
    const Vector wanted = sign * value_response.cwiseProduct(omega.array().pow(d).matrix());
    // The change leaves constants, slopes and curvatures alone: at 0 Hz a derivative of a position
    // far from zero must not see the position. Changes of that kind are q times free weights.
    Matrix moments(half + 1, even ? 2 : 1);
    for (Index k = 0; k <= half; ++k) {
      const double t = static_cast<double>(k) / static_cast<double>(half);
      moments(k, 0) = even ? (k == 0 ? 1.0 : 2.0) : t;
      if (even) moments(k, 1) = t * t;
    }
    const Matrix q =
        Eigen::HouseholderQR<Matrix>(moments).householderQ() * Matrix::Identity(half + 1, half + 1);
    const Matrix free = q.rightCols(half + 1 - moments.cols());
    Eigen::CompleteOrthogonalDecomposition<Matrix> smallest_change(kGrid, free.cols());
    smallest_change.setThreshold(1e-13);
    smallest_change.compute(basis * free);
    positive += free * smallest_change.solve(wanted - basis * positive);
    positive *= scale;
    kernels.col(d).tail(half + 1) = positive;
    kernels.col(d).head(half) = (even ? 1.0 : -1.0) * positive.tail(half).reverse();
    if (!even) kernels(half, d) = 0.0;
  }
  return kernels;
}

}  // namespace ulna
