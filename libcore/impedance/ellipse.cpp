#include "impedance/ellipse.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "impedance/natural.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

// Eigenvalues closer than this share of the larger are equal to rounding.
constexpr double kIsotropic = 1e-9;

double ratio(double top, double bottom) {
  if (bottom > 0.0) return top / bottom;
  return top == 0.0 ? 0.0 : kInfinity;
}

}  // namespace

Ellipse ellipse_of(const Matrix& z) {
  require(z.rows() == 2 && z.cols() == 2 && z.allFinite(), "z",
          "an ellipse needs a finite 2 x 2 matrix");
  Ellipse e;
  const double shear = 0.5 * (z(0, 1) + z(1, 0));
  const double half_sum = 0.5 * (z(0, 0) + z(1, 1));
  const double half_difference = 0.5 * (z(0, 0) - z(1, 1));
  const double radius = std::hypot(half_difference, shear);
  e.major = half_sum + radius;
  e.minor = half_sum - radius;
  e.area = kPi * e.major * e.minor;
  e.shape = e.minor > 0.0 ? e.major / e.minor : kNaN;
  e.angle_defined = radius > kIsotropic * std::max(std::abs(e.major), std::abs(e.minor));
  if (e.angle_defined) {
    e.angle_rad = 0.5 * std::atan2(shear, half_difference);
    if (e.angle_rad < 0.0) e.angle_rad += kPi;
    if (e.angle_rad >= kPi) e.angle_rad = 0.0;
  }
  e.antisymmetric = 0.5 * (z(0, 1) - z(1, 0));
  e.antisymmetry =
      ratio(std::abs(e.antisymmetric), e.minor > 0.0 ? std::sqrt(e.major * e.minor) : 0.0);
  return e;
}

double antisymmetry_of(const Matrix& z) {
  const Matrix symmetric = 0.5 * (z + z.transpose());
  const Matrix rest = 0.5 * (z - z.transpose());
  const Vector eigenvalues = Eigen::SelfAdjointEigenSolver<Matrix>(symmetric).eigenvalues();
  const double largest = rest.jacobiSvd().singularValues()[0];
  const double mean = eigenvalues[0] > 0.0 ? std::exp(eigenvalues.array().log().mean()) : 0.0;
  return ratio(largest, mean);
}

EllipseInterval ellipse_interval(const Matrix& z, const Matrix& draws, double level) {
  EllipseInterval out;
  out.value = ellipse_of(z);
  std::vector<double> major, minor, area, shape, angle, antisymmetry;
  double cosine = 0.0;
  double sine = 0.0;
  for (Index i = 0; i < draws.rows(); ++i) {
    if (!draws.row(i).allFinite()) continue;
    const Ellipse e = ellipse_of(matrix_of_row(draws, i, 0, 2));
    major.push_back(e.major);
    minor.push_back(e.minor);
    area.push_back(e.area);
    shape.push_back(e.shape);
    antisymmetry.push_back(e.antisymmetry);
    // The draw's direction that is nearest to the estimate's: directions repeat every 180 degrees.
    angle.push_back(out.value.angle_rad + std::remainder(e.angle_rad - out.value.angle_rad, kPi));
    cosine += std::cos(2.0 * e.angle_rad);
    sine += std::sin(2.0 * e.angle_rad);
  }
  const double tail = 0.5 * (1.0 - level);
  const auto bounds = [&](const std::vector<double>& sample, double* interval) {
    interval[0] = sample_quantile(sample, tail);
    interval[1] = sample_quantile(sample, 1.0 - tail);
  };
  bounds(major, out.major);
  bounds(minor, out.minor);
  bounds(area, out.area);
  bounds(shape, out.shape);
  bounds(angle, out.angle_rad);
  bounds(antisymmetry, out.antisymmetry);
  const double count = static_cast<double>(std::max<std::size_t>(1, angle.size()));
  // Mean resultant of the doubled angles: below one half the directions cover more than a quadrant.
  if (!angle.empty() && std::hypot(cosine, sine) / count < 0.5) out.value.angle_defined = false;
  return out;
}

}  // namespace ulna
