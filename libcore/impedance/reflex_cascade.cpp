#include "impedance/reflex_cascade.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "impedance/ridge.hpp"

namespace ulna {
namespace {

constexpr double kLeastOmega = 1.0;  // rad/s
constexpr double kZetaLow = 0.1, kZetaHigh = 5.0;

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

void remove_past_of(const std::vector<PastRun>& pasts, Eigen::Ref<Matrix> columns) {
  for (const PastRun& past : pasts) {
    auto part = columns.middleRows(past.first, past.columns.rows());
    const Matrix along = past.columns.transpose() * part;
    part.noalias() -= past.columns * along;
  }
}

}  // namespace

CascadeGrid make_grid(const PrepareReport& report, const ReflexOptions& options) {
  CascadeGrid grid;
  grid.rate = report.rate_hz;
  grid.step = 1.0 / grid.rate;
  const double band = report.lowpass_order > 0 ? report.lowpass_hz : 0.25 * grid.rate;
  grid.stride = std::max<Index>(1, static_cast<Index>(grid.rate / (5.0 * band)));
  grid.irf_step = std::max<Index>(1, static_cast<Index>(std::lround(grid.rate / (4.0 * band))));
  grid.back = static_cast<Index>(std::ceil(options.delay_max_s * grid.rate - 1e-9)) + 2;
  if (options.intrinsic == Intrinsic::kImpulseResponse) {
    grid.intrinsic_lags = lags_either_side(grid, options);
    grid.ahead = grid.intrinsic_lags * grid.irf_step;
    grid.back = std::max(grid.back, grid.ahead);
  }
  return grid;
}

Index lags_either_side(const CascadeGrid& grid, const ReflexOptions& options) {
  return std::max<Index>(
      2, static_cast<Index>(std::lround(options.intrinsic_irf_s * grid.rate)) / grid.irf_step);
}

Matrix intrinsic_columns(const std::vector<CascadeTrial>& trials, const CascadeSample& sample,
                         const CascadeGrid& grid) {
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

Cascade::Cascade(const std::vector<CascadeTrial>& trials, const CascadeSample& sample,
                 const CascadeGrid& grid, const ReflexOptions& options)
    : trials_(&trials),
      sample_(&sample),
      grid_(grid),
      options_(&options),
      offsets_(sample, options.drift),
      linear_(intrinsic_columns(trials, sample, grid)) {
  torque_ = offsets_.removed(
      gather(sample, 0, [&](int t) { return trials[static_cast<std::size_t>(t)].torque.col(0); }));
  offsets_.remove(linear_);
  penalty_ = Matrix::Zero(0, linear_.cols());
  gram_ = linear_.transpose() * linear_;
}

void Cascade::set_penalty(double penalty) {
  const Index lags = 2 * grid_.intrinsic_lags + 1;
  const Matrix shape = ridge_shape(linear_);
  penalty_ = Matrix::Zero(lags, linear_.cols());
  for (Index k = 0; k < lags; ++k) {
    penalty_(k, k) = std::sqrt(penalty * static_cast<double>(linear_.rows()) * shape(k, k));
  }
  gram_ = linear_.transpose() * linear_ + penalty_.transpose() * penalty_;
}

CausalElement Cascade::element(const Vector& q) const {
  const int order = options_->order;
  return {order, std::exp(q[0]), order == 2 ? std::exp(q[1]) : 1.0};
}

Vector Cascade::reflex(const Vector& q) const {
  return offsets_.removed(reflex_column(*trials_, *sample_, element(q), delay(q), grid_.step));
}

// What a trial's unknown past can explain, as an orthonormal basis of each run it reaches.
std::vector<PastRun> Cascade::pasts(const Vector& q) const {
  std::vector<PastRun> out = past_columns(*trials_, *sample_, element(q), delay(q), grid_.step);
  for (PastRun& past : out) {
    offsets_.remove_in_run(past.run, past.columns);
    past.columns = orthonormal(past.columns);
  }
  return out;
}

CascadeEvaluation Cascade::evaluate(const Vector& q) const {
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
  const Matrix unit = norms.cwiseInverse().asDiagonal() * gram * norms.cwiseInverse().asDiagonal();
  const Eigen::LDLT<Matrix> factor(unit);
  // A second pass gives back the digits that the Gram matrix costs.
  CascadeEvaluation out;
  out.theta = Vector::Zero(p + 1);
  out.residual = torque_;
  remove_past_of(past, out.residual);
  for (int pass = 0; pass < 2; ++pass) {
    Vector right(p + 1);
    right.head(p) = linear_.transpose() * out.residual;
    right.head(p) -= penalty_.transpose() * (penalty_ * out.theta.head(p));
    right[p] = column.dot(out.residual);
    out.theta +=
        norms.cwiseInverse().cwiseProduct(factor.solve(norms.cwiseInverse().cwiseProduct(right)));
    out.residual = torque_ - linear_ * out.theta.head(p) - column * out.theta[p];
    remove_past_of(past, out.residual);
  }
  return out;
}

Matrix Cascade::columns(const Vector& q) const {
  Matrix out(linear_.rows(), linear_.cols() + 1);
  out << linear_, reflex(q);
  remove_past_of(pasts(q), out);
  return out;
}

Vector Cascade::residual_with(const Vector& q, const Vector& theta) const {
  const Index p = linear_.cols();
  Vector left = torque_ - linear_ * theta.head(p) - theta[p] * reflex(q);
  remove_past_of(pasts(q), left);
  return left;
}

BoxProblem Cascade::problem(double delay_low, double delay_high) const {
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
    const CascadeEvaluation e = evaluate(q);
    Vector all(e.residual.size() + penalty_.rows());
    all << e.residual, penalty_ * e.theta.head(linear_.cols());
    return all;
  };
  return out;
}

Vector nonlinear(const ReflexOptions& options, double omega, double zeta, double delay) {
  Vector q(options.order + 1);
  q[0] = std::log(omega);
  if (options.order == 2) q[1] = std::log(zeta);
  q[options.order] = delay;
  return q;
}

}  // namespace ulna
