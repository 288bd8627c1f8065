#include "ident/consistency.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace ulna {
namespace {

constexpr double kWindowS = 10.0;

Vector integral(const Vector& y, double step) {
  Vector out = Vector::Zero(y.size());
  for (Index i = 1; i < y.size(); ++i) out[i] = out[i - 1] + 0.5 * step * (y[i] + y[i - 1]);
  return out;
}

// rms of what a polynomial of the given order leaves of y.
double residual_rms(const Vector& y, int order) {
  Matrix powers(y.size(), order + 1);
  powers.col(0).setOnes();
  const Vector t = Vector::LinSpaced(y.size(), -1.0, 1.0);
  for (int k = 1; k <= order; ++k) powers.col(k) = powers.col(k - 1).cwiseProduct(t);
  const Vector rest = y - powers * powers.householderQr().solve(y);
  return rest.norm() / std::sqrt(static_cast<double>(y.size()));
}

}  // namespace

DerivativeConsistency derivative_consistency(const Prepared& prepared) {
  const PreparedTrial& trial =
      *std::max_element(prepared.trials.begin(), prepared.trials.end(),
                        [](const auto& a, const auto& b) { return a.rows() < b.rows(); });
  const double step = 1.0 / prepared.report.rate_hz;
  const Index rows = std::min(trial.rows(), static_cast<Index>(kWindowS / step));
  DerivativeConsistency out;
  if (rows < 10) {
    out.velocity = out.position = std::numeric_limits<double>::quiet_NaN();
    return out;
  }
  const Index begin = (trial.rows() - rows) / 2;
  for (Index axis = 0; axis < trial.position().cols(); ++axis) {
    const Vector position = trial.position().col(axis).segment(begin, rows);
    const Vector velocity = trial.velocity().col(axis).segment(begin, rows);
    const Vector once = integral(trial.acceleration().col(axis).segment(begin, rows), step);
    const Vector twice = integral(once, step);
    // A constant of integration each: an offset of the velocity, a line of the position.
    out.velocity =
        std::max(out.velocity, residual_rms(velocity - once, 0) / residual_rms(velocity, 0));
    out.position =
        std::max(out.position, residual_rms(position - twice, 1) / residual_rms(position, 1));
  }
  return out;
}

}  // namespace ulna
