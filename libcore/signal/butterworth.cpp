#include "signal/butterworth.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "base/error.hpp"

namespace ulna {
namespace {

void check_design(int order, double cutoff_hz, double rate_hz, const char* name) {
  require(order >= 1 && order <= 20, "order",
          "the filter order is " + std::to_string(order) + ": it must be from 1 to 20");
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "the sampling rate must be positive");
  require(std::isfinite(cutoff_hz) && cutoff_hz > 0.0 && cutoff_hz < 0.5 * rate_hz, name,
          "the cut-off is " + std::to_string(cutoff_hz) + " Hz: it must lie between 0 and " +
              std::to_string(0.5 * rate_hz) + " Hz, half the sampling rate");
}

double section_radius(double a1, double a2) {
  const double discriminant = 0.25 * a1 * a1 - a2;
  if (discriminant < 0.0) return std::sqrt(a2);
  return 0.5 * std::abs(a1) + std::sqrt(discriminant);
}

// tan(pi f2 / fs) / tan(pi f / fs) where the squared gain 1 / (1 + x^(2 order)) is 1 / sqrt(2).
double two_pass_ratio(int order) {
  return std::pow(std::sqrt(2.0) - 1.0, 0.5 / static_cast<double>(order));
}

}  // namespace

void check_sos(const Sos& sos) {
  const Matrix& s = sos.sections;
  require(s.rows() >= 1 && s.cols() == 6, "sos",
          "the filter must be an n x 6 array of second-order sections b0 b1 b2 a0 a1 a2");
  require(s.allFinite(), "sos", "the filter's coefficients must be finite");
  for (Index i = 0; i < s.rows(); ++i) {
    const std::string section = "section " + std::to_string(i) + " of the filter ";
    require(s(i, 3) == 1.0, "sos", section + "must have a0 = 1: divide it by its a0");
    // The stability triangle of z^2 + a1 z + a2.
    require(std::abs(s(i, 5)) < 1.0 && std::abs(s(i, 4)) < 1.0 + s(i, 5), "sos",
            section + "is not stable: a pole lies on or outside the unit circle");
  }
}

Sos butterworth_lowpass(int order, double cutoff_hz, double rate_hz) {
  check_design(order, cutoff_hz, rate_hz, "cutoff_hz");
  // Analogue prototype poles exp(j theta), scaled to the prewarped cut-off w (in units of 2 / T),
  // then z = (1 + p) / (1 - p). Each pole and its zero at -1 contribute w / (1 - p) to the gain.
  const double w = std::tan(kPi * cutoff_hz / rate_hz);
  const int count = (order + 1) / 2;
  Sos sos{Matrix::Zero(count, 6)};
  Matrix& s = sos.sections;
  s.col(3).setOnes();

  double gain = 1.0;
  // Last row first: the pole closest to the unit circle is filtered last, as SciPy orders it.
  bool single_zero_left = order % 2 == 1;
  for (int row = count - 1; row >= 0; --row) {
    const int m = row - count + 1;  // 0 for the last row
    if (order % 2 == 1 && row == 0) {
      s(0, 4) = (w - 1.0) / (w + 1.0);
      gain *= w / (1.0 + w);
      s(0, 0) = 1.0;
      s(0, 1) = single_zero_left ? 1.0 : 2.0;
      s(0, 2) = single_zero_left ? 0.0 : 1.0;
      continue;
    }
    // Damping 2 cos(phi) with phi from the negative real axis; the last row has the least.
    const double phi = 0.5 * kPi * (1.0 - (1.0 - 2.0 * m) / static_cast<double>(order));
    const double damping = 2.0 * std::cos(phi) * w;
    const double denominator = 1.0 + damping + w * w;
    s(row, 4) = 2.0 * (w * w - 1.0) / denominator;
    s(row, 5) = (1.0 - damping + w * w) / denominator;
    gain *= w * w / denominator;
    // SciPy pairs an odd order's lone zero with the first pole that is nearer to 0 than to -1.
    const bool single = single_zero_left && s(row, 4) < 1.0;
    if (single) single_zero_left = false;
    s(row, 0) = 1.0;
    s(row, 1) = single ? 1.0 : 2.0;
    s(row, 2) = single ? 0.0 : 1.0;
  }
  s.block(0, 0, 1, 3) *= gain;
  return sos;
}

double max_pole_radius(const Sos& sos) {
  check_sos(sos);
  double radius = 0.0;
  for (Index i = 0; i < sos.sections.rows(); ++i) {
    radius = std::max(radius, section_radius(sos.sections(i, 4), sos.sections(i, 5)));
  }
  return radius;
}

Index settle_samples(const Sos& sos, double epsilon) {
  require(epsilon > 0.0 && epsilon < 1.0, "epsilon", "epsilon must lie between 0 and 1");
  const double radius = max_pole_radius(sos);
  if (radius <= 0.0) return 0;
  const double samples = std::ceil(std::log(epsilon) / std::log(radius));
  // A pole within rounding of the circle would ask for more than any signal holds.
  return static_cast<Index>(std::min(samples, 1e12));
}

double two_pass_cutoff(int order, double cutoff_hz, double rate_hz) {
  check_design(order, cutoff_hz, rate_hz, "cutoff_hz");
  const double warped = std::tan(kPi * cutoff_hz / rate_hz);
  return std::atan(warped * two_pass_ratio(order)) * rate_hz / kPi;
}

double corrected_cutoff(int order, double wanted_hz, double rate_hz) {
  check_design(order, wanted_hz, rate_hz, "wanted_hz");
  const double warped = std::tan(kPi * wanted_hz / rate_hz);
  return std::atan(warped / two_pass_ratio(order)) * rate_hz / kPi;
}

}  // namespace ulna
