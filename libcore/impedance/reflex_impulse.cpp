#include "impedance/reflex_impulse.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "impedance/ridge.hpp"
#include "impedance/scores.hpp"

namespace ulna {
namespace {

// Bends a response of 10 Hz, 5 ms a lag, by less than a thousandth (second differences of 0.1 of
// it, against the sum over its lags), and holds down what alternates from lag to lag, of which
// torque from another path could otherwise make any amount.
constexpr double kLeastRoughness = 1.0;

}  // namespace

ReflexImpulse impulse_responses(const std::vector<CascadeTrial>& trials, const Split& split,
                                const ReflexOptions& options, const CascadeGrid& plain,
                                Token* token) {
  ReflexImpulse out;
  out.vaf = kNaN;
  if (options.reflex_irf_s <= 0.0) return out;
  CascadeGrid grid = plain;
  grid.intrinsic_lags = lags_either_side(grid, options);
  grid.ahead = grid.intrinsic_lags * grid.irf_step;
  const Index reflex_lags =
      static_cast<Index>(std::lround(options.reflex_irf_s * grid.rate)) / grid.irf_step;
  grid.back = std::max(grid.ahead, reflex_lags * grid.irf_step);
  const auto columns_of = [&](const CascadeSample& sample, Vector& torque) {
    const Matrix intrinsic = intrinsic_columns(trials, sample, grid);
    Matrix columns(sample.rows(), intrinsic.cols() + reflex_lags + 1);
    columns.leftCols(intrinsic.cols()) = intrinsic;
    for (Index k = 0; k <= reflex_lags; ++k) {
      columns.col(intrinsic.cols() + k) = gather(sample, k * grid.irf_step, [&](int t) {
        return trials[static_cast<std::size_t>(t)].drive.col(0);
      });
    }
    const RunOffsets offsets(sample, options.drift);
    offsets.remove(columns);
    torque = offsets.removed(gather(
        sample, 0, [&](int t) { return trials[static_cast<std::size_t>(t)].torque.col(0); }));
    return columns;
  };
  const CascadeSample sample =
      cascade_sample(trials, split.train, grid.back, grid.ahead, grid.stride, 2 + options.drift);
  const Index lags = 2 * grid.intrinsic_lags + 1;
  const Index powers = options.position_powers - 1;
  const Index width = lags + powers + reflex_lags + 1;
  if (sample.rows() < 3 * width) return out;
  Vector torque;
  const Matrix columns = columns_of(sample, torque);
  // The ridge on the intrinsic lags beside a reflex response that is smooth, then its roughness, in
  // units of its own columns. The static powers are free.
  const Matrix size = ridge_shape(columns);
  Matrix ridge_part = Matrix::Zero(width, width);
  ridge_part.topLeftCorner(lags, lags) = size.topLeftCorner(lags, lags);
  Matrix rough_part = Matrix::Zero(width, width);
  rough_part.bottomRightCorner(reflex_lags + 1, reflex_lags + 1) =
      size.diagonal().tail(reflex_lags + 1).mean() * roughness(reflex_lags + 1);
  const double ridge_penalty = ridge_fit(columns, torque, ridge_part, token, rough_part).penalty;
  const Ridge ridge =
      ridge_fit(columns, torque, rough_part, token, ridge_penalty * ridge_part, kLeastRoughness);
  const Vector residual = torque - columns * ridge.theta;
  const Index lag = lag_rows(sample.bounds, options.hac_lag_s, grid.sample_rate());
  const Matrix scores = residual.asDiagonal() * columns;
  const Eigen::LDLT<Matrix> factor(ridge.information);
  const Matrix covariance =
      factor.solve(factor.solve(bartlett_sum(scores, sample.bounds, lag)).transpose());
  const Vector error = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  // Per second of lag, so that the numbers do not depend on the step: torque = integral of h times
  // the rectified velocity.
  const double width_s = static_cast<double>(grid.irf_step) * grid.step;
  out.intrinsic_lag_s = Vector::LinSpaced(lags, -static_cast<double>(grid.intrinsic_lags) * width_s,
                                          static_cast<double>(grid.intrinsic_lags) * width_s);
  out.intrinsic = ridge.theta.head(lags);
  out.intrinsic_error = error.head(lags);
  out.reflex_lag_s =
      Vector::LinSpaced(reflex_lags + 1, 0.0, static_cast<double>(reflex_lags) * width_s);
  out.reflex = ridge.theta.tail(reflex_lags + 1) / width_s;
  out.reflex_error = error.tail(reflex_lags + 1) / width_s;
  out.penalty = ridge.penalty;
  out.values = width;
  out.rank = ridge.rank;
  out.available = true;
  const CascadeSample rest = cascade_sample(trials, split.held_out, grid.back, grid.ahead,
                                            grid.stride, 10 + options.drift);
  if (rest.rows() > 0) {
    Vector other;
    const Matrix there = columns_of(rest, other);
    const double total = other.squaredNorm();
    if (total > 0.0) {
      out.vaf = 100.0 * (1.0 - (other - there * ridge.theta).squaredNorm() / total);
    }
  }
  return out;
}

}  // namespace ulna
