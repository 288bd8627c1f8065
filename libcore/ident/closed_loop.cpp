#include "ident/closed_loop.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "signal/spectrum.hpp"
#include "stats/distributions.hpp"

namespace ulna {

MotionShare motion_share(const Prepared& prepared, double band_hz) {
  MotionShare out;
  const Index m = static_cast<Index>(prepared.roles.reference.size());
  const Index n = static_cast<Index>(prepared.roles.position.size());
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
  Matrix signals(rows, m + n);
  for (std::size_t t = 0; t < trials.size(); ++t) {
    const PreparedTrial& trial = prepared.trials[t];
    const auto every = Eigen::seqN(0, trials[t].end - trials[t].begin, stride);
    const auto rows_of_trial = Eigen::seqN(trials[t].begin, trials[t].end - trials[t].begin);
    signals(rows_of_trial, Eigen::seqN(0, m)) = trial.reference()(every, Eigen::all);
    signals(rows_of_trial, Eigen::seqN(m, n)) = trial.position()(every, Eigen::all);
    if (trials[t].end - trials[t].begin >= segment) ranges.push_back(trials[t]);
  }
  const Spectra spectra = welch(signals, rate, segment, ranges);
  const double averages = spectra.effective_averages;
  if (averages <= static_cast<double>(m) + 1.0) return out;

  double peak = 0.0;
  for (const auto& s : spectra.s) peak = std::max(peak, s.topLeftCorner(m, m).trace().real());
  std::vector<Index> bins;
  for (Index k = 1; k < spectra.freq_hz.size() && spectra.freq_hz[k] <= band_hz; ++k) bins.push_back(k);
  out.freq_hz.resize(static_cast<Index>(bins.size()));
  out.share.resize(static_cast<Index>(bins.size()), n);
  Vector unexplained = Vector::Zero(n);
  Vector power = Vector::Zero(n);
  const double debias = averages / (averages - static_cast<double>(m));
  for (std::size_t b = 0; b < bins.size(); ++b) {
    const auto row = static_cast<Index>(b);
    const Eigen::MatrixXcd& s = spectra.s[static_cast<std::size_t>(bins[b])];
    out.freq_hz[row] = spectra.freq_hz[bins[b]];
    // Pseudo-inverse: between the lines of a multisine the reference has no power, and explains none.
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXcd> eigen(s.topLeftCorner(m, m));
    for (Index i = 0; i < n; ++i) {
      const Eigen::VectorXcd cross = eigen.eigenvectors().adjoint() * s.block(0, m + i, m, 1);
      double explained = 0.0;
      for (Index j = 0; j < m; ++j) {
        if (eigen.eigenvalues()[j] > 1e-12 * peak) {
          explained += std::norm(cross[j]) / eigen.eigenvalues()[j];
        }
      }
      const double total = s(m + i, m + i).real();
      const double rest = std::clamp((total - explained) * debias, 0.0, total);
      out.share(row, i) = total > 0.0 ? rest / total : 0.0;
      unexplained[i] += rest;
      power[i] += total;
    }
  }
  out.total = (power.array() > 0.0).select(unexplained.cwiseQuotient(power), 0.0);
  return out;
}

DifferenceTest difference_test(const Fit& instrumental, const Fit& least_squares,
                               const Matrix& joint_covariance) {
  const Index k = instrumental.theta.size();
  DifferenceTest test;
  test.difference = (least_squares.theta - instrumental.theta).reshaped();
  const Matrix covariance = joint_covariance.topLeftCorner(k, k) +
                            joint_covariance.bottomRightCorner(k, k) -
                            joint_covariance.topRightCorner(k, k) -
                            joint_covariance.bottomLeftCorner(k, k);
  test.standard_error = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  // In units of the standard errors, through the eigenvalues that are not rounding: constrained
  // parameters leave the covariance singular.
  const Vector scale =
      (test.standard_error.array() > 0.0).select(test.standard_error.cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(scale.asDiagonal() * covariance *
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

// Newey-West variance of the last coefficient of a just- or over-identified regression, by the scores
// of that coefficient alone.
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
  const Index stride = std::max<Index>(1, static_cast<Index>(rate / (10.0 * band)));
  const Design design(prepared, 0.0, spans);
  const Index n = design.axes();
  const Index m = static_cast<Index>(prepared.roles.reference.size());
  const Index p = design.regressors();
  const bool instrumental = estimator == Estimator::kInstrumental;
  const Index q = instrumental ? design.instruments() + m : 0;

  Index rows = 0;
  for (const Span& span : spans) rows += std::max<Index>(0, (span.end - span.begin - 3) / stride + 1);
  if (rows < 4 * (p + 1 + q)) return out;

  // Third derivatives of force and reference by central differences of the filtered signals.
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
        instruments.row(at).tail(m) = 0.5 * rate * (trial.reference_acceleration().row(row + 1) -
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
    const Matrix z = scaled(instruments);
    basis = Eigen::HouseholderQR<Matrix>(z).householderQ() * Matrix::Identity(rows, q);
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
