#include "impedance/reflex.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/words.hpp"
#include "impedance/reflex_rows.hpp"
#include "impedance/reflex_words.hpp"
#include "impedance/ridge.hpp"
#include "impedance/separable.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr double kQuantile = 1.959963984540054;  // 95 %
constexpr double kLeastOmega = 1.0;              // rad/s
constexpr double kZetaLow = 0.1, kZetaHigh = 5.0;
constexpr double kConditionLimit = 1e6;  // of the intrinsic columns in unit length
constexpr Index kProfilePoints = 25;
constexpr Index kVafReplicates = 500;
constexpr std::uint64_t kVafStream = 1u << 23;

Index to_rows(double seconds, double rate) {
  return static_cast<Index>(std::ceil(seconds * rate - 1e-9));
}

// How far signals reach around a row, and how many rows carry information of their own.
struct Grid {
  double rate = 0.0;
  double step = 0.0;
  Index stride = 1;
  Index irf_step = 1;  // prepared rows from one lag of an impulse response to the next
  Index back = 0, ahead = 0;
  Index intrinsic_lags = 0;  // to either side
};

Grid make_grid(const PrepareReport& report, const ReflexOptions& options) {
  Grid grid;
  grid.rate = report.rate_hz;
  grid.step = 1.0 / grid.rate;
  const double band = report.lowpass_order > 0 ? report.lowpass_hz : 0.25 * grid.rate;
  grid.stride = std::max<Index>(1, static_cast<Index>(grid.rate / (5.0 * band)));
  grid.irf_step = std::max<Index>(1, static_cast<Index>(std::lround(grid.rate / (4.0 * band))));
  grid.back = to_rows(options.delay_max_s, grid.rate) + 2;
  if (options.intrinsic == Intrinsic::kImpulseResponse) {
    grid.intrinsic_lags = std::max<Index>(
        2, static_cast<Index>(std::lround(options.intrinsic_irf_s * grid.rate)) / grid.irf_step);
    grid.ahead = grid.intrinsic_lags * grid.irf_step;
    grid.back = std::max(grid.back, grid.ahead);
  }
  return grid;
}

// The intrinsic path's linear block: [a v x] or lags of x, then the static powers.
Matrix intrinsic_columns(const std::vector<CascadeTrial>& trials, const CascadeSample& sample,
                         const Grid& grid) {
  const auto motion = [&](Index column) {
    return gather(sample, 0,
                  [&](int t) { return trials[static_cast<std::size_t>(t)].motion.col(column); });
  };
  const Index powers = trials.front().powers.cols();
  const Index lags = grid.intrinsic_lags;
  const Index path = lags > 0 ? 2 * lags + 1 : 3;
  Matrix out(sample.rows(), path + powers);
  if (lags == 0) {
    for (Index k = 0; k < 3; ++k) out.col(k) = motion(2 - k);
  } else {
    for (Index k = -lags; k <= lags; ++k) {
      out.col(k + lags) = gather(sample, k * grid.irf_step, [&](int t) {
        return trials[static_cast<std::size_t>(t)].motion.col(0);
      });
    }
  }
  for (Index k = 0; k < powers; ++k) {
    out.col(path + k) =
        gather(sample, 0, [&](int t) { return trials[static_cast<std::size_t>(t)].powers.col(k); });
  }
  return out;
}

// Basis of a few columns by Gram and Schmidt, twice; what is a copy of the others is left out.
Matrix orthonormal(Matrix columns) {
  Index rank = 0;
  for (Index k = 0; k < columns.cols(); ++k) {
    Vector column = columns.col(k);
    const double before = column.norm();
    for (int pass = 0; pass < 2; ++pass) {
      const Vector along = columns.leftCols(rank).transpose() * column;
      column -= columns.leftCols(rank) * along;
    }
    if (column.norm() > 1e-6 * before) columns.col(rank++) = column.normalized();
  }
  return columns.leftCols(rank);
}

struct Evaluation {
  Vector residual;  // less offsets and past
  Vector theta;     // of the intrinsic block, then of the reflex column
};

// The cascade on one set of rows. Nonlinear parameters q: log omega, log zeta (order 2), delay.
class Cascade {
 public:
  Cascade(const std::vector<CascadeTrial>& trials, const CascadeSample& sample, const Grid& grid,
          const ReflexOptions& options)
      : trials_(&trials),
        sample_(&sample),
        grid_(grid),
        options_(&options),
        offsets_(sample, options.drift),
        linear_(intrinsic_columns(trials, sample, grid)) {
    torque_ = offsets_.removed(gather(
        sample, 0, [&](int t) { return trials[static_cast<std::size_t>(t)].torque.col(0); }));
    offsets_.remove(linear_);
    penalty_ = Matrix::Zero(0, linear_.cols());
    gram_ = linear_.transpose() * linear_;
  }

  const Matrix& linear() const noexcept { return linear_; }
  const Vector& torque() const noexcept { return torque_; }
  const CascadeSample& sample() const noexcept { return *sample_; }
  const Matrix& penalty() const noexcept { return penalty_; }

  // Ridge on the lags of the intrinsic impulse response, as rows below the data.
  void set_penalty(double penalty) {
    const Index lags = 2 * grid_.intrinsic_lags + 1;
    const Matrix shape = ridge_shape(linear_);
    penalty_ = Matrix::Zero(lags, linear_.cols());
    for (Index k = 0; k < lags; ++k) {
      penalty_(k, k) = std::sqrt(penalty * static_cast<double>(linear_.rows()) * shape(k, k));
    }
    gram_ = linear_.transpose() * linear_ + penalty_.transpose() * penalty_;
  }

  CausalElement element(const Vector& q) const {
    const int order = options_->order;
    return {order, std::exp(q[0]), order == 2 ? std::exp(q[1]) : 1.0};
  }
  double delay(const Vector& q) const { return q[options_->order]; }

  Vector reflex(const Vector& q) const {
    return offsets_.removed(reflex_column(*trials_, *sample_, element(q), delay(q), grid_.step));
  }

  // What a trial's unknown past can explain, as an orthonormal basis of each run it reaches.
  std::vector<PastRun> pasts(const Vector& q) const {
    std::vector<PastRun> out = past_columns(*trials_, *sample_, element(q), delay(q), grid_.step);
    for (PastRun& past : out) {
      Matrix whole = Matrix::Zero(sample_->rows(), past.columns.cols());
      whole.middleRows(past.first, past.columns.rows()) = past.columns;
      offsets_.remove(whole);
      past.columns = orthonormal(whole.middleRows(past.first, past.columns.rows()));
    }
    return out;
  }

  static void remove_past(const std::vector<PastRun>& pasts, Eigen::Ref<Matrix> columns) {
    for (const PastRun& past : pasts) {
      auto part = columns.middleRows(past.first, past.columns.rows());
      const Matrix along = past.columns.transpose() * part;
      part.noalias() -= past.columns * along;
    }
  }

  Evaluation evaluate(const Vector& q) const {
    const Index p = linear_.cols();
    const Vector column = reflex(q);
    const std::vector<PastRun> past = pasts(q);
    // Inner products without the past: those with it, less those of what lies along its basis.
    Matrix gram(p + 1, p + 1);
    gram.topLeftCorner(p, p) = gram_;
    gram.col(p).head(p) = linear_.transpose() * column;
    gram(p, p) = column.squaredNorm();
    for (const PastRun& run : past) {
      const Index rows = run.columns.rows();
      Matrix along(run.columns.cols(), p + 1);
      along.leftCols(p) = run.columns.transpose() * linear_.middleRows(run.first, rows);
      along.col(p) = run.columns.transpose() * column.segment(run.first, rows);
      gram -= along.transpose() * along;
    }
    gram.row(p).head(p) = gram.col(p).head(p).transpose();
    const Vector norms = gram.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Matrix unit =
        norms.cwiseInverse().asDiagonal() * gram * norms.cwiseInverse().asDiagonal();
    const Eigen::LDLT<Matrix> factor(unit);
    // A second pass gives back the digits that the Gram matrix costs.
    Evaluation out;
    out.theta = Vector::Zero(p + 1);
    out.residual = torque_;
    remove_past(past, out.residual);
    for (int pass = 0; pass < 2; ++pass) {
      Vector right(p + 1);
      right.head(p) = linear_.transpose() * out.residual;
      right.head(p) -= penalty_.transpose() * (penalty_ * out.theta.head(p));
      right[p] = column.dot(out.residual);
      out.theta +=
          norms.cwiseInverse().cwiseProduct(factor.solve(norms.cwiseInverse().cwiseProduct(right)));
      out.residual = torque_ - linear_ * out.theta.head(p) - column * out.theta[p];
      remove_past(past, out.residual);
    }
    return out;
  }

  // The intrinsic block and the reflex column, less offsets and past.
  Matrix columns(const Vector& q) const {
    Matrix out(linear_.rows(), linear_.cols() + 1);
    out << linear_, reflex(q);
    remove_past(pasts(q), out);
    return out;
  }

  // Residual with the linear parameters kept: what the delay and dynamics do by themselves.
  Vector residual_with(const Vector& q, const Vector& theta) const {
    const Index p = linear_.cols();
    Vector left = torque_ - linear_ * theta.head(p) - theta[p] * reflex(q);
    remove_past(pasts(q), left);
    return left;
  }

  BoxProblem problem(double delay_low, double delay_high) const {
    const int order = options_->order;
    BoxProblem out;
    const Index n = order + 1;
    out.low.resize(n);
    out.high.resize(n);
    out.scale = Vector::Constant(n, 0.3);
    out.low[0] = std::log(kLeastOmega);
    out.high[0] = std::log(2.0 * kPi * 0.25 * grid_.rate / static_cast<double>(grid_.stride));
    if (order == 2) {
      out.low[1] = std::log(kZetaLow);
      out.high[1] = std::log(kZetaHigh);
    }
    out.low[order] = delay_low;
    out.high[order] = delay_high;
    out.scale[order] = 0.01;
    out.residual = [this](const Vector& q) {
      const Evaluation e = evaluate(q);
      Vector all(e.residual.size() + penalty_.rows());
      all << e.residual, penalty_ * e.theta.head(linear_.cols());
      return all;
    };
    return out;
  }

 private:
  const std::vector<CascadeTrial>* trials_;
  const CascadeSample* sample_;
  Grid grid_;
  const ReflexOptions* options_;
  RunOffsets offsets_;
  Matrix linear_;
  Vector torque_;
  Matrix penalty_;
  Matrix gram_;  // of the linear block, penalty included
};

Vector nonlinear(const ReflexOptions& options, double omega, double zeta, double delay) {
  Vector q(options.order + 1);
  q[0] = std::log(omega);
  if (options.order == 2) q[1] = std::log(zeta);
  q[options.order] = delay;
  return q;
}

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

// Cost over the delay, all else refitted: outwards from the best, each point from its neighbour.
struct Profile {
  Vector delay, cost;
};

Profile profile_delay(const Cascade& cascade, const ReflexOptions& options, const BoxSolution& best,
                      double delay_error, Token* token) {
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
  Profile out;
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

// Where the profile leaves the 95 % region; the range's end where it does not. statistic = (cost -
// least) * weight is chi-square of one degree.
void profile_interval(const Profile& profile, double centre, double weight, double& low,
                      double& high) {
  Index middle = 0;
  profile.cost.minCoeff(&middle);
  for (Index i = 0; i < profile.delay.size(); ++i) {
    if (profile.delay[i] == centre) middle = i;
  }
  const double least = profile.cost[middle];
  const auto root = [&](Index i) {
    return std::sqrt(std::max(0.0, profile.cost[i] - least) * weight);
  };
  const auto walk = [&](Index direction) {
    double before = 0.0;
    Index i = middle + direction;
    for (; i >= 0 && i < profile.delay.size(); i += direction) {
      const double now = root(i);
      if (now > kQuantile) {
        const double share = (kQuantile - before) / (now - before);
        const double from = profile.delay[i - direction];
        return from + share * (profile.delay[i] - from);
      }
      before = now;
    }
    return profile.delay[i - direction];
  };
  low = walk(-1);
  high = walk(1);
}

struct Fitted {
  int side = 1;
  BoxSolution solution;
  Vector theta;          // intrinsic block, then the gain
  Vector theta_without;  // intrinsic block alone
  double penalty = 0.0;
  double cost_without = 0.0;
  double total = 0.0;  // of the torque
};

Vector fit_without(const Cascade& cascade) {
  Matrix stacked(cascade.linear().rows() + cascade.penalty().rows(), cascade.linear().cols());
  stacked << cascade.linear(), cascade.penalty();
  Vector right = Vector::Zero(stacked.rows());
  right.head(cascade.torque().size()) = cascade.torque();
  return stacked.householderQr().solve(right);
}

Fitted fit_cascade(Cascade& cascade, const ReflexOptions& options, int side, Token* token) {
  Fitted out;
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
    out.penalty = ridge_fit(columns, cascade.torque(), shape).penalty;
    cascade.set_penalty(out.penalty);
  }
  out.theta_without = fit_without(cascade);
  out.cost_without = (cascade.torque() - cascade.linear() * out.theta_without).squaredNorm();
  out.total = cascade.torque().squaredNorm();
  out.solution = search(cascade, options, token);
  out.theta = cascade.evaluate(out.solution.parameters).theta;
  return out;
}

double vaf_of_cost(const Fitted& fitted) {
  return fitted.total > 0.0 ? 100.0 * (1.0 - fitted.solution.cost / fitted.total) : kNaN;
}

// M, B and K that describe an intrinsic impulse response best for this motion.
Matrix natural_map(const std::vector<CascadeTrial>& trials, const Cascade& cascade,
                   const ReflexOptions& options, const Grid& grid) {
  const Index p = cascade.linear().cols();
  if (grid.intrinsic_lags == 0) {
    Matrix map = Matrix::Zero(3, p);
    map.leftCols(3).setIdentity();
    return map;
  }
  Grid plain = grid;
  plain.intrinsic_lags = 0;
  Matrix motion = intrinsic_columns(trials, cascade.sample(), plain).leftCols(3);
  RunOffsets(cascade.sample(), options.drift).remove(motion);
  const Index lags = 2 * grid.intrinsic_lags + 1;
  Matrix map = Matrix::Zero(3, p);
  map.leftCols(lags) = motion.householderQr().solve(cascade.linear().leftCols(lags));
  return map;
}

struct Uncertain {
  ReflexFit fit;
  Profile profile;
};

Uncertain uncertainty(const std::vector<CascadeTrial>& trials, const Cascade& cascade,
                      const ReflexOptions& options, const Grid& grid, const Fitted& fitted,
                      double effective_hz, double position_mean, Token* token) {
  const Index p = cascade.linear().cols();
  const Index order = options.order;
  const Index n = p + 1 + order + 1;
  const Vector& q = fitted.solution.parameters;
  const Evaluation at = cascade.evaluate(q);
  Matrix jacobian(at.residual.size(), n);
  jacobian.leftCols(p + 1) = cascade.columns(q);
  BoxProblem kept = cascade.problem(options.delay_min_s, options.delay_max_s);
  kept.residual = [&](const Vector& moved) { return cascade.residual_with(moved, at.theta); };
  jacobian.rightCols(order + 1) = -residual_jacobian(kept, q);
  // A parameter at its bound is held there.
  for (Index k = 0; k <= order; ++k) {
    if (k == order) continue;  // the delay's interval comes from its profile
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
  const double rate = grid.rate / static_cast<double>(grid.stride);
  Index longest = 1;
  for (const auto& run : cascade.sample().runs) longest = std::max(longest, run.count);
  const Index lag =
      std::min(static_cast<Index>(std::lround(options.hac_lag_s * rate)), longest / 2);
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
  Uncertain out;
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
      fit.interval(0, k) = value * std::exp(-kQuantile * error / value);
      fit.interval(1, k) = value * std::exp(kQuantile * error / value);
    } else {
      fit.interval(0, k) = value - kQuantile * error;
      fit.interval(1, k) = value + kQuantile * error;
    }
  }
  const double delay_variance = covariance(n - 1, n - 1);
  out.profile = profile_delay(cascade, options, fitted.solution,
                              std::sqrt(std::max(0.0, delay_variance)), token);
  // The profile's cost in units in which its curvature tells the honest variance.
  const double weight = delay_variance > 0.0 ? bread(n - 1, n - 1) / delay_variance : 0.0;
  if (weight > 0.0) {
    profile_interval(out.profile, fit.value[kReflexDelay], weight, fit.interval(0, kReflexDelay),
                     fit.interval(1, kReflexDelay));
  }
  return out;
}

// Is there a rectified path at all? Scores of many elements over the range, of every side allowed.
ScoreTest test_reflex(const Prepared& prepared, const std::vector<Span>& spans,
                      const ReflexOptions& options, const Grid& grid, const Cascade& cascade,
                      const Fitted& fitted, const std::vector<int>& sides, double position_mean,
                      Token* token) {
  const Vector residual = cascade.torque() - cascade.linear() * fitted.theta_without;
  const double rate = grid.rate / static_cast<double>(grid.stride);
  const auto blocks =
      score_blocks(cascade.sample().bounds, static_cast<Index>(options.block_s * rate));
  const Eigen::HouseholderQR<Matrix> qr(cascade.linear());
  const Matrix basis =
      qr.householderQ() * Matrix::Identity(cascade.linear().rows(), cascade.linear().cols());
  std::vector<Matrix> candidates;
  for (const int side : sides) {
    const auto trials = cascade_trials(prepared, options, side, position_mean);
    const CascadeSample sample =
        cascade_sample(trials, spans, grid.back, grid.ahead, grid.stride, 2 + options.drift);
    const RunOffsets offsets(sample, options.drift);
    for (const double omega : {6.0, 15.0, 45.0}) {
      for (int k = 0; k < 5; ++k) {
        step(token, 0.8);
        const double delay = options.delay_min_s + 0.25 * static_cast<double>(k) *
                                                       (options.delay_max_s - options.delay_min_s);
        const CausalElement element{options.order, omega, 0.8};
        Vector column = offsets.removed(reflex_column(trials, sample, element, delay, grid.step));
        column -= basis * (basis.transpose() * column);
        Matrix sums(static_cast<Index>(blocks.size()), 1);
        for (std::size_t b = 0; b < blocks.size(); ++b) {
          const Index count = blocks[b].second - blocks[b].first;
          sums(static_cast<Index>(b), 0) =
              column.segment(blocks[b].first, count).dot(residual.segment(blocks[b].first, count));
        }
        if (sums.squaredNorm() > 0.0) candidates.push_back(std::move(sums));
      }
    }
  }
  return score_test(candidates, options.draws, options.seed, token);
}

// Paths of one trial at every prepared row, in the sign of -F.
struct Paths {
  Vector intrinsic, without, reflex;
  Index first = 0, last = 0;  // rows where all are known
};

Paths paths_of(const CascadeTrial& trial, const Grid& grid, const ReflexOptions& options,
               const Fitted& fitted) {
  const Index rows = trial.torque.size();
  const Index lags = grid.intrinsic_lags;
  const Index path = lags > 0 ? 2 * lags + 1 : 3;
  Paths out;
  out.first = std::min(rows, trial.edge + grid.back);
  out.last = std::max(out.first, rows - trial.edge - grid.ahead);
  const auto intrinsic = [&](const Vector& theta) {
    Vector torque = Vector::Zero(rows);
    if (lags == 0) {
      torque = trial.motion * Vector(theta.head(3).reverse());
    } else {
      for (Index k = -lags; k <= lags; ++k) {
        const Index shift = k * grid.irf_step;
        torque.segment(out.first, out.last - out.first) +=
            theta[k + lags] * trial.motion.col(0).segment(out.first - shift, out.last - out.first);
      }
    }
    return Vector(torque + trial.powers * theta.segment(path, trial.powers.cols()));
  };
  out.intrinsic = intrinsic(fitted.theta);
  out.without = intrinsic(fitted.theta_without);
  const Vector& q = fitted.solution.parameters;
  const CausalElement element{options.order, std::exp(q[0]),
                              options.order == 2 ? std::exp(q[1]) : 1.0};
  const Matrix response = element_response(element, trial.drive, grid.step);
  out.reflex.resize(rows);
  const double delay = q[options.order] / grid.step;
  for (Index i = 0; i < rows; ++i) {
    out.reflex[i] = fitted.theta[fitted.theta.size() - 1] *
                    delayed_value(response, grid.step, static_cast<double>(i) - delay);
  }
  return out;
}

// Sums of squares of a block, each about the mean of its run.
struct BlockSums {
  double torque = 0.0, both = 0.0, intrinsic = 0.0, reflex = 0.0, without = 0.0;

  void add(const BlockSums& other) {
    torque += other.torque;
    both += other.both;
    intrinsic += other.intrinsic;
    reflex += other.reflex;
    without += other.without;
  }
};

std::vector<BlockSums> validation_blocks(const std::vector<CascadeTrial>& trials,
                                         const std::vector<Paths>& paths,
                                         const std::vector<Span>& spans, double block_rows) {
  std::vector<BlockSums> out;
  for (const Span& span : spans) {
    const auto t = static_cast<std::size_t>(span.trial);
    const Index first = std::max(span.begin, paths[t].first);
    const Index last = std::min(span.end, paths[t].last);
    if (last - first < 10) continue;
    const Index rows = last - first;
    const auto centred = [&](const Vector& values) {
      return Vector(values.array() - values.mean());
    };
    const Vector y = centred(trials[t].torque.segment(first, rows));
    const Vector i = centred(paths[t].intrinsic.segment(first, rows));
    const Vector r = centred(paths[t].reflex.segment(first, rows));
    const Vector w = centred(paths[t].without.segment(first, rows));
    const Index pieces =
        std::max<Index>(1, static_cast<Index>(static_cast<double>(rows) / block_rows));
    for (Index k = 0; k < pieces; ++k) {
      const Index at = rows * k / pieces;
      const Index count = rows * (k + 1) / pieces - at;
      const auto square = [&](const Vector& values) {
        return values.segment(at, count).squaredNorm();
      };
      out.push_back({square(y), square(y - i - r), square(y - i), square(y - r), square(y - w)});
    }
  }
  return out;
}

void validate_paths(ReflexEstimate& out, const std::vector<BlockSums>& held_out,
                    const std::vector<BlockSums>& train, std::uint64_t seed) {
  const auto sum = [](const std::vector<BlockSums>& blocks) {
    BlockSums total;
    for (const BlockSums& block : blocks) total.add(block);
    return total;
  };
  const auto vaf = [](double error, double torque) {
    return torque > 0.0 ? 100.0 * (1.0 - error / torque) : kNaN;
  };
  const BlockSums all = sum(held_out);
  out.vaf = vaf(all.both, all.torque);
  out.vaf_intrinsic = vaf(all.intrinsic, all.torque);
  out.vaf_reflex = vaf(all.reflex, all.torque);
  out.vaf_without = vaf(all.without, all.torque);
  const BlockSums seen = sum(train);
  out.vaf_train = vaf(seen.both, seen.torque);
  out.vaf_train_without = vaf(seen.without, seen.torque);
  for (double* interval : {out.vaf_interval, out.gain_interval}) interval[0] = interval[1] = kNaN;
  if (held_out.size() < 5) return;
  std::vector<double> vafs, gains;
  for (Index r = 0; r < kVafReplicates; ++r) {
    Random random(seed, kVafStream + static_cast<std::uint64_t>(r));
    BlockSums drawn;
    for (std::size_t b = 0; b < held_out.size(); ++b) {
      drawn.add(held_out[static_cast<std::size_t>(
          random.below(static_cast<std::int64_t>(held_out.size())))]);
    }
    vafs.push_back(vaf(drawn.both, drawn.torque));
    gains.push_back(vafs.back() - vaf(drawn.without, drawn.torque));
  }
  out.vaf_interval[0] = sample_quantile(vafs, 0.025);
  out.vaf_interval[1] = sample_quantile(vafs, 0.975);
  out.gain_interval[0] = sample_quantile(gains, 0.025);
  out.gain_interval[1] = sample_quantile(gains, 0.975);
}

// Both paths as impulse responses, ridge on the intrinsic lags and roughness on the reflex's.
ReflexImpulse impulse_responses(const std::vector<CascadeTrial>& trials,
                                const std::vector<Span>& train, const std::vector<Span>& held_out,
                                const ReflexOptions& options, const Grid& plain) {
  ReflexImpulse out;
  out.vaf = kNaN;
  if (options.reflex_irf_s <= 0.0) return out;
  ReflexOptions with = options;
  with.intrinsic = Intrinsic::kImpulseResponse;
  Grid grid = plain;
  grid.intrinsic_lags = std::max<Index>(
      2, static_cast<Index>(std::lround(options.intrinsic_irf_s * grid.rate)) / grid.irf_step);
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
      cascade_sample(trials, train, grid.back, grid.ahead, grid.stride, 2 + options.drift);
  const Index lags = 2 * grid.intrinsic_lags + 1;
  const Index powers = options.position_powers - 1;
  const Index width = lags + powers + reflex_lags + 1;
  if (sample.rows() < 3 * width) return out;
  Vector torque;
  const Matrix columns = columns_of(sample, torque);
  // Roughness of the reflex's response in units of its own columns.
  Matrix shape = ridge_shape(columns);
  const double drive = shape.diagonal().tail(reflex_lags + 1).mean();
  shape.diagonal().tail(powers + reflex_lags + 1).setZero();
  shape.topLeftCorner(lags, lags) *= 1e-3;
  shape.bottomRightCorner(reflex_lags + 1, reflex_lags + 1) = drive * roughness(reflex_lags + 1);
  const Ridge ridge = ridge_fit(columns, torque, shape);
  const Vector residual = torque - columns * ridge.theta;
  const double rate = grid.rate / static_cast<double>(grid.stride);
  Index longest = 1;
  for (const auto& run : sample.runs) longest = std::max(longest, run.count);
  const Index lag =
      std::min(static_cast<Index>(std::lround(options.hac_lag_s * rate)), longest / 2);
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
  out.available = true;
  const CascadeSample rest =
      cascade_sample(trials, held_out, grid.back, grid.ahead, grid.stride, 10 + options.drift);
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

Matrix trial_signals(const Record& record, const PreparedTrial& prepared, const CascadeTrial& trial,
                     const Paths& paths, const ReflexOptions& options, int side, int index,
                     const Split& split) {
  const Index rows = prepared.rows();
  Matrix out(rows, 6);
  out.col(0) = Eigen::Map<const Vector>(record.time().data() + prepared.begin(), rows);
  out.col(1) = prepared.force().col(0);
  out.col(2) = -paths.intrinsic;
  out.col(3) = -paths.reflex;
  out.col(4) = (side * trial.motion.col(1).array() - options.threshold).max(0.0) * side;
  for (Index c = 2; c <= 3; ++c) {
    out.col(c).head(paths.first).setConstant(kNaN);
    out.col(c).tail(rows - paths.last).setConstant(kNaN);
  }
  out.col(5).setZero();
  const auto mark = [&](const std::vector<Span>& spans, double value) {
    for (const Span& span : spans) {
      if (span.trial == index)
        out.col(5).segment(span.begin, span.end - span.begin).setConstant(value);
    }
  };
  mark(split.train, 1.0);
  mark(split.held_out, 2.0);
  return out;
}

void check_options(const ReflexOptions& o) {
  const auto between = [](double value, double low, double high) {
    return std::isfinite(value) && value >= low && value <= high;
  };
  require(o.side >= -1 && o.side <= 1, "side", "the side is +1, -1, or 0 for the better of both");
  require(o.order == 1 || o.order == 2, "order", "the order of the reflex dynamics is 1 or 2");
  require(o.position_powers >= 1 && o.position_powers <= 5, "position_powers",
          "powers of the position go from 1 to at most 5");
  require(o.drift >= 0 && o.drift <= 3, "drift", "the drift is a polynomial of order 0 to 3");
  require(between(o.threshold, 0.0, 1e6), "threshold",
          "the velocity threshold must be a number of at least 0");
  require(between(o.delay_min_s, 0.0, 1e6), "delay_min_s", "the least delay must be at least 0 s");
  require(between(o.delay_max_s, 0.0, 1e6) && o.delay_max_s > o.delay_min_s, "delay_max_s",
          "the range of the delay must have a length: delay_max_s above delay_min_s");
  require(between(o.intrinsic_irf_s, 1e-6, 10.0), "intrinsic_irf_s",
          "the intrinsic impulse response must reach a positive time, at most 10 s");
  require(between(o.reflex_irf_s, 0.0, 10.0), "reflex_irf_s",
          "the reflex impulse response must last from 0 to 10 s");
  require(between(o.train_s, 0.0, 1e9), "train_s", "the time to identify from must be positive");
  require(between(o.hac_lag_s, 1e-9, 1e6), "lag_s",
          "the lag of the standard errors must be positive");
  require(between(o.block_s, 1e-9, 1e6), "block_s", "the length of a block must be positive");
  require(o.draws >= 99 && o.draws <= 10'000'000, "draws",
          "the test needs from 99 to ten million draws");
  require(between(o.level, 1e-12, 1.0), "level", "the level of the test lies between 0 and 1");
  require(between(o.poor_vaf, 0.0, 100.0), "poor_vaf", "poor_vaf is a percentage, from 0 to 100");
  require(o.threads >= 0, "threads", "the number of threads must not be negative");
}

double mean_position(const Prepared& prepared, const std::vector<Span>& spans) {
  double sum = 0.0;
  Index rows = 0;
  for (const Span& span : spans) {
    const PreparedTrial& trial = prepared.trials[static_cast<std::size_t>(span.trial)];
    sum += trial.position().col(0).segment(span.begin, span.end - span.begin).sum();
    rows += span.end - span.begin;
  }
  return rows > 0 ? sum / static_cast<double>(rows) : 0.0;
}

void require_determined(const Cascade& cascade) {
  const Vector norms = cascade.linear().colwise().norm().transpose();
  const Matrix unit = cascade.linear() * norms.cwiseMax(1e-300).cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Matrix> svd(unit.transpose() * unit);
  const Vector& s = svd.singularValues();
  if (std::sqrt(s[0] / std::max(s[s.size() - 1], 1e-300)) < kConditionLimit) return;
  throw Error(Fault::kAnalysis, "record",
              "the motion does not tell inertia, damping and stiffness apart: perturb with more "
              "than one frequency");
}

void require_rows(const CascadeSample& sample, const Grid& grid, Index parameters) {
  if (sample.rows() >= 10 * parameters) return;
  throw Error(Fault::kData, "delay_max_s",
              sentence(3, "only ", sample.rows(), " samples are left to identify ", parameters,
                       " parameters from: delays and impulse responses take ",
                       static_cast<double>(grid.back) / grid.rate,
                       " s at the start of every trial; record longer or narrow the delay range"));
}

}  // namespace

ReflexEstimate identify_reflex(const Record& record, const ReflexOptions& options, Token* token) {
  check_options(options);
  const Roles all = find_roles(record, options.position, options.force, "");
  require(all.position.size() == 1, "position",
          "a reflex is identified at one joint; the record names " +
              std::to_string(all.position.size()) + " positions: choose one and its torque");
  const Roles roles{all.position, all.force, {}};
  const Prepared prepared = prepare(record, roles, options.prepare, options.threads, token);
  const Grid grid = make_grid(prepared.report, options);
  const Split split = split_rows(record, prepared, options.train_s);

  ReflexEstimate out;
  out.options = options;
  out.report = prepared.report;
  out.consistency = derivative_consistency(prepared);
  out.axis = record.channels()[static_cast<std::size_t>(roles.position[0])].name;
  out.rotational = record.channels()[static_cast<std::size_t>(roles.position[0])].unit == "rad";
  out.train_s = split.train_s;
  out.refitted = options.refit == ReflexRefit::kYes ||
                 (options.refit == ReflexRefit::kAuto && split.segmented);
  out.train_rows = row_count(split.train);
  out.held_out_rows = row_count(split.held_out);
  const double mean = mean_position(prepared, split.train);
  const Index least_run = 2 + options.drift;

  // One side or both, judged by what they leave of the identification part.
  std::vector<int> sides;
  if (options.side >= 0) sides.push_back(1);
  if (options.side <= 0) sides.push_back(-1);
  std::vector<Fitted> fits;
  std::vector<std::vector<CascadeTrial>> trials_of;
  std::vector<CascadeSample> sample_of;
  std::vector<int> moved;
  for (const int side : sides) {
    auto trials = cascade_trials(prepared, options, side, mean);
    CascadeSample sample =
        cascade_sample(trials, split.train, grid.back, grid.ahead, grid.stride, least_run);
    require_rows(sample, grid,
                 3 + 2 * grid.intrinsic_lags + options.position_powers + options.order);
    double drive = 0.0;
    for (const CascadeTrial& trial : trials)
      drive = std::max(drive, trial.drive.cwiseAbs().maxCoeff());
    if (!(drive > 0.0)) continue;
    Cascade cascade(trials, sample, grid, options);
    if (grid.intrinsic_lags == 0) require_determined(cascade);  // else the ridge does
    fits.push_back(fit_cascade(cascade, options, side, token));
    trials_of.push_back(std::move(trials));
    sample_of.push_back(std::move(sample));
    moved.push_back(side);
  }
  if (fits.empty()) {
    throw Error(
        Fault::kAnalysis, "threshold",
        sentence(3, "the velocity never passes ", options.threshold,
                 " rad/s on the side that excites, so there is no reflex to identify: lower "
                 "the threshold or change the side"));
  }
  std::size_t chosen = 0;
  if (fits.size() == 2 && fits[1].solution.cost < fits[0].solution.cost) chosen = 1;
  out.side = fits[chosen].side;
  out.vaf_train_other = fits.size() == 2 ? vaf_of_cost(fits[1 - chosen]) : kNaN;
  const std::vector<CascadeTrial>& trials = trials_of[chosen];
  const Fitted& trained = fits[chosen];

  // Validation by the fit that has not seen the held-out rows.
  std::vector<Paths> paths;
  for (const CascadeTrial& trial : trials) {
    paths.push_back(paths_of(trial, grid, options, trained));
  }
  validate_paths(out, validation_blocks(trials, paths, split.held_out, options.block_s * grid.rate),
                 validation_blocks(trials, paths, split.train, options.block_s * grid.rate),
                 options.seed);

  // The reported fit, its uncertainty, and the test on the same rows.
  const std::vector<Span>& spans = out.refitted ? split.all : split.train;
  const CascadeSample sample =
      cascade_sample(trials, spans, grid.back, grid.ahead, grid.stride, least_run);
  Cascade cascade(trials, sample, grid, options);
  Fitted reported = trained;
  if (out.refitted) {
    reported = fit_cascade(cascade, options, out.side, token);
  } else if (options.intrinsic == Intrinsic::kImpulseResponse) {
    cascade.set_penalty(trained.penalty);
  }
  Uncertain uncertain = uncertainty(trials, cascade, options, grid, reported,
                                    prepared.report.effective_cutoff_hz, mean, token);
  out.fit = std::move(uncertain.fit);
  out.profile_delay_s = uncertain.profile.delay;
  out.profile_vaf = 100.0 * (1.0 - uncertain.profile.cost.array() / reported.total);
  const ScoreTest test =
      test_reflex(prepared, spans, options, grid, cascade, reported, moved, mean, token);
  out.p_value = test.p_value;
  out.test_blocks = test.blocks;
  out.impulse = impulse_responses(trials, split.train, split.held_out, options, grid);

  if (out.refitted) {
    for (std::size_t t = 0; t < trials.size(); ++t) {
      paths[t] = paths_of(trials[t], grid, options, reported);
    }
  }
  for (std::size_t t = 0; t < trials.size(); ++t) {
    out.signals.push_back(trial_signals(record, prepared.trials[t], trials[t], paths[t], options,
                                        out.side, static_cast<int>(t), split));
  }
  const BoxProblem box = cascade.problem(options.delay_min_s, options.delay_max_s);
  const Vector& q = reported.solution.parameters;
  for (Index k = 0; k < q.size(); ++k) {
    const double slack = 1e-6 * (box.high[k] - box.low[k]);
    if (q[k] > box.low[k] + slack && q[k] < box.high[k] - slack) continue;
    out.outcome |= k == options.order ? kReflexDelayAtBound : kReflexDynamicsAtBound;
  }
  out.provenance = record.provenance();
  explain_reflex(out);
  return out;
}

}  // namespace ulna
