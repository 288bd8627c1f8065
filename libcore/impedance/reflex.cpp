#include "impedance/reflex.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "impedance/reflex_cascade.hpp"
#include "impedance/reflex_evidence.hpp"
#include "impedance/reflex_fit.hpp"
#include "impedance/reflex_impulse.hpp"
#include "impedance/reflex_rows.hpp"
#include "impedance/reflex_words.hpp"

namespace ulna {
namespace {

constexpr double kConditionLimit = 1e6;  // of the intrinsic columns in unit length

Matrix trial_signals(const Record& record, const PreparedTrial& prepared, const CascadeTrial& trial,
                     const CascadePaths& paths, const ReflexOptions& options, int side, int index,
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

void require_rows(const CascadeSample& sample, const CascadeGrid& grid, Index parameters) {
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
  const CascadeGrid grid = make_grid(prepared.report, options);
  const Split split = split_rows(record, prepared, options.train_s);

  ReflexEstimate out;
  out.options = options;
  out.report = prepared.report;
  out.consistency = derivative_consistency(prepared);
  out.axis = record.channels()[static_cast<std::size_t>(roles.position[0])].name;
  out.rotational = record.channels()[static_cast<std::size_t>(roles.position[0])].unit == "rad";
  out.train_s = split.train_s;
  out.refitted = options.refit == Refit::kYes || (options.refit == Refit::kAuto && split.segmented);
  out.train_rows = row_count(split.train);
  out.held_out_rows = row_count(split.held_out);
  const double mean = mean_position(prepared, split.train);
  const Index least_run = 2 + options.drift;

  // One side or both, judged by what they leave of the identification part.
  std::vector<int> sides;
  if (options.side >= 0) sides.push_back(1);
  if (options.side <= 0) sides.push_back(-1);
  std::vector<CascadeFit> fits;
  std::vector<std::vector<CascadeTrial>> trials_of;
  std::vector<int> moved;
  for (const int side : sides) {
    auto trials = cascade_trials(prepared, options, side, mean);
    const CascadeSample sample =
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
  out.vaf_train_other = fits.size() == 2 ? fits[1 - chosen].vaf() : kNaN;
  const std::vector<CascadeTrial>& trials = trials_of[chosen];
  const CascadeFit& trained = fits[chosen];

  // Validation by the fit that has not seen the held-out rows.
  std::vector<CascadePaths> paths;
  for (const CascadeTrial& trial : trials) {
    paths.push_back(paths_of(trial, grid, options, trained));
  }
  validate_paths(out, trials, paths, split, options.block_s * grid.rate, options.seed);

  // The reported fit, its uncertainty, and the test on the same rows.
  const std::vector<Span>& spans = out.refitted ? split.all : split.train;
  const CascadeSample sample =
      cascade_sample(trials, spans, grid.back, grid.ahead, grid.stride, least_run);
  Cascade cascade(trials, sample, grid, options);
  CascadeFit reported = trained;
  if (out.refitted) {
    reported = fit_cascade(cascade, options, out.side, token);
  } else if (options.intrinsic == Intrinsic::kImpulseResponse) {
    cascade.set_penalty(trained.penalty);
  }
  CascadeUncertainty uncertain = uncertainty(trials, cascade, options, grid, reported,
                                             prepared.report.effective_cutoff_hz, mean, token);
  out.fit = std::move(uncertain.fit);
  out.profile_delay_s = uncertain.profile.delay;
  out.profile_vaf = 100.0 * (1.0 - uncertain.profile.cost.array() / reported.total);
  const ScoreTest test =
      test_reflex(prepared, spans, options, grid, cascade, reported, moved, mean, token);
  out.p_value = test.p_value;
  out.test_blocks = test.blocks;
  out.impulse = impulse_responses(trials, split, options, grid, token);

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
