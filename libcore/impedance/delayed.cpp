#include "impedance/delayed.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/words.hpp"
#include "impedance/causal_element.hpp"
#include "impedance/profile.hpp"
#include "impedance/scores.hpp"
#include "impedance/split.hpp"
#include "impedance/words.hpp"

namespace ulna {
namespace {

constexpr Index kDelayPoints = 41;

// Every stride-th row of spans of prepared trials that has the longest delay behind it.
struct Rows {
  std::vector<std::pair<int, Index>> at;  // trial, prepared row
  Runs runs;
};

Rows rows_of(const std::vector<Span>& spans, Index back, Index stride) {
  Rows out;
  for (const Span& span : spans) {
    Index count = 0;
    for (Index row = std::max(span.begin, back); row < span.end; row += stride, ++count) {
      out.at.emplace_back(span.trial, row);
    }
    if (count > 0) out.runs.add(count);
  }
  return out;
}

class Feedback {
 public:
  Feedback(const Prepared& prepared, Rows rows, const Vector& mean, const Vector& reference_mean,
           const DelayedOptions& options, bool instrumental)
      : prepared_(&prepared),
        rows_(std::move(rows)),
        mean_(mean),
        reference_mean_(reference_mean),
        n_(mean.size()),
        m_(static_cast<Index>(prepared.roles.reference.size())),
        step_s_(1.0 / prepared.report.rate_hz) {
    const Index count = static_cast<Index>(rows_.at.size());
    force_.resize(count, n_);
    for (Index i = 0; i < count; ++i) force_.row(i) = -trial(i).force().row(row(i));
    if (!instrumental || count == 0) return;
    // The reference at once and at delays over the range: what could cause the motion and its past.
    constexpr Index kDelays = 4;
    Matrix z(count, (3 + 2 * kDelays) * m_ + 1);
    for (Index i = 0; i < count; ++i) {
      const PreparedTrial& t = trial(i);
      Index c = 0;
      const auto put = [&](const auto& values) {
        z.row(i).segment(c, m_) = values;
        c += m_;
      };
      put(t.reference_acceleration().row(row(i)));
      put(t.reference_rate().row(row(i)));
      put(t.reference().row(row(i)) - reference_mean_.transpose());
      for (Index k = 0; k < kDelays; ++k) {
        const double delay = options.delay_min_s + (options.delay_max_s - options.delay_min_s) *
                                                       static_cast<double>(k) /
                                                       static_cast<double>(kDelays - 1);
        for (Index a = 0; a < m_; ++a) {
          z(i, c++) = past(t.reference().col(a), t.reference_rate().col(a), row(i), delay) -
                      reference_mean_[a];
        }
        for (Index a = 0; a < m_; ++a) {
          z(i, c++) =
              past(t.reference_rate().col(a), t.reference_acceleration().col(a), row(i), delay);
        }
      }
      z(i, c) = 1.0;
    }
    const Vector norms = z.colwise().norm().transpose().cwiseMax(1e-300);
    const Eigen::ColPivHouseholderQR<Matrix> qr(z * norms.cwiseInverse().asDiagonal());
    Index rank = 0;
    const Index most = std::min(count, z.cols());
    while (rank < most && std::abs(qr.matrixR()(rank, rank)) > 1e-9) ++rank;
    instruments_ = qr.householderQ() * Matrix::Identity(count, rank);
  }

  Index n() const noexcept { return n_; }
  Index count() const noexcept { return force_.rows(); }
  const Matrix& force() const noexcept { return force_; }
  const Runs& runs() const noexcept { return rows_.runs; }
  bool instrumental() const noexcept { return instruments_.size() > 0; }

  // [a v x x(t - delay) v(t - delay) 1], positions about their mean.
  Matrix regressors(double delay) const {
    Matrix out(count(), 5 * n_ + 1);
    for (Index i = 0; i < count(); ++i) {
      const PreparedTrial& t = trial(i);
      const Index r = row(i);
      out.row(i).segment(0, n_) = t.acceleration().row(r);
      out.row(i).segment(n_, n_) = t.velocity().row(r);
      out.row(i).segment(2 * n_, n_) = t.position().row(r) - mean_.transpose();
      for (Index a = 0; a < n_; ++a) {
        out(i, 3 * n_ + a) = past(t.position().col(a), t.velocity().col(a), r, delay) - mean_[a];
        out(i, 4 * n_ + a) = past(t.velocity().col(a), t.acceleration().col(a), r, delay);
      }
      out(i, 5 * n_) = 1.0;
    }
    return out;
  }

  Matrix without_delay(const Matrix& regressors) const {
    Matrix out(regressors.rows(), 3 * n_ + 1);
    out << regressors.leftCols(3 * n_), regressors.rightCols(1);
    return out;
  }

  // In the coordinates that the estimator sees: rows themselves, or the instruments' span.
  Matrix seen(const Matrix& columns) const {
    if (!instrumental()) return columns;
    return instruments_.transpose() * columns;
  }
  // The same as rows: columns themselves, or their projection on the instruments.
  Matrix projected(const Matrix& columns) const {
    if (!instrumental()) return columns;
    return instruments_ * (instruments_.transpose() * columns);
  }

  struct Solution {
    Matrix theta;  // (5 n + 1) x n
    double cost = 0.0;
  };
  Solution solve(const Matrix& regressors) const {
    const Matrix x = seen(regressors);
    const Matrix y = seen(force_);
    const Vector norms = x.colwise().norm().transpose().cwiseMax(1e-300);
    const Matrix unit = x * norms.cwiseInverse().asDiagonal();
    Solution out;
    out.theta = norms.cwiseInverse().asDiagonal() * Matrix(unit.householderQr().solve(y));
    out.cost = (y - x * out.theta).squaredNorm();
    return out;
  }
  double cost(double delay) const { return solve(regressors(delay)).cost; }

 private:
  const PreparedTrial& trial(Index i) const {
    return prepared_->trials[static_cast<std::size_t>(rows_.at[static_cast<std::size_t>(i)].first)];
  }
  Index row(Index i) const { return rows_.at[static_cast<std::size_t>(i)].second; }

  // Value and rate give the cubic between two rows.
  template <class Values, class Rates>
  double past(const Values& values, const Rates& rates, Index at, double delay) const {
    const double place = static_cast<double>(at) - delay / step_s_;
    const Index k = std::clamp<Index>(static_cast<Index>(place), 0, values.size() - 2);
    return hermite(values[k], step_s_ * rates[k], values[k + 1], step_s_ * rates[k + 1],
                   place - static_cast<double>(k));
  }

  const Prepared* prepared_;
  Rows rows_;
  Vector mean_, reference_mean_;
  Index n_, m_;
  double step_s_;
  Matrix force_;
  Matrix instruments_;  // orthonormal
};

// Least cost between two points that bracket one minimum.
double golden_section(const Feedback& model, double low, double high) {
  const double ratio = 0.5 * (std::sqrt(5.0) - 1.0);
  double a = high - ratio * (high - low);
  double b = low + ratio * (high - low);
  double at_a = model.cost(a);
  double at_b = model.cost(b);
  for (int i = 0; i < 34; ++i) {
    if (at_a <= at_b) {
      high = b;
      b = a;
      at_b = at_a;
      a = high - ratio * (high - low);
      at_a = model.cost(a);
    } else {
      low = a;
      a = b;
      at_a = at_b;
      b = low + ratio * (high - low);
      at_b = model.cost(b);
    }
  }
  return 0.5 * (low + high);
}

struct Search {
  double delay = 0.0;
  Vector delays, costs;
};

Search search_delay(const Feedback& model, const DelayedOptions& options, Token* token) {
  Search out;
  out.delays = Vector::LinSpaced(kDelayPoints, options.delay_min_s, options.delay_max_s);
  out.costs.resize(kDelayPoints);
  for (Index k = 0; k < kDelayPoints; ++k) {
    step(token, 0.2 + 0.4 * static_cast<double>(k) / static_cast<double>(kDelayPoints));
    out.costs[k] = model.cost(out.delays[k]);
  }
  Index best = 0;
  out.costs.minCoeff(&best);
  out.delay = golden_section(model, out.delays[std::max<Index>(0, best - 1)],
                             out.delays[std::min(kDelayPoints - 1, best + 1)]);
  return out;
}

double condition_of(const Matrix& x) {
  const Vector norms = x.colwise().norm().transpose();
  if (!(norms.minCoeff() > 0.0)) return std::numeric_limits<double>::infinity();
  const Matrix unit = x * norms.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(unit.transpose() * unit,
                                                     Eigen::EigenvaluesOnly);
  const double least = solver.eigenvalues()[0];
  return least > 0.0 ? std::sqrt(solver.eigenvalues().maxCoeff() / least)
                     : std::numeric_limits<double>::infinity();
}

// Covariance of vec(theta) and the delay by Newey and West; bread: its inverse information.
Matrix covariance_of(const Feedback& model, const Matrix& regressors, const Matrix& theta,
                     const Matrix& slope, Index lag, Matrix& bread) {
  const Index n = model.n();
  const Index p = regressors.cols();
  const Index width = p * n + 1;
  const Matrix x = model.projected(regressors);
  const Matrix d = model.projected(slope);  // d force / d delay, rows x n
  const Matrix error = model.force() - regressors * theta;
  Matrix information = Matrix::Zero(width, width);
  const Matrix gram = x.transpose() * x;
  Matrix scores = Matrix::Zero(model.count(), width);
  for (Index i = 0; i < n; ++i) {
    information.block(i * p, i * p, p, p) = gram;
    const Vector cross = x.transpose() * d.col(i);
    information.block(i * p, p * n, p, 1) = cross;
    information.block(p * n, i * p, 1, p) = cross.transpose();
    information(p * n, p * n) += d.col(i).squaredNorm();
    scores.middleCols(i * p, p) = error.col(i).asDiagonal() * x;
    scores.col(p * n) += error.col(i).cwiseProduct(d.col(i));
  }
  const Vector norms = information.diagonal().cwiseMax(1e-300).cwiseSqrt();
  const Matrix scale = norms.cwiseInverse().asDiagonal();
  bread = scale * (scale * information * scale).ldlt().solve(Matrix(scale));
  return bread * bartlett_sum(scores, model.runs(), lag) * bread.transpose();
}

void natural_parameters(DelayedEstimate& out, const Matrix& theta, const Vector& mean, double delay,
                        const Matrix& covariance) {
  const Index n = out.n;
  const Index p = theta.rows();
  const auto matrix = [&](Index first) { return Matrix(theta.middleRows(first, n).transpose()); };
  out.m = matrix(0);
  out.b = matrix(n);
  out.k = matrix(2 * n);
  out.k_delayed = matrix(3 * n);
  out.b_delayed = matrix(4 * n);
  out.delay_s = delay;
  const Eigen::FullPivLU<Matrix> lu(out.k + out.k_delayed);
  const bool solvable = lu.isInvertible();
  const Matrix inverse = solvable ? Matrix(lu.inverse()) : Matrix::Constant(n, n, kNaN);
  const Vector offset = inverse * theta.row(5 * n).transpose();
  out.x0 = mean - offset;
  // M, B, K, K_d, B_d row by row stand in vec(theta) as entry (block n + j, i).
  const Index size = 5 * n * n + n + 1;
  Matrix map = Matrix::Zero(size, p * n + 1);
  for (Index block = 0; block < 5; ++block) {
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) map((block * n + i) * n + j, i * p + block * n + j) = 1.0;
    }
  }
  for (Index i = 0; i < n; ++i) {
    const auto row = 5 * n * n + i;
    for (Index r = 0; r < n; ++r) {
      for (Index j = 0; j < n; ++j) {
        map(row, r * p + 2 * n + j) = inverse(i, r) * offset[j];
        map(row, r * p + 3 * n + j) = inverse(i, r) * offset[j];
      }
      map(row, r * p + 5 * n) = -inverse(i, r);
    }
  }
  map(size - 1, p * n) = 1.0;
  out.covariance = map * covariance * map.transpose();
}

void profile_of(DelayedEstimate& out, const Feedback& model, const Search& search, double weight,
                const DelayedOptions& options) {
  std::vector<std::pair<double, double>> points;
  for (Index k = 0; k < search.delays.size(); ++k) {
    points.emplace_back(search.delays[k], search.costs[k]);
  }
  const double least = model.cost(search.delay);
  const double error = std::sqrt(
      std::max(0.0, out.covariance(out.covariance.rows() - 1, out.covariance.rows() - 1)));
  for (const double errors : {-3.0, -2.2, -1.8, -1.0, 0.0, 1.0, 1.8, 2.2, 3.0}) {
    const double at = search.delay + errors * error;
    if (at < options.delay_min_s || at > options.delay_max_s) continue;
    points.emplace_back(at, errors == 0.0 ? least : model.cost(at));
  }
  std::sort(points.begin(), points.end());
  out.profile_delay_s.resize(static_cast<Index>(points.size()));
  out.profile_statistic = out.profile_delay_s;
  for (Index k = 0; k < out.profile_delay_s.size(); ++k) {
    const auto& point = points[static_cast<std::size_t>(k)];
    out.profile_delay_s[k] = point.first;
    out.profile_statistic[k] = std::max(0.0, point.second - least) * weight;
  }
  const Eigen::Vector2d range =
      likely_range(out.profile_delay_s, out.profile_statistic.cwiseSqrt(), kQuantile95);
  out.delay_interval[0] = range[0];
  out.delay_interval[1] = range[1];
}

ScoreTest test_feedback(const Feedback& model, const DelayedOptions& options, double rate,
                        Token* token) {
  const Index n = model.n();
  const Matrix base = model.without_delay(model.regressors(options.delay_min_s));
  const Feedback::Solution plain = model.solve(base);
  const Matrix error = model.force() - base * plain.theta;
  const Matrix seen = model.projected(base);
  const Vector norms = seen.colwise().norm().transpose().cwiseMax(1e-300);
  const Eigen::HouseholderQR<Matrix> qr(seen * norms.cwiseInverse().asDiagonal());
  const Matrix basis = qr.householderQ() * Matrix::Identity(seen.rows(), seen.cols());
  const auto blocks = score_blocks(model.runs(), static_cast<Index>(options.block_s * rate));
  std::vector<Matrix> candidates;
  constexpr Index kDelays = 8;
  for (Index k = 0; k < kDelays; ++k) {
    step(token, 0.8);
    const double delay = options.delay_min_s + (options.delay_max_s - options.delay_min_s) *
                                                   static_cast<double>(k) /
                                                   static_cast<double>(kDelays - 1);
    Matrix columns = model.projected(model.regressors(delay).middleCols(3 * n, 2 * n));
    columns -= basis * (basis.transpose() * columns);
    Matrix sums(static_cast<Index>(blocks.size()), 2 * n * n);
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const Index rows = blocks[b].second - blocks[b].first;
      const Matrix products = columns.middleRows(blocks[b].first, rows).transpose() *
                              error.middleRows(blocks[b].first, rows);
      sums.row(static_cast<Index>(b)) =
          Eigen::Map<const Eigen::RowVectorXd>(products.data(), products.size());
    }
    candidates.push_back(std::move(sums));
  }
  return score_test(candidates, options.draws, options.seed, token);
}

void check_options(const DelayedOptions& o) {
  const auto between = [](double value, double low, double high) {
    return std::isfinite(value) && value >= low && value <= high;
  };
  require(between(o.delay_min_s, 0.0, 1e6), "delay_min_s", "the least delay must be at least 0 s");
  require(between(o.delay_max_s, 0.0, 1e6) && o.delay_max_s > o.delay_min_s, "delay_max_s",
          "the range of the delay must have a length: delay_max_s above delay_min_s");
  require(between(o.train_s, 0.0, 1e9), "train_s", "the time to identify from must be positive");
  require(between(o.hac_lag_s, 1e-9, 1e6), "lag_s",
          "the lag of the standard errors must be positive");
  require(between(o.block_s, 1e-9, 1e6), "block_s", "the length of a block must be positive");
  require(o.draws >= 99 && o.draws <= 10'000'000, "draws",
          "the test needs from 99 to ten million draws");
  require(between(o.level, 1e-12, 1.0), "level", "the level of the test lies between 0 and 1");
  require(between(o.condition_limit, 1e-9, 1e300), "condition_limit",
          "the limit of the condition number must be positive");
  require(between(o.poor_vaf, 0.0, 100.0), "poor_vaf", "poor_vaf is a percentage, from 0 to 100");
  require(o.threads >= 0, "threads", "the number of threads must not be negative");
}

Vector vaf_of(const Matrix& force, const Matrix& predicted) {
  Vector out = Vector::Constant(force.cols(), kNaN);
  if (force.rows() < 10) return out;
  for (Index i = 0; i < force.cols(); ++i) {
    const auto variance = [](const Vector& values) {
      return (values.array() - values.mean()).square().sum();
    };
    const double total = variance(force.col(i));
    if (total > 0.0) {
      out[i] = 100.0 * (1.0 - variance(force.col(i) - predicted.col(i)) / total);
    }
  }
  return out;
}

void explain(DelayedEstimate& e, const DelayedOptions& o) {
  bool negative_inertia = true;
  for (Index i = 0; i < e.n; ++i) {
    const Index at = i * e.n + i;
    negative_inertia = negative_inertia && e.m(i, i) < -3.0 * std::sqrt(e.covariance(at, at));
  }
  if (negative_inertia) {
    e.outcome |= kDelayedSuspectData;
    e.warnings.emplace_back(kNegativeInertia);
  }
  if (!std::isfinite(e.p_value)) {
    e.outcome |= kDelayedUntested;
    e.notes.push_back(sentence(3, "Only ", e.test_blocks,
                               " blocks: too few to test for delayed feedback; record longer or "
                               "shorten block_s."));
  } else if (e.p_value > o.level) {
    e.outcome |= kDelayedNotSignificant;
    e.warnings.push_back(sentence(2, "No delayed feedback is shown (p = ", e.p_value,
                                  "): its delay and its parameters mean nothing."));
  }
  if ((e.outcome & kDelayedAtBound) != 0 && (e.outcome & kDelayedNotSignificant) == 0) {
    e.warnings.push_back(sentence(
        3, "The delay's interval, ", 1e3 * e.delay_interval[0], " to ", 1e3 * e.delay_interval[1],
        " ms, reaches the end of its range: the data do not determine the delay, or the "
        "range is too narrow, or the feedback is not a single delay."));
  }
  if (e.condition > kIllCondition && (e.outcome & kDelayedNotSignificant) == 0) {
    e.outcome |= kDelayedIllConditioned;
    e.warnings.push_back(sentence(3,
                                  "The motion hardly tells the immediate from the delayed "
                                  "(condition number ",
                                  e.condition, "): perturb with more frequencies."));
  }
  for (Index i = 0; i < e.n; ++i) {
    if (!(e.vaf[i] < o.poor_vaf)) continue;
    e.outcome |= kDelayedPoorFit;
    e.warnings.push_back(
        sentence(3, "The model accounts for ", e.vaf[i], " % of the held-out force along ",
                 e.axes[static_cast<std::size_t>(i)], ", less than ", o.poor_vaf, " %."));
  }
  if (e.estimator == Estimator::kLeastSquares) {
    e.notes.push_back(
        "By least squares: biased when the human causes part of the motion; a reference for every "
        "axis would allow instrumental variables.");
  }
  e.provenance.push_back(sentence(
      6, "impedance with delayed feedback, delay ", o.delay_min_s, " to ", o.delay_max_s, " s, by ",
      e.estimator == Estimator::kInstrumental ? "instrumental variables" : "least squares"));
}

}  // namespace

DelayedEstimate identify_delayed(const Record& record, const DelayedOptions& options,
                                 Token* token) {
  check_options(options);
  Roles roles = find_roles(record, options.position, options.force, options.reference);
  const Index n = static_cast<Index>(roles.position.size());
  require(n <= 2, "position",
          "delayed feedback is identified along one or two axes; the record names " +
              std::to_string(n));
  const bool have_reference = roles.reference.size() >= roles.position.size();
  require(options.estimator != EstimatorChoice::kInstrumental || have_reference, "estimator",
          "instrumental variables need a reference channel for every axis");
  if (!have_reference) roles.reference.clear();
  const bool instrumental = have_reference && options.estimator != EstimatorChoice::kLeastSquares;
  const Prepared prepared = prepare(record, roles, options.prepare, options.threads, token);
  const Split split = split_rows(record, prepared, options.train_s);

  DelayedEstimate out;
  out.n = n;
  out.report = prepared.report;
  out.consistency = derivative_consistency(prepared);
  out.estimator = instrumental ? Estimator::kInstrumental : Estimator::kLeastSquares;
  for (const Index c : roles.position) {
    out.axes.push_back(record.channels()[static_cast<std::size_t>(c)].name);
  }
  out.rotational = record.channels()[static_cast<std::size_t>(roles.position[0])].unit == "rad";
  out.refitted = options.refit == Refit::kYes || (options.refit == Refit::kAuto && split.segmented);
  out.train_rows = row_count(split.train);
  out.held_out_rows = row_count(split.held_out);
  const double rate = prepared.report.rate_hz;
  const double band = prepared.report.lowpass_order > 0 ? prepared.report.lowpass_hz : 0.25 * rate;
  const Index stride = std::max<Index>(1, static_cast<Index>(rate / (5.0 * band)));
  const Index back = static_cast<Index>(std::ceil(options.delay_max_s * rate)) + 2;

  const auto mean_of = [&](const std::vector<Span>& spans, bool reference) {
    Vector sum = Vector::Zero(reference ? static_cast<Index>(roles.reference.size()) : n);
    for (const Span& span : spans) {
      const PreparedTrial& trial = prepared.trials[static_cast<std::size_t>(span.trial)];
      const Index rows = span.end - span.begin;
      if (reference) {
        sum += trial.reference().middleRows(span.begin, rows).colwise().sum().transpose();
      } else {
        sum += trial.position().middleRows(span.begin, rows).colwise().sum().transpose();
      }
    }
    return Vector(sum / static_cast<double>(std::max<Index>(1, row_count(spans))));
  };
  const Vector mean = mean_of(split.train, false);
  const Vector reference_mean = mean_of(split.train, true);
  const auto model_of = [&](const std::vector<Span>& spans, bool with_instruments) {
    return Feedback(prepared, rows_of(spans, back, stride), mean, reference_mean, options,
                    with_instruments);
  };
  const Index parameters = 5 * n + 2;
  const auto enough = [&](const Feedback& model) {
    if (model.count() >= 10 * parameters) return;
    throw Error(Fault::kData, "delay_max_s",
                sentence(3, "only ", model.count(), " samples are left to identify ", parameters,
                         " parameters an axis from: the longest delay takes ", options.delay_max_s,
                         " s at the start of every trial; record longer or narrow the range"));
  };

  const Feedback train = model_of(split.train, instrumental);
  enough(train);
  step(token, 0.1);
  const Search trained = search_delay(train, options, token);
  {
    const Matrix at = train.regressors(trained.delay);
    out.condition = condition_of(train.seen(at));
    // A delay near zero copies the immediate whatever the motion: the best delay of the range says
    // what the motion could tell.
    double best_condition = out.condition;
    for (Index k = 0; k < kDelayPoints; k += 8) {
      best_condition =
          std::min(best_condition, condition_of(train.seen(train.regressors(trained.delays[k]))));
    }
    if (!(best_condition <= options.condition_limit)) {
      throw Error(Fault::kAnalysis, "condition_limit",
                  sentence(3,
                           "the motion does not tell the immediate from the delayed response "
                           "(condition number ",
                           best_condition,
                           " at the best delay): perturb with more frequencies, or widen the range "
                           "of the delay"));
    }
    const Feedback held_out = model_of(split.held_out, false);
    const Matrix theta = train.solve(at).theta;
    const Matrix plain = train.solve(train.without_delay(at)).theta;
    const Matrix there =
        held_out.count() > 0 ? held_out.regressors(trained.delay) : Matrix(0, 5 * n + 1);
    out.vaf = vaf_of(held_out.force(), there * theta);
    out.vaf_without = vaf_of(held_out.force(), held_out.without_delay(there) * plain);
  }

  const Feedback all =
      out.refitted ? model_of(split.all, instrumental) : model_of(split.train, instrumental);
  const Search search = out.refitted ? search_delay(all, options, token) : trained;
  const Matrix regressors = all.regressors(search.delay);
  const Matrix theta = all.solve(regressors).theta;
  // d force / d delay by the delayed velocity and acceleration, to the order of the interpolation.
  const double small = 0.5 / rate;
  const double up = std::min(search.delay + small, options.delay_max_s);
  const double down = std::max(search.delay - small, options.delay_min_s);
  const Matrix slope = (all.regressors(up) - all.regressors(down)) * theta / (up - down);
  const double sample_rate = rate / static_cast<double>(stride);
  const Index lag = lag_rows(all.runs(), options.hac_lag_s, sample_rate);
  const double independent =
      2.0 * prepared.report.effective_cutoff_hz * static_cast<double>(all.count()) / sample_rate;
  const double taken = static_cast<double>(5 * n + 2);
  const double shrinkage = independent > 2.0 * taken ? independent / (independent - taken) : 2.0;
  Matrix bread;
  const Matrix covariance = shrinkage * covariance_of(all, regressors, theta, slope, lag, bread);
  natural_parameters(out, theta, mean, search.delay, covariance);
  const Index last = covariance.rows() - 1;
  const double weight =
      covariance(last, last) > 0.0 ? bread(last, last) / covariance(last, last) : 0.0;
  profile_of(out, all, search, weight, options);
  const double slack = 1e-4 * (options.delay_max_s - options.delay_min_s);
  if (out.delay_interval[0] < options.delay_min_s + slack ||
      out.delay_interval[1] > options.delay_max_s - slack) {
    out.outcome |= kDelayedAtBound;
  }
  const ScoreTest test = test_feedback(all, options, sample_rate, token);
  out.p_value = test.p_value;
  out.test_blocks = test.blocks;
  out.provenance = record.provenance();
  explain(out, options);
  return out;
}

}  // namespace ulna
