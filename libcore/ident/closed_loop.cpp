#include "ident/closed_loop.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "signal/spectrum.hpp"
#include "stats/distributions.hpp"

namespace ulna {

namespace {

// Power of signals per frequency, and the part of it that the references do not explain.
struct Unexplained {
  Vector freq_hz;
  Matrix power;  // frequencies x signals
  Matrix rest;
};

// signals(trial, rows): `columns` signals of a trial at those rows. Empty without a reference or
// with too little data.
using Rows = Eigen::ArithmeticSequence<Index, Index, Index>;

template <class Signals>
Unexplained unexplained_power(const Prepared& prepared, Index columns, double band_hz,
                              const Signals& signals) {
  Unexplained out;
  const Index m = static_cast<Index>(prepared.roles.reference.size());
  if (m == 0) return out;

  // Nothing is left above a few times the band: every stride-th row carries all of it.
  const Index stride =
      std::max<Index>(1, static_cast<Index>(prepared.report.rate_hz / (8.0 * band_hz)));
  const double rate = prepared.report.rate_hz / static_cast<double>(stride);
  Index rows = 0;
  Index longest = 0;
  std::vector<RowRange> trials;
  for (const PreparedTrial& trial : prepared.trials) {
    const Index count = trial.rows() / stride;
    trials.push_back({rows, rows + count});
    longest = std::max(longest, count);
    rows += count;
  }
  // Eight seconds resolve the lines of a slow multisine; at least about nine averages come first.
  const Index segment = std::min<Index>(static_cast<Index>(8.0 * rate), longest / 5) / 2 * 2;
  if (segment < 32) return out;
  std::vector<RowRange> ranges;
  Matrix all(rows, m + columns);
  for (std::size_t t = 0; t < trials.size(); ++t) {
    const Index count = trials[t].end - trials[t].begin;
    const Rows every = Eigen::seqN(Index{0}, count, stride);
    auto here = all.middleRows(trials[t].begin, count);
    here.leftCols(m) = prepared.trials[t].reference()(every, Eigen::all);
    here.rightCols(columns) = signals(prepared.trials[t], every);
    if (count >= segment) ranges.push_back(trials[t]);
  }
  const Spectra spectra = welch(all, rate, segment, ranges);
  const double averages = spectra.effective_averages;
  if (averages <= static_cast<double>(m) + 1.0) return out;

  double peak = 0.0;
  for (const auto& s : spectra.s) peak = std::max(peak, s.topLeftCorner(m, m).trace().real());
  Index bins = 0;
  while (bins + 1 < spectra.freq_hz.size() && spectra.freq_hz[bins + 1] <= band_hz) ++bins;
  out.freq_hz = spectra.freq_hz.segment(1, bins);
  out.power.resize(bins, columns);
  out.rest.resize(bins, columns);
  const double debias = averages / (averages - static_cast<double>(m));
  for (Index row = 0; row < bins; ++row) {
    const Eigen::MatrixXcd& s = spectra.s[static_cast<std::size_t>(row + 1)];
    // Pseudo-inverse: between the lines of a multisine the reference has no power, and explains
    // none.
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXcd> eigen(s.topLeftCorner(m, m));
    for (Index i = 0; i < columns; ++i) {
      const Eigen::VectorXcd cross = eigen.eigenvectors().adjoint() * s.block(0, m + i, m, 1);
      double explained = 0.0;
      for (Index j = 0; j < m; ++j) {
        if (eigen.eigenvalues()[j] > 1e-12 * peak) {
          explained += std::norm(cross[j]) / eigen.eigenvalues()[j];
        }
      }
      const double total = s(m + i, m + i).real();
      out.power(row, i) = total;
      out.rest(row, i) = std::clamp((total - explained) * debias, 0.0, total);
    }
  }
  return out;
}

}  // namespace

MotionShare motion_share(const Prepared& prepared, double band_hz) {
  const Index n = static_cast<Index>(prepared.roles.position.size());
  const Unexplained motion =
      unexplained_power(prepared, n, band_hz, [](const PreparedTrial& trial, const Rows& rows) {
        return Matrix(trial.position()(rows, Eigen::all));
      });
  MotionShare out;
  if (motion.power.size() == 0) return out;
  const auto share = [](const auto& rest, const auto& power) {
    return (power.array() > 0.0).select(rest.array() / power.array(), 0.0).matrix().eval();
  };
  out.freq_hz = motion.freq_hz;
  out.share = share(motion.rest, motion.power);
  const Vector rest = motion.rest.colwise().sum().transpose();
  const Vector power = motion.power.colwise().sum().transpose();
  out.total = share(rest, power);
  return out;
}

Vector reference_vaf(const Prepared& prepared, const Matrix& theta, const Vector& position_mean,
                     double payload_kg, double band_hz) {
  const Index n = theta.cols();
  const auto residual_and_force = [&](const PreparedTrial& trial, const Rows& rows) {
    const Matrix acceleration = trial.acceleration()(rows, Eigen::all);
    const Matrix velocity = trial.velocity()(rows, Eigen::all);
    const Matrix position = trial.position()(rows, Eigen::all);
    Matrix out(rows.size(), 2 * n);
    out.rightCols(n) = trial.force()(rows, Eigen::all);
    out.leftCols(n) = out.rightCols(n) + acceleration * theta.topRows(n) +
                      payload_kg * acceleration + velocity * theta.middleRows(n, n) +
                      (position.rowwise() - position_mean.transpose()) * theta.middleRows(2 * n, n);
    out.leftCols(n).rowwise() += theta.row(3 * n);
    return out;
  };
  const Unexplained both = unexplained_power(prepared, 2 * n, band_hz, residual_and_force);
  if (both.power.size() == 0) {
    return Vector::Constant(n, std::numeric_limits<double>::quiet_NaN());
  }
  const Vector explained = (both.power - both.rest).colwise().sum().transpose();
  return 100.0 * (1.0 - explained.head(n).array() / explained.tail(n).array());
}

DifferenceTest difference_test(const Fit& instrumental, const Fit& least_squares,
                               const Matrix& joint_covariance) {
  const Index k = instrumental.theta.size();
  DifferenceTest test;
  test.difference = (least_squares.theta - instrumental.theta).reshaped();
  const Matrix covariance =
      joint_covariance.topLeftCorner(k, k) + joint_covariance.bottomRightCorner(k, k) -
      joint_covariance.topRightCorner(k, k) - joint_covariance.bottomLeftCorner(k, k);
  // Without noise both estimates agree to rounding, and a difference of rounding errors over a
  // standard error of rounding errors means nothing: nothing below a millionth of a parameter
  // counts.
  const Vector floor = 1e-6 * instrumental.theta.reshaped().cwiseAbs();
  test.standard_error = (covariance.diagonal().cwiseMax(0.0) + floor.cwiseAbs2()).cwiseSqrt();
  // In units of the standard errors, through the eigenvalues that are not rounding: constrained
  // parameters leave the covariance singular.
  const Vector scale =
      (test.standard_error.array() > 0.0).select(test.standard_error.cwiseInverse(), 0.0);
  Matrix floored = covariance;
  floored.diagonal() = test.standard_error.cwiseAbs2();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(scale.asDiagonal() * floored *
                                                    scale.asDiagonal());
  const Vector along = eigen.eigenvectors().transpose() * scale.cwiseProduct(test.difference);
  const double largest = std::max(eigen.eigenvalues().maxCoeff(), 0.0);
  for (Index j = 0; j < k; ++j) {
    const double variance = eigen.eigenvalues()[j];
    if (variance <= 1e-9 * largest || variance <= 0.0) continue;
    test.statistic += along[j] * along[j] / variance;
    test.degrees += 1.0;
  }
  if (test.degrees > 0.0) test.p_value = chi_square_tail(test.statistic, test.degrees);
  return test;
}

namespace {

constexpr Index kMostLagRows = 200000;  // enough for any check, and a bound on memory

// Newey-West variance of the last coefficient of a just- or over-identified regression, by the
// scores of that coefficient alone.
double bartlett_variance(const Vector& score, Index lag) {
  double sum = score.squaredNorm();
  for (Index l = 1; l <= std::min(lag, score.size() - 1); ++l) {
    const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lag + 1);
    sum += 2.0 * weight * score.head(score.size() - l).dot(score.tail(score.size() - l));
  }
  return std::max(sum, 0.0);
}

}  // namespace

LagCheck check_lag(const Prepared& prepared, const std::vector<Span>& spans, Estimator estimator,
                   double hac_lag_s) {
  LagCheck out;
  const double rate = prepared.report.rate_hz;
  const double band = prepared.report.lowpass_hz > 0.0 ? prepared.report.lowpass_hz : 0.1 * rate;
  // The signals hold nothing above a few times the low pass: ten samples a period of it carry all.
  const Index stride = std::max<Index>(
      {1, static_cast<Index>(rate / (10.0 * band)), row_count(spans) / kMostLagRows});
  const Design design(prepared, 0.0, spans);
  const Index n = design.axes();
  const Index m = static_cast<Index>(prepared.roles.reference.size());
  const Index p = design.regressors();
  const bool instrumental = estimator == Estimator::kInstrumental;
  const Index q = instrumental ? design.instruments() + m : 0;

  Index rows = 0;
  for (const Span& span : spans)
    rows += std::max<Index>(0, (span.end - span.begin - 3) / stride + 1);
  if (rows < 4 * (p + 1 + q)) return out;

  // F' and the reference's third derivative by central differences of the filtered signals.
  Matrix regressors(rows, p);
  Matrix instruments(rows, q);
  Matrix outputs(rows, n);
  Matrix force_rate(rows, n);
  Matrix one(1, design.columns());
  Index at = 0;
  for (const Span& span : spans) {
    const PreparedTrial& trial = prepared.trials[static_cast<std::size_t>(span.trial)];
    for (Index row = span.begin + 1; row < span.end - 1; row += stride, ++at) {
      design.fill(span.trial, row, 1, one);
      regressors.row(at) = one.middleCols(design.instruments(), p);
      outputs.row(at) = one.rightCols(n);
      force_rate.row(at) = 0.5 * rate * (trial.force().row(row + 1) - trial.force().row(row - 1));
      if (instrumental) {
        instruments.row(at).head(q - m) = one.leftCols(q - m);
        instruments.row(at).tail(m) = 0.5 * rate *
                                      (trial.reference_acceleration().row(row + 1) -
                                       trial.reference_acceleration().row(row - 1));
      }
    }
  }
  rows = at;
  const auto scaled = [rows](const Matrix& columns) {
    const Vector norms = columns.topRows(rows).colwise().norm().transpose();
    return Matrix(columns.topRows(rows) * norms.cwiseMax(1e-300).cwiseInverse().asDiagonal());
  };
  Matrix basis;  // orthonormal columns that span the instruments
  if (instrumental) {
    Eigen::ColPivHouseholderQR<Matrix> independent(scaled(instruments));
    independent.setThreshold(1e-6);
    basis = independent.householderQ() * Matrix::Identity(rows, independent.rank());
  }
  const auto project = [&](const Matrix& columns) {
    return instrumental ? Matrix(basis * (basis.transpose() * columns)) : columns;
  };
  const Matrix phi = scaled(regressors);
  const Matrix phi_seen = project(phi);
  const Eigen::HouseholderQR<Matrix> qr(phi_seen);
  const Matrix span_basis = qr.householderQ() * Matrix::Identity(rows, p);
  const Index hac_lag = static_cast<Index>(hac_lag_s * rate / static_cast<double>(stride));

  // Frisch-Waugh: regress what the other regressors leave of the output on what they leave of F'.
  double weight_sum = 0.0;
  double weighted = 0.0;
  for (Index i = 0; i < n; ++i) {
    const Vector rate_seen = project(force_rate.topRows(rows).col(i));
    const Vector left = rate_seen - span_basis * (span_basis.transpose() * rate_seen);
    const double power = left.squaredNorm();
    if (!(power > 1e-10 * rate_seen.squaredNorm())) continue;
    const Vector y = outputs.topRows(rows).col(i);
    const double lag = left.dot(y) / power;
    const Vector theta = qr.solve(project(y - lag * force_rate.topRows(rows).col(i)));
    const Vector residual = y - lag * force_rate.topRows(rows).col(i) - phi * theta;
    const double variance =
        bartlett_variance(left.cwiseProduct(residual), hac_lag) / (power * power);
    const double weight = 1.0 / std::max(variance, 1e-18);
    weight_sum += weight;
    weighted += weight * lag;
  }
  if (weight_sum <= 0.0) return out;
  out.available = true;
  out.lag_s = weighted / weight_sum;
  out.standard_error_s = 1.0 / std::sqrt(weight_sum);
  return out;
}

}  // namespace ulna
