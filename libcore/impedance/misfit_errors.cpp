#include "impedance/misfit_errors.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "base/random.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

struct Left {
  Vector values;
  Matrix space;  // orthonormal columns: what was taken off
};

Left left_by_line(const Matrix& x, const Vector& y) {
  Eigen::ColPivHouseholderQR<Matrix> qr(x);
  qr.setThreshold(1e-8);
  Left left;
  left.space = qr.householderQ() * Matrix::Identity(x.rows(), qr.rank());
  left.values = y - left.space * (left.space.transpose() * y);
  return left;
}

// (X'X)^-1 X' Omega X (X'X)^-1 with the errors' covariance by Newey and West, within each trial.
Matrix hac_covariance(const Record& record, const Matrix& x, const Vector& errors,
                      const Matrix& inverse, Index lag) {
  const Matrix scores = x.array().colwise() * errors.array();
  Matrix meat = Matrix::Zero(x.cols(), x.cols());
  for (const Trial& trial : record.trials()) {
    const Index rows = trial.end - trial.begin;
    const auto s = scores.middleRows(trial.begin, rows);
    meat += s.transpose() * s;
    for (Index l = 1; l <= std::min(lag, rows - 1); ++l) {
      const Matrix g = s.bottomRows(rows - l).transpose() * s.topRows(rows - l);
      const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lag + 1);
      meat += weight * (g + g.transpose());
    }
  }
  return inverse * meat * inverse;
}

// Parameters refitted to the line and resampled blocks of the errors.
Matrix bootstrap_replicates(const Matrix& x, const Vector& errors, const Matrix& inverse,
                            const ViscoelasticOptions& o, Index block, Token* token) {
  const Index rows = x.rows();
  const Matrix project = inverse * x.transpose();
  Matrix replicates(o.bootstrap, x.cols());
  Vector drawn(rows);
  for (Index i = 0; i < o.bootstrap; ++i) {
    step(token, static_cast<double>(i) / static_cast<double>(o.bootstrap));
    Random random(o.seed, static_cast<std::uint64_t>(i));
    for (Index at = 0; at < rows; at += block) {
      const Index from = random.below(rows - block + 1);
      const Index count = std::min(block, rows - at);
      drawn.segment(at, count) = errors.segment(from, count);
    }
    // Blocks of a whole that has no mean have one each.
    drawn.array() -= drawn.mean();
    replicates.row(i) = (project * drawn).transpose();
  }
  return replicates;
}

// What the covariance above would be on average for white errors of variance 1, from which the
// columns of `space` were taken.
Matrix white_expectation(const Record& record, const Matrix& x, const Matrix& space,
                         const Matrix& inverse, Index lag) {
  Matrix meat = Matrix::Zero(x.cols(), x.cols());
  for (const Trial& trial : record.trials()) {
    const Index rows = trial.end - trial.begin;
    const auto q = space.middleRows(trial.begin, rows);
    const auto z = x.middleRows(trial.begin, rows);
    for (Index l = 0; l <= std::min(lag, rows - 1); ++l) {
      Vector left = -q.bottomRows(rows - l).cwiseProduct(q.topRows(rows - l)).rowwise().sum();
      if (l == 0) left.array() += 1.0;
      const Matrix g = z.bottomRows(rows - l).transpose() * left.asDiagonal() * z.topRows(rows - l);
      const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lag + 1);
      meat += l == 0 ? g : Matrix(weight * (g + g.transpose()));
    }
  }
  return inverse * meat * inverse;
}

// Taking off a line takes off the slow part of the errors, which is what the line is sensitive to.
// For white errors the loss is known: the factor by which each standard error was too small.
Vector lost_share(const Record& record, const Matrix& x, const Left& left, const Matrix& inverse,
                  Index lag) {
  const Matrix kept = white_expectation(record, x, left.space, inverse, lag);
  return inverse.diagonal()
      .cwiseQuotient(kept.diagonal().cwiseMax(1e-2 * inverse.diagonal()))
      .cwiseSqrt();
}

Index rows_of_seconds(const Record& record, double seconds, Index least, Index most) {
  return std::clamp<Index>(static_cast<Index>(std::lround(seconds * record.rate_hz())), least,
                           std::max(least, most));
}

// With lags of a share b of the rows, the variance by Bartlett weights varies like that of
// Student's t with 1.5 / b degrees of freedom (Kiefer and Vogelsang 2005, to first order in b).
MisfitErrors hac_errors(const Record& record, const Matrix& x, const Left& left,
                        const Matrix& inverse, const ViscoelasticOptions& o) {
  Index longest = 0;
  for (const Trial& trial : record.trials()) longest = std::max(longest, trial.end - trial.begin);
  const Index lag = rows_of_seconds(record, o.hac_lag_s, 0, longest / 4);
  const Matrix covariance = hac_covariance(record, x, left.values, inverse, lag);
  MisfitErrors e;
  e.error = covariance.diagonal().cwiseMax(0.0).cwiseSqrt().cwiseProduct(
      lost_share(record, x, left, inverse, lag));
  const auto rows = static_cast<double>(x.rows());
  const double dof = std::min(1.5 * rows / static_cast<double>(lag + 1),
                              std::max(1.0, rows - static_cast<double>(left.space.cols())));
  e.half_high = student_quantile(0.5 + 0.5 * o.level, dof) * e.error;
  e.half_low = e.half_high;
  return e;
}

MisfitErrors bootstrap_errors(const Record& record, const Matrix& x, const Left& left,
                              const Matrix& inverse, const ViscoelasticOptions& o, Token* token) {
  const Index rows = x.rows();
  const Index block = rows_of_seconds(record, o.block_s, 1, rows);
  if (rows / block < 5) {
    throw Error(Fault::kData, "errors",
                "a bootstrap over " + std::to_string(rows / block) +
                    " blocks says nothing: shorten block_s or use Newey-West errors");
  }
  // Blocks keep a lag l in one of 1 - l / block of the places, which are Bartlett's weights.
  const Vector lost = lost_share(record, x, left, inverse, block - 1);
  const Matrix replicates =
      bootstrap_replicates(x, left.values, inverse, o, block, token) * lost.asDiagonal();
  MisfitErrors e;
  const Matrix centred = replicates.rowwise() - replicates.colwise().mean();
  e.error =
      (centred.colwise().squaredNorm().transpose() / static_cast<double>(replicates.rows() - 1))
          .cwiseSqrt();
  e.half_low.resize(x.cols());
  e.half_high.resize(x.cols());
  for (Index c = 0; c < x.cols(); ++c) {
    const std::vector<double> sample(replicates.col(c).data(),
                                     replicates.col(c).data() + replicates.rows());
    // The estimate less the true value is distributed as a replicate less the estimate.
    e.half_low[c] = sample_quantile(sample, 0.5 + 0.5 * o.level);
    e.half_high[c] = -sample_quantile(sample, 0.5 - 0.5 * o.level);
  }
  return e;
}

}  // namespace

MisfitErrors misfit_errors(const Record& record, const Matrix& x, const Vector& torque,
                           const Matrix& inverse, const ViscoelasticOptions& options,
                           Token* token) {
  const Left left = left_by_line(x, torque);
  return options.errors == ErrorModel::kNeweyWest
             ? hac_errors(record, x, left, inverse, options)
             : bootstrap_errors(record, x, left, inverse, options, token);
}

}  // namespace ulna
