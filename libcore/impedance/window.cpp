#include "impedance/window.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "impedance/scores.hpp"

namespace ulna {
namespace {

constexpr double kPeriods = 5.0;  // of the low pass within the window
constexpr double kSmeared = 3.0;  // fewer: what follows shows in the window
// A step through the two passes has settled to two percent after a period of the cut-off.
constexpr double kGuardPeriods = 1.0;
constexpr Index kLeastOnsets = 3;

// Columns of a piece: instruments, regressors, force. Each signal stands once for the early rows
// and once for the late ones, zero elsewhere; inertia once for both where it is shared.
struct Layout {
  Index n = 0;
  Index m = 0;  // references used; 0: least squares
  bool free_inertia = false;
  Index each(Index axes) const { return (free_inertia ? 6 : 5) * axes; }
  Index q() const { return m > 0 ? each(m) : 0; }
  Index p() const { return each(n); }
  Index width() const { return q() + p() + n; }
  // First column among the regressors of M, B, K of a window (0 early, 1 late).
  Index m_at(int window) const { return free_inertia && window == 1 ? 3 * n : 0; }
  Index b_at(int window) const { return (window == 0 ? n : (free_inertia ? 4 * n : 3 * n)); }
  Index k_at(int window) const { return b_at(window) + n; }
};

struct Piece {
  Matrix gram;
  Matrix rows;  // kept for the VAF: regressors and force
  Index early = 0;
};

// Prepared rows of a perturbation, counted from its rest; nothing when it does not fit. `guard`
// rows on either side of the border are left out: the filter mixes there what was before and after
// it.
bool cut_piece(const Prepared& prepared, const Onset& onset, const Layout& layout, Index window,
               Index rest, Index guard, Piece& out) {
  const PreparedTrial& trial = prepared.trials[static_cast<std::size_t>(onset.trial)];
  const Index first = onset.row - trial.begin();
  const Index last = std::min(onset.end - trial.begin(), trial.rows());
  if (first - rest < 0 || last - first < 2 * window) return false;
  const Index early = window - guard;
  const Index late = last - first - window - guard;
  const auto centred = [&](const auto& signal) {
    const Eigen::RowVectorXd mean = signal.middleRows(first - rest, rest).colwise().mean();
    Matrix rows(early + late, signal.cols());
    rows << signal.middleRows(first, early), signal.middleRows(last - late, late);
    return Matrix(rows.rowwise() - mean);
  };
  Matrix table = Matrix::Zero(early + late, layout.width());
  const auto put = [&](Index at, const Matrix& a, const Matrix& v, const Matrix& x) {
    const Index n = x.cols();
    table.block(0, at, early, n) = a.topRows(early);
    table.block(0, at + n, early, n) = v.topRows(early);
    table.block(0, at + 2 * n, early, n) = x.topRows(early);
    Index next = at + 3 * n;
    if (layout.free_inertia) {
      table.block(early, next, late, n) = a.bottomRows(late);
      next += n;
    } else {
      table.block(early, at, late, n) = a.bottomRows(late);
    }
    table.block(early, next, late, n) = v.bottomRows(late);
    table.block(early, next + n, late, n) = x.bottomRows(late);
  };
  if (layout.m > 0) {
    put(0, centred(trial.reference_acceleration()), centred(trial.reference_rate()),
        centred(trial.reference()));
  }
  put(layout.q(), centred(trial.acceleration()), centred(trial.velocity()),
      centred(trial.position()));
  table.rightCols(layout.n) = -centred(trial.force());
  out.gram = table.transpose() * table;
  out.rows = table.rightCols(layout.p() + layout.n);
  out.early = early;
  return true;
}

Matrix theta_of(const Matrix& gram, const Layout& layout, Fit* whole = nullptr) {
  const Factor factor = factor_of_gram(gram, layout.q(), layout.p(), layout.n, 0);
  const Fit fit = solve(factor, Matrix::Identity(layout.p() * layout.n, layout.p() * layout.n),
                        layout.m > 0 ? Estimator::kInstrumental : Estimator::kLeastSquares);
  if (whole != nullptr) *whole = fit;
  return fit.theta;
}

// M, B, K of both windows, row by row.
Vector natural(const Matrix& theta, const Layout& layout) {
  const Index n = layout.n;
  Vector out(6 * n * n);
  Index at = 0;
  for (const int window : {0, 1}) {
    for (const Index first : {layout.m_at(window), layout.b_at(window), layout.k_at(window)}) {
      for (Index i = 0; i < n; ++i) {
        for (Index j = 0; j < n; ++j) out[at++] = theta(first + j, i);
      }
    }
  }
  return out;
}

Matrix square(const Vector& natural, Index first, Index n) {
  Matrix out(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) out(i, j) = natural[first + i * n + j];
  }
  return out;
}

// Scores of "late differs from early", a row a perturbation, from Gram matrices alone.
Matrix difference_scores(const std::vector<Piece>& pieces, const Matrix& total,
                         const Layout& layout) {
  const Index n = layout.n;
  const Index q = layout.q();
  const Index p = layout.p();
  // Base: early and late together; candidates: the late columns by themselves.
  const Index base = 3 * n;
  const Index more = layout.free_inertia ? 3 * n : 2 * n;
  Matrix to_base = Matrix::Zero(p, base);
  Matrix to_more = Matrix::Zero(p, more);
  const Matrix one = Matrix::Identity(n, n);
  const Index firsts[3] = {layout.m_at(0), layout.b_at(0), layout.k_at(0)};
  const Index lasts[3] = {layout.m_at(1), layout.b_at(1), layout.k_at(1)};
  for (Index part = 0; part < 3; ++part) {
    to_base.block(firsts[part], part * n, n, n) = one;
    to_base.block(lasts[part], part * n, n, n) = one;
    const Index at = layout.free_inertia ? part : part - 1;
    if (at >= 0) to_more.block(lasts[part], at * n, n, n) = one;
  }
  // What the estimator correlates errors with: regressors, or their projection on instruments.
  Matrix weights = Matrix::Zero(q + p, p);
  if (q > 0) {
    const Vector norms = total.diagonal().head(q).cwiseMax(1e-300).cwiseSqrt();
    const Matrix scale = norms.cwiseInverse().asDiagonal();
    weights.topRows(q) = scale * (scale * total.topLeftCorner(q, q) * scale)
                                     .ldlt()
                                     .solve(Matrix(scale * total.block(0, q, q, p)));
  } else {
    weights.bottomRows(p).setIdentity();
  }
  const Matrix gram = total.topLeftCorner(q + p, q + p);
  const Matrix base_columns = weights * to_base;  // coefficients over [Z X]
  const Matrix more_columns = weights * to_more;
  const Matrix information = base_columns.transpose() * gram * base_columns;
  const Vector norms = information.diagonal().cwiseMax(1e-300).cwiseSqrt();
  const Matrix scale = norms.cwiseInverse().asDiagonal();
  const Eigen::LDLT<Matrix> factor(scale * information * scale);
  const auto project = [&](const Matrix& right) {
    return Matrix(scale * factor.solve(Matrix(scale * right)));
  };
  const Matrix theta = project(base_columns.transpose() * total.block(0, q + p, q + p, n));
  const Matrix along = project(base_columns.transpose() * gram * more_columns);
  const Matrix residual_columns = more_columns - base_columns * along;
  Matrix out(static_cast<Index>(pieces.size()), more * n);
  for (std::size_t s = 0; s < pieces.size(); ++s) {
    const Matrix& own = pieces[s].gram;
    // [Z X]' (Y - X base theta)
    const Matrix error =
        own.block(0, q + p, q + p, n) - own.block(0, q, q + p, p) * (to_base * theta);
    const Matrix score = residual_columns.transpose() * error;
    out.row(static_cast<Index>(s)) =
        Eigen::Map<const Eigen::RowVectorXd>(score.data(), score.size());
  }
  return out;
}

void window_vaf(const std::vector<Piece>& pieces, const Matrix& theta, const Layout& layout,
                WindowFit& fit, bool early) {
  const Index n = layout.n;
  Vector error = Vector::Zero(n);
  Vector force = Vector::Zero(n);
  Vector sum = Vector::Zero(n);
  Vector error_sum = Vector::Zero(n);
  fit.rows = 0;
  for (const Piece& piece : pieces) {
    const Index first = early ? 0 : piece.early;
    const Index count = early ? piece.early : piece.rows.rows() - piece.early;
    const auto y = piece.rows.rightCols(n).middleRows(first, count);
    const Matrix e = y - piece.rows.leftCols(layout.p()).middleRows(first, count) * theta;
    error += e.colwise().squaredNorm().transpose();
    error_sum += e.colwise().sum().transpose();
    force += y.colwise().squaredNorm().transpose();
    sum += y.colwise().sum().transpose();
    fit.rows += count;
  }
  const double rows = static_cast<double>(fit.rows);
  fit.vaf.resize(n);
  for (Index i = 0; i < n; ++i) {
    const double total = force[i] - sum[i] * sum[i] / rows;
    const double left = error[i] - error_sum[i] * error_sum[i] / rows;
    fit.vaf[i] = total > 0.0 ? 100.0 * (1.0 - left / total) : kNaN;
  }
}

void check_options(const WindowOptions& o) {
  const auto between = [](double value, double low, double high) {
    return std::isfinite(value) && value >= low && value <= high;
  };
  require(between(o.window_s, 1e-4, 1e3), "window_s", "the window must last a positive time");
  require(between(o.after_s, 1e-4, 1e6) && o.after_s >= 2.0 * o.window_s, "after_s",
          "a perturbation must be used for at least twice the window");
  require(between(o.baseline_s, 1e-4, 1e3), "baseline_s",
          "the rest before an onset must last a positive time");
  require(between(o.condition_limit, 1e-9, 1e300), "condition_limit",
          "the limit of the condition number must be positive");
  require(o.draws >= 99 && o.draws <= 10'000'000, "draws",
          "the test needs from 99 to ten million draws");
  require(between(o.level, 1e-12, 1.0), "level", "the level of the test lies between 0 and 1");
  require(o.threads >= 0, "threads", "the number of threads must not be negative");
}

}  // namespace

WindowComparison compare_windows(const Record& record, const WindowOptions& options, Token* token) {
  check_options(options);
  Roles roles = find_roles(record, options.position, options.force, options.reference);
  const Index n = static_cast<Index>(roles.position.size());
  const bool have_reference = roles.reference.size() >= roles.position.size();
  require(options.estimator != EstimatorChoice::kInstrumental || have_reference, "estimator",
          "instrumental variables need a reference channel for every axis");
  const double rate = record.rate_hz();
  const std::vector<Onset> onsets =
      options.onsets_s.empty()
          ? find_onsets(record, roles, options.baseline_s, options.after_s)
          : given_onsets(record, options.onsets_s, options.baseline_s, options.after_s);
  PrepareOptions prepare_options = options.prepare;
  if (prepare_options.lowpass_hz == 0.0) {
    prepare_options.lowpass_hz = std::min(kPeriods / options.window_s, 0.2 * rate);
  }
  if (!have_reference) roles.reference.clear();
  const Prepared prepared = prepare(record, roles, prepare_options, options.threads, token);

  WindowComparison out;
  out.n = n;
  out.report = prepared.report;
  out.consistency = derivative_consistency(prepared);
  for (const Index c : roles.position) {
    out.axes.push_back(record.channels()[static_cast<std::size_t>(c)].name);
  }
  out.rotational = record.channels()[static_cast<std::size_t>(roles.position[0])].unit == "rad";
  const bool instrumental = have_reference && options.estimator != EstimatorChoice::kLeastSquares;
  out.estimator = instrumental ? Estimator::kInstrumental : Estimator::kLeastSquares;
  const Layout layout{n, instrumental ? static_cast<Index>(roles.reference.size()) : 0,
                      options.free_inertia};
  const Index window = std::max<Index>(1, static_cast<Index>(std::lround(options.window_s * rate)));
  const Index rest = std::max<Index>(1, static_cast<Index>(std::lround(options.baseline_s * rate)));
  const double smear_s = prepared.report.lowpass_hz > 0.0
                             ? kGuardPeriods / prepared.report.lowpass_hz
                             : 0.5 * prepared.report.window / rate;
  const Index guard = std::min<Index>(window / 2, static_cast<Index>(std::ceil(smear_s * rate)));
  out.guard_s = static_cast<double>(guard) / rate;

  std::vector<Piece> pieces;
  Matrix total = Matrix::Zero(layout.width(), layout.width());
  for (const Onset& onset : onsets) {
    step(token, 0.5);
    Piece piece;
    if (!cut_piece(prepared, onset, layout, window, rest, guard, piece)) continue;
    total += piece.gram;
    pieces.push_back(std::move(piece));
    out.onsets.push_back(onset);
    out.onset_time_s.push_back(record.time()[static_cast<std::size_t>(onset.row)]);
  }
  const Index count = static_cast<Index>(pieces.size());
  if (count < kLeastOnsets) {
    throw Error(Fault::kData, "onsets_s",
                "only " + std::to_string(count) + " of " + std::to_string(onsets.size()) +
                    " perturbations have a rest before them and two windows after it; at least " +
                    std::to_string(kLeastOnsets) + " are needed");
  }
  Fit fit;
  const Matrix theta = theta_of(total, layout, &fit);
  out.condition = fit.condition;
  if (!(fit.condition <= options.condition_limit)) {
    throw Error(Fault::kAnalysis, "window_s",
                sentence(3,
                         "the windows do not determine inertia, damping and stiffness "
                         "(condition number ",
                         fit.condition, "): lengthen the window or perturb in every direction"));
  }
  if (fit.condition > kIllCondition) {
    out.outcome |= kWindowIllConditioned;
    out.warnings.push_back(
        sentence(3, "The windows hardly determine some direction (condition number ", fit.condition,
                 "): its interval is wide."));
  }
  const Vector value = natural(theta, layout);
  Matrix left_out(count, value.size());
  for (Index s = 0; s < count; ++s) {
    step(token, 0.6);
    const Matrix others = total - pieces[static_cast<std::size_t>(s)].gram;
    left_out.row(s) = natural(theta_of(others, layout), layout).transpose();
  }
  const Matrix centred = left_out.rowwise() - left_out.colwise().mean();
  const Matrix covariance = (static_cast<double>(count - 1) / static_cast<double>(count)) *
                            (centred.transpose() * centred);
  const Index each = 3 * n * n;
  for (const int which : {0, 1}) {
    WindowFit& part = which == 0 ? out.early : out.late;
    const Index first = which * each;
    part.m = square(value, first, n);
    part.b = square(value, first + n * n, n);
    part.k = square(value, first + 2 * n * n, n);
    part.covariance = covariance.block(first, first, each, each);
    window_vaf(pieces, theta, layout, part, which == 0);
  }
  const Matrix cross = covariance.block(0, each, each, each);
  out.difference_covariance =
      out.early.covariance + out.late.covariance - cross - cross.transpose();
  out.degrees = static_cast<double>(count - 1);
  const ScoreTest test =
      score_test({difference_scores(pieces, total, layout)}, options.draws, options.seed, token);
  // As many perturbations as parameters say nothing about their spread.
  const Index tested = (options.free_inertia ? 3 : 2) * n * n;
  out.p_value = count > tested ? test.p_value : kNaN;
  if (!std::isfinite(out.p_value)) {
    out.outcome |= kWindowUntested;
    out.notes.push_back(
        sentence(3, "Only ", count, " perturbations: too few to test for a difference."));
  }
  if (options.window_s * prepared.report.effective_cutoff_hz < kSmeared) {
    out.outcome |= kWindowSmeared;
    out.warnings.push_back(sentence(
        3, "The low pass (-3 dB at ", prepared.report.effective_cutoff_hz,
        " Hz) is slow for a window of ", 1e3 * options.window_s,
        " ms: what follows shows in the window. Raise lowpass_hz or lengthen the window."));
  }
  if (pieces.size() < onsets.size()) {
    out.notes.push_back(sentence(3, onsets.size() - pieces.size(), " of ", onsets.size(),
                                 " perturbations have no rest before them or are too short, and "
                                 "are left out."));
  }
  out.provenance = record.provenance();
  out.provenance.push_back(sentence(6, "first ", options.window_s, " s of ", count,
                                    " perturbations against what follows, by ",
                                    instrumental ? "instrumental variables" : "least squares"));
  return out;
}

}  // namespace ulna
