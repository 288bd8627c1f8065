#include "impedance/reflex_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "impedance/profile.hpp"
#include "impedance/ridge.hpp"
#include "impedance/scores.hpp"

namespace ulna {
namespace {

constexpr Index kProfilePoints = 25;

// From a coarse look at the whole range; the better of two refined starts.
BoxSolution search(const Cascade& cascade, const ReflexOptions& options, Token* token) {
  const BoxProblem problem = cascade.problem(options.delay_min_s, options.delay_max_s);
  struct Start {
    Vector q;
    double cost = 0.0;
  };
  std::vector<Start> starts;
  for (const double omega : {6.0, 15.0, 45.0}) {
    for (int k = 0; k < 4; ++k) {
      step(token, 0.2);
      const double share = static_cast<double>(k) / 3.0;
      const double delay =
          options.delay_min_s + share * (options.delay_max_s - options.delay_min_s);
      const Vector q = nonlinear(options, omega, 0.8, delay);
      starts.push_back({q, problem.residual(q).squaredNorm()});
    }
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const Start& a, const Start& b) { return a.cost < b.cost; });
  BoxSolution best;
  best.cost = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 2; ++k) {
    step(token, 0.3);
    BoxSolution found = minimise_in_box(problem, starts[k].q, Effort::kCoarse, 30);
    if (found.cost < best.cost) best = std::move(found);
  }
  return minimise_in_box(problem, best.parameters);
}

// Outwards from the best, each point from its neighbour.
DelayProfile profile_delay(const Cascade& cascade, const ReflexOptions& options,
                           const BoxSolution& best, double delay_error, Token* token) {
  const double centre = cascade.delay(best.parameters);
  std::vector<double> points;
  for (Index k = 0; k < kProfilePoints; ++k) {
    points.push_back(options.delay_min_s + (options.delay_max_s - options.delay_min_s) *
                                               static_cast<double>(k) /
                                               static_cast<double>(kProfilePoints - 1));
  }
  if (std::isfinite(delay_error) && delay_error > 0.0) {
    for (const double errors : {-3.0, -2.2, -1.8, -1.0, 1.0, 1.8, 2.2, 3.0}) {
      points.push_back(centre + errors * delay_error);
    }
  }
  std::sort(points.begin(), points.end());
  points.erase(
      std::remove_if(points.begin(), points.end(),
                     [&](double d) { return d < options.delay_min_s || d > options.delay_max_s; }),
      points.end());
  const auto split = std::lower_bound(points.begin(), points.end(), centre);
  DelayProfile out;
  out.delay = Vector::Zero(static_cast<Index>(points.size()) + 1);
  out.cost = out.delay;
  const Index middle = split - points.begin();
  for (Index i = 0; i < middle; ++i) out.delay[i] = points[static_cast<std::size_t>(i)];
  out.delay[middle] = centre;
  for (Index i = middle; i < static_cast<Index>(points.size()); ++i) {
    out.delay[i + 1] = points[static_cast<std::size_t>(i)];
  }
  out.cost[middle] = best.cost;
  for (const Index direction : {Index{-1}, Index{1}}) {
    Vector q = best.parameters;
    for (Index i = middle + direction; i >= 0 && i < out.delay.size(); i += direction) {
      step(token, 0.5);
      q[options.order] = out.delay[i];
      const BoxSolution there =
          minimise_in_box(cascade.problem(out.delay[i], out.delay[i]), q, Effort::kCoarse, 12);
      q = there.parameters;
      out.cost[i] = std::max(there.cost, best.cost);
    }
  }
  return out;
}

Vector fit_without(const Cascade& cascade) {
  Matrix stacked(cascade.linear().rows() + cascade.penalty().rows(), cascade.linear().cols());
  stacked << cascade.linear(), cascade.penalty();
  Vector right = Vector::Zero(stacked.rows());
  right.head(cascade.torque().size()) = cascade.torque();
  return stacked.householderQr().solve(right);
}

// M, B and K that describe an intrinsic impulse response best for this motion.
Matrix natural_map(const std::vector<CascadeTrial>& trials, const Cascade& cascade,
                   const ReflexOptions& options, const CascadeGrid& grid) {
  const Index p = cascade.linear().cols();
  if (grid.intrinsic_lags == 0) {
    Matrix map = Matrix::Zero(3, p);
    map.leftCols(3).setIdentity();
    return map;
  }
  CascadeGrid plain = grid;
  plain.intrinsic_lags = 0;
  Matrix motion = intrinsic_columns(trials, cascade.sample(), plain).leftCols(3);
  RunOffsets(cascade.sample(), options.drift).remove(motion);
  const Index lags = 2 * grid.intrinsic_lags + 1;
  Matrix map = Matrix::Zero(3, p);
  map.leftCols(lags) = motion.householderQr().solve(cascade.linear().leftCols(lags));
  return map;
}

}  // namespace

double CascadeFit::vaf() const noexcept {
  return total > 0.0 ? 100.0 * (1.0 - solution.cost / total) : kNaN;
}

CascadeFit fit_cascade(Cascade& cascade, const ReflexOptions& options, int side, Token* token) {
  CascadeFit out;
  out.side = side;
  if (options.intrinsic == Intrinsic::kImpulseResponse) {
    // Few rows predict others from: the reflex column of a typical element stands beside.
    Matrix columns(cascade.linear().rows(), cascade.linear().cols() + 1);
    columns << cascade.linear(),
        cascade.reflex(
            nonlinear(options, 10.0, 0.8, 0.5 * (options.delay_min_s + options.delay_max_s)));
    Matrix shape = ridge_shape(columns);
    const Index lags = columns.cols() - 1 - (options.position_powers - 1);
    shape.diagonal().tail(columns.cols() - lags).setZero();
    out.penalty = ridge_fit(columns, cascade.torque(), shape, token).penalty;
    cascade.set_penalty(out.penalty);
  }
  out.theta_without = fit_without(cascade);
  out.total = cascade.torque().squaredNorm();
  out.solution = search(cascade, options, token);
  out.theta = cascade.evaluate(out.solution.parameters).theta;
  return out;
}

CascadeUncertainty uncertainty(const std::vector<CascadeTrial>& trials, const Cascade& cascade,
                               const ReflexOptions& options, const CascadeGrid& grid,
                               const CascadeFit& fitted, double effective_hz, double position_mean,
                               Token* token) {
  const Index p = cascade.linear().cols();
  const Index order = options.order;
  const Index n = p + 1 + order + 1;
  const Vector& q = fitted.solution.parameters;
  const CascadeEvaluation at = cascade.evaluate(q);
  Matrix jacobian(at.residual.size(), n);
  jacobian.leftCols(p + 1) = cascade.columns(q);
  BoxProblem kept = cascade.problem(options.delay_min_s, options.delay_max_s);
  kept.residual = [&](const Vector& moved) { return cascade.residual_with(moved, at.theta); };
  jacobian.rightCols(order + 1) = -residual_jacobian(kept, q);
  // A parameter at its bound is held there.
  for (Index k = 0; k < order; ++k) {  // the delay's interval comes from its profile
    if (q[k] <= kept.low[k] || q[k] >= kept.high[k]) jacobian.col(p + 1 + k).setZero();
  }
  Matrix information = jacobian.transpose() * jacobian;
  information.topLeftCorner(p, p) += cascade.penalty().transpose() * cascade.penalty();
  const Vector norms = information.diagonal().cwiseSqrt();
  const Vector scale = (norms.array() > 0.0).select(norms.cwiseInverse(), 0.0);
  Matrix unit = scale.asDiagonal() * information * scale.asDiagonal();
  for (Index k = 0; k < n; ++k) {
    if (scale[k] == 0.0) unit(k, k) = 1.0;
  }
  const Matrix bread = scale.asDiagonal() * unit.ldlt().solve(Matrix(scale.asDiagonal()));
  const Matrix scores = at.residual.asDiagonal() * jacobian;
  const double rate = grid.sample_rate();
  const Index lag = lag_rows(cascade.sample().bounds, options.hac_lag_s, rate);
  const double seconds = static_cast<double>(cascade.sample().rows()) / rate;
  // Rows smoothed to B Hz hold 2 B T independent values, and the fit took some of them.
  const double independent = 2.0 * effective_hz * seconds;
  const double taken = static_cast<double>(n) + static_cast<double>(cascade.sample().runs.size()) *
                                                    static_cast<double>(1 + options.drift);
  const double shrinkage = independent > 2.0 * taken ? independent / (independent - taken) : 2.0;
  const Matrix covariance =
      shrinkage * (bread * bartlett_sum(scores, cascade.sample().bounds, lag) * bread.transpose());

  // To natural parameters.
  const Matrix intrinsic = natural_map(trials, cascade, options, grid);
  const CausalElement element = cascade.element(q);
  CascadeUncertainty out;
  ReflexFit& fit = out.fit;
  fit.position_mean = position_mean;
  fit.converged = fitted.solution.converged;
  Matrix map = Matrix::Zero(kReflexParameterCount, n);
  map.topLeftCorner(3, p) = intrinsic;
  map(kReflexGain, p) = 1.0;
  map(kReflexOmega, p + 1) = element.omega;
  if (order == 2) map(kReflexZeta, p + 2) = element.zeta;
  map(kReflexDelay, n - 1) = 1.0;
  fit.value.resize(kReflexParameterCount);
  fit.value.head(3) = intrinsic * at.theta.head(p);
  fit.value[kReflexGain] = at.theta[p];
  fit.value[kReflexOmega] = element.omega;
  fit.value[kReflexZeta] = order == 2 ? element.zeta : kNaN;
  fit.value[kReflexDelay] = cascade.delay(q);
  fit.covariance = map * covariance * map.transpose();
  const Index powers = options.position_powers - 1;
  fit.powers = at.theta.segment(p - powers, powers);
  fit.powers_error = covariance.diagonal().segment(p - powers, powers).cwiseMax(0.0).cwiseSqrt();

  fit.interval.resize(2, kReflexParameterCount);
  for (Index k = 0; k < kReflexParameterCount; ++k) {
    const double error = std::sqrt(std::max(0.0, fit.covariance(k, k)));
    const double value = fit.value[k];
    if (k >= kReflexOmega && k <= kReflexZeta) {  // positive: the logarithm is closer to normal
      fit.interval(0, k) = value * std::exp(-kQuantile95 * error / value);
      fit.interval(1, k) = value * std::exp(kQuantile95 * error / value);
    } else {
      fit.interval(0, k) = value - kQuantile95 * error;
      fit.interval(1, k) = value + kQuantile95 * error;
    }
  }
  const double delay_variance = covariance(n - 1, n - 1);
  out.profile = profile_delay(cascade, options, fitted.solution,
                              std::sqrt(std::max(0.0, delay_variance)), token);
  // The profile's cost in units in which its curvature tells the honest variance.
  const double weight = delay_variance > 0.0 ? bread(n - 1, n - 1) / delay_variance : 0.0;
  if (weight > 0.0) {
    const Vector distance =
        ((out.profile.cost.array() - fitted.solution.cost).max(0.0) * weight).sqrt();
    fit.interval.col(kReflexDelay) = likely_range(out.profile.delay, distance, kQuantile95);
  }
  return out;
}

}  // namespace ulna
