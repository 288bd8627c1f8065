#include "impedance/estimate.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cctype>
#include <cmath>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "base/random.hpp"
#include "base/words.hpp"
#include "impedance/natural.hpp"
#include "impedance/split.hpp"
#include "impedance/validate.hpp"
#include "impedance/words.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr double kBiasLevel = 0.01;
// A model that holds accounts for nearly all of the force that the perturbation caused.
constexpr double kGoodReferenceVaf = 95.0;
// Stream of random numbers of the draws.
constexpr std::uint64_t kDrawStream = 1u << 20;

Matrix sample_covariance(const Matrix& rows) {
  const Matrix centred = rows.rowwise() - rows.colwise().mean();
  return centred.transpose() * centred / static_cast<double>(rows.rows() - 1);
}

void set_parameters(ImpedanceFit& fit, const Matrix& theta, const Vector& position_mean) {
  const Index n = theta.cols();
  fit.theta = theta;
  fit.position_mean = position_mean;
  fit.m = theta.middleRows(0, n).transpose();
  fit.b = theta.middleRows(n, n).transpose();
  fit.k = theta.middleRows(2 * n, n).transpose();
  fit.x0 = natural_of(theta, position_mean).tail(n);
  if (!fit.x0.allFinite()) fit.outcome |= kNotFinite;
}

struct Solved {
  Fit fit;
  Matrix unconstrained;  // theta without the semidefinite constraint
  bool constrained = false;
  bool converged = true;
};

Solved solve_structured(const Factor& factor, const Structure& structure, Estimator estimator) {
  Solved out;
  out.fit = solve(factor, structure_map(structure, factor.n), estimator);
  out.unconstrained = out.fit.theta;
  if (structure.model != Model::kPassive) return out;
  Fit& fit = out.fit;
  const Vector eta = (fit.transform.transpose() * fit.transform)
                         .ldlt()
                         .solve(fit.transform.transpose() * fit.theta.reshaped());
  const SemidefiniteFit bounded = fit_semidefinite(fit.information, fit.information * eta,
                                                   structure_cones(structure, factor.n));
  out.constrained = bounded.active;
  out.converged = bounded.converged;
  if (bounded.active) fit.theta = (fit.transform * bounded.eta).reshaped(factor.p, factor.n);
  return out;
}

void require_determined(const Fit& fit, const std::vector<std::string>& axes, double limit) {
  if (fit.condition <= limit && fit.theta.allFinite()) return;
  const bool iv = fit.estimator == Estimator::kInstrumental;
  throw Error(Fault::kAnalysis, iv ? "reference" : "position",
              sentence(3, iv ? "with the reference as instrument, " : "", unidentifiable(fit, axes),
                       "; its condition number is ", fit.condition, " (limit ", limit,
                       "): perturb in every direction and with more than one frequency, or fix "
                       "part of the model"),
              sentence(6, "condition ", fit.condition));
}

}  // namespace

Matrix parameter_draws(const ImpedanceFit& fit) {
  if (fit.replicates.size() > 0) return fit.replicates;
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(fit.theta_covariance);
  Matrix root = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  for (Index j = 0; j < root.rows(); ++j) {
    if (fit.theta_covariance(j, j) == 0.0) root.row(j).setZero();  // fixed by the model
  }
  Matrix out(fit.draw_count, natural_size(fit.theta.cols()));
  Vector normal(root.cols());
  for (Index i = 0; i < out.rows(); ++i) {
    Random random(fit.seed, kDrawStream + static_cast<std::uint64_t>(i));
    for (Index j = 0; j < normal.size(); ++j) normal[j] = random.normal();
    const Vector drawn = fit.theta.reshaped() + root * normal;
    out.row(i) = natural_of(drawn.reshaped(fit.theta.rows(), fit.theta.cols()), fit.position_mean)
                     .transpose();
  }
  return out;
}

Matrix predict_force(const ImpedanceEstimate& estimate, const ImpedanceFit& fit, int trial) {
  const PreparedTrial& data = estimate.prepared->trials[static_cast<std::size_t>(trial)];
  const Index n = estimate.n;
  Matrix force = -(data.acceleration() * fit.theta.middleRows(0, n) +
                   data.velocity() * fit.theta.middleRows(n, n) +
                   (data.position().rowwise() - fit.position_mean.transpose()) *
                       fit.theta.middleRows(2 * n, n) +
                   estimate.payload_kg * data.acceleration());
  force.rowwise() -= fit.theta.row(3 * n);
  return force;
}

ImpedanceEstimate identify_impedance(const Record& record, const ImpedanceOptions& options,
                                     Token* token, const std::vector<Finding>& findings) {
  require(options.payload_kg >= 0.0 && std::isfinite(options.payload_kg), "payload_kg",
          "the payload must be a mass of at least 0 kg");
  const auto positive = [](double value, const char* argument, const char* what) {
    require(std::isfinite(value) && value > 0.0, argument,
            std::string(what) + " must be a positive number");
  };
  positive(options.hac_lag_s, "lag_s", "the lag of the standard errors");
  positive(options.block_s, "block_s", "the length of a bootstrap block");
  positive(options.condition_limit, "condition_limit", "the limit of the condition number");
  require(options.poor_vaf >= 0.0 && options.poor_vaf <= 100.0, "poor_vaf",
          "poor_vaf is a percentage, from 0 to 100");
  require(options.threads >= 0, "threads", "the number of threads must not be negative");
  require(options.bootstrap <= 10'000'000 && options.draws <= 10'000'000, "draws",
          "more than ten million draws or resamples are refused");
  require(options.train_s >= 0.0 && std::isfinite(options.train_s), "train_s",
          "the time to identify from must be positive");
  require(options.draws >= 100, "draws", "at least 100 draws are needed for intervals");
  require(options.errors == ErrorModel::kNeweyWest || options.bootstrap >= 50, "bootstrap",
          "at least 50 resamples are needed for standard errors");

  ImpedanceEstimate out;
  Roles roles = find_roles(record, options.position, options.force, options.reference);
  const Index n = static_cast<Index>(roles.position.size());
  out.n = n;
  for (const Index c : roles.position)
    out.axes.push_back(record.channels()[static_cast<std::size_t>(c)].name);
  out.rotational = record.channels()[static_cast<std::size_t>(roles.position[0])].unit == "rad";
  // A lone channel called "position" is a poor subscript.
  if (n == 1 && out.axes[0].size() > 3) out.axes[0] = out.rotational ? "q" : "x";
  out.structure = options.structure;
  out.payload_kg = options.payload_kg;
  const bool have_reference = roles.reference.size() >= roles.position.size();
  const std::size_t references = roles.reference.size();
  require(options.estimator != EstimatorChoice::kInstrumental || have_reference, "estimator",
          "instrumental variables need a reference channel for every axis; the record has " +
              std::to_string(references) + " of " + std::to_string(n));

  if (!have_reference && references > 0) {
    roles.reference.clear();
    out.fit.outcome |= kUnchecked;
    out.warnings.push_back("The record holds a reference for " + std::to_string(references) +
                           " of " + std::to_string(n) +
                           " axes: without one for every axis, instrumental variables and the "
                           "closed-loop check are not possible.");
  }
  auto prepared =
      std::make_shared<Prepared>(prepare(record, roles, options.prepare, options.threads, token));
  out.prepared = prepared;
  out.report = prepared->report;
  out.record = std::make_shared<Record>(record);
  const double rate = record.rate_hz();
  const Split split = split_rows(record, *prepared, options.train_s);
  out.train = split.train;
  out.held_out = split.held_out;
  out.train_s = split.train_s;
  out.refitted = options.refit == Refit::kYes || (options.refit == Refit::kAuto && split.segmented);
  const Index parameters = 3 * n + 1;
  const auto enough = [&](Index rows) {
    if (rows >= 10 * parameters) return;
    throw Error(Fault::kData, "time",
                "only " + std::to_string(rows) + " samples are left to identify " +
                    std::to_string(parameters * n) + " parameters; at least " +
                    std::to_string(10 * parameters) + " are needed");
  };
  enough(row_count(split.train));

  // Validation first, on a fit that has not seen the held-out rows; then, on request, a fit to all.
  const std::vector<Span>& spans = out.refitted ? split.all : split.train;
  const Design design(*prepared, options.payload_kg, spans);
  const Vector& position_mean = design.position_mean();
  out.train_rows = row_count(split.train);
  out.held_out_rows = row_count(split.held_out);

  std::vector<Factor> factors(prepared->trials.size());
  const auto spans_of = [](const std::vector<Span>& list, int trial) {
    std::vector<Span> own;
    for (const Span& span : list) {
      if (span.trial == trial) own.push_back(span);
    }
    return own;
  };
  const auto factor_all = [&](const std::vector<Span>& list) {
    parallel_for(
        static_cast<std::ptrdiff_t>(factors.size()), options.threads,
        [&](std::ptrdiff_t t) {
          factors[static_cast<std::size_t>(t)] =
              factorise(design, spans_of(list, static_cast<int>(t)), token);
        },
        token);
    std::vector<const Factor*> parts;
    for (const Factor& factor : factors) {
      if (factor.rows > 0) parts.push_back(&factor);
    }
    return merge(parts);
  };

  const bool instrumental = options.estimator == EstimatorChoice::kInstrumental ||
                            (options.estimator == EstimatorChoice::kAuto && have_reference);
  std::vector<Estimator> wanted{instrumental ? Estimator::kInstrumental : Estimator::kLeastSquares};
  if (have_reference) {
    wanted.push_back(instrumental ? Estimator::kLeastSquares : Estimator::kInstrumental);
  }
  const Factor train_factor = factor_all(split.train);
  std::vector<Solved> trained;
  for (const Estimator estimator : wanted) {
    trained.push_back(solve_structured(train_factor, options.structure, estimator));
  }
  require_determined(trained[0].fit, out.axes, options.condition_limit);
  // The second opinion is dropped, and said so, when the data do not determine it.
  if (trained.size() == 2 && !(trained[1].fit.condition <= options.condition_limit)) {
    trained.pop_back();
    out.notes.push_back("The other estimator is not shown: the data do not determine it.");
  }
  std::vector<Solved> solved = trained;
  if (out.refitted) {
    const Factor all_factor = factor_all(split.all);
    for (std::size_t e = 0; e < solved.size(); ++e) {
      solved[e] = solve_structured(all_factor, options.structure, trained[e].fit.estimator);
    }
    require_determined(solved[0].fit, out.axes, options.condition_limit);
  }

  const double band = out.report.lowpass_hz > 0.0 ? out.report.lowpass_hz : 0.2 * rate;

  // Covariance of all estimators together: their difference is tested below.
  std::vector<const Fit*> fits;
  for (const Solved& s : solved) fits.push_back(&s.fit);
  // Scores sum to zero over all rows: a lag near the length of a run would see no error at all.
  Index longest_run = 0;
  for (const Span& span : spans) longest_run = std::max(longest_run, span.end - span.begin);
  const Index hac_lag = static_cast<Index>(
      std::min(std::round(options.hac_lag_s * rate), 0.5 * static_cast<double>(longest_run)));
  const Index each = parameters * n;
  // A record of T seconds smoothed to B Hz holds 2 B T independent values an axis, and the fit took
  // some of them.
  const double independent =
      2.0 * out.report.effective_cutoff_hz * static_cast<double>(row_count(spans)) / rate;
  const double taken = static_cast<double>(parameters);
  const double shrinkage = independent > 2.0 * taken ? independent / (independent - taken) : 2.0;
  // Products of two signals reach twice the band; ten sums for each of its periods lose nothing.
  const Index stride = std::max<Index>(1, static_cast<Index>(rate / (20.0 * band)));
  const Matrix covariance =
      shrinkage * newey_west(design, spans, fits, hac_lag, stride, token, options.threads);

  std::vector<ImpedanceFit> results(solved.size());
  for (std::size_t e = 0; e < solved.size(); ++e) {
    ImpedanceFit& fit = results[e];
    const Index at = static_cast<Index>(e) * each;
    fit.estimator = solved[e].fit.estimator;
    fit.condition = solved[e].fit.condition;
    fit.constrained = solved[e].constrained;
    if (!solved[e].converged) fit.outcome |= kNotConverged;
    if (fit.condition > kIllCondition) fit.outcome |= kIllConditioned;
    set_parameters(fit, solved[e].fit.theta, position_mean);
    validate(design, split.held_out, trained[e].fit.theta, rate, options.seed, options.threads,
             fit.vaf, &fit.vaf_interval);
    validate(design, split.train, trained[e].fit.theta, rate, options.seed, options.threads,
             fit.vaf_train, nullptr);
    fit.vaf_reference =
        reference_vaf(*prepared, fit.theta, fit.position_mean, options.payload_kg, band);
    const Vector& vaf = judged_vaf(fit);
    for (Index i = 0; i < n; ++i) {
      const double excused = fit.vaf_reference[i];  // NaN excuses nothing
      if (vaf[i] < options.poor_vaf && !(excused >= kGoodReferenceVaf)) fit.outcome |= kPoorFit;
    }
    if (options.errors == ErrorModel::kBlockBootstrap) {
      const std::vector<Span> blocks =
          split.segmented
              ? spans
              : cut(spans, static_cast<Index>(std::min(options.block_s * rate,
                                                       static_cast<double>(record.rows()))));
      if (blocks.size() < 5) {
        throw Error(
            Fault::kData, "errors",
            "a bootstrap over " + std::to_string(blocks.size()) +
                " blocks says nothing; record longer, shorten block_s or use Newey-West errors");
      }
      const Matrix thetas =
          block_bootstrap(design, blocks, solved[e].fit.transform, fit.estimator, options.bootstrap,
                          options.seed, options.threads, token);
      fit.replicates.resize(thetas.rows(), natural_size(n));
      for (Index i = 0; i < thetas.rows(); ++i) {
        const Vector theta = thetas.row(i);  // Eigen 3.4.0 reshapes a strided row wrongly
        fit.replicates.row(i) =
            natural_of(theta.reshaped(parameters, n), position_mean).transpose();
      }
      fit.covariance = sample_covariance(fit.replicates);
    } else {
      fit.theta_covariance = covariance.block(at, at, each, each);
      const Matrix jacobian = natural_jacobian(solved[e].fit.theta);
      fit.covariance = jacobian * fit.theta_covariance * jacobian.transpose();
      fit.draw_count = options.draws;
      fit.seed = options.seed;
    }
  }

  if (factors.size() > 1) {
    std::vector<TrialFit> fits_of_trials(factors.size());
    parallel_for(
        static_cast<std::ptrdiff_t>(factors.size()), options.threads,
        [&](std::ptrdiff_t i) {
          const auto t = static_cast<std::size_t>(i);
          if (factors[t].rows < 10 * parameters) return;
          const Solved own = solve_structured(factors[t], options.structure, wanted[0]);
          if (!(own.fit.condition <= options.condition_limit)) return;
          fits_of_trials[t] = {natural_of(own.fit.theta, position_mean), own.fit.condition};
        },
        token);
    Matrix table(static_cast<Index>(factors.size()), natural_size(n));
    Index used = 0;
    for (TrialFit& trial : fits_of_trials) {
      if (trial.natural.size() == 0) continue;
      table.row(used++) = trial.natural.transpose();
      out.trials.push_back(std::move(trial));
    }
    if (used < table.rows()) {
      out.notes.push_back(std::to_string(table.rows() - used) + " of " +
                          std::to_string(table.rows()) +
                          " trials do not determine the parameters by themselves and are left out "
                          "of the mean over trials.");
    }
    if (used >= 2) {
      out.trial_mean = table.topRows(used).colwise().mean().transpose();
      out.trial_error =
          (sample_covariance(table.topRows(used)).diagonal() / static_cast<double>(used))
              .cwiseSqrt();
    }
  }

  out.motion = motion_share(*prepared, band);
  out.lag = check_lag(*prepared, spans, wanted[0], options.hac_lag_s);

  const std::uint32_t before = out.fit.outcome;
  out.fit = std::move(results[0]);
  out.fit.outcome |= before;
  for (const Finding& finding : findings) {
    const auto concerns = [&](const std::vector<Index>& channels) {
      return std::any_of(channels.begin(), channels.end(), [&](Index c) {
        return record.channels()[static_cast<std::size_t>(c)].name == finding.channel;
      });
    };
    if (finding.severity == Severity::kNote) continue;
    if (!finding.channel.empty() && !concerns(roles.position) && !concerns(roles.force) &&
        !concerns(roles.reference)) {
      continue;
    }
    out.fit.outcome |= kSuspectData;
    std::string message = finding.message;
    if (!message.empty())
      message[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(message[0])));
    if (!message.empty() && message.back() != '.') message += '.';
    out.warnings.push_back(std::move(message));
  }
  if (results.size() == 2) {
    out.alternative = std::make_unique<ImpedanceFit>(std::move(results[1]));
    const bool iv_first = out.fit.estimator == Estimator::kInstrumental;
    ImpedanceFit& iv = iv_first ? out.fit : *out.alternative;
    ImpedanceFit& ls = iv_first ? *out.alternative : out.fit;
    Matrix joint = covariance;
    if (!iv_first) {
      Eigen::PermutationMatrix<Eigen::Dynamic> swap(2 * each);
      for (Index i = 0; i < each; ++i) {
        swap.indices()[i] = static_cast<int>(i + each);
        swap.indices()[i + each] = static_cast<int>(i);
      }
      joint = swap * covariance * swap.transpose();
    }
    // A constraint moves both estimates by itself: the test is about them without it.
    std::vector<Fit> free{solved[0].fit, solved[1].fit};
    for (std::size_t e = 0; e < 2; ++e) free[e].theta = solved[e].unconstrained;
    out.test = difference_test(free[iv_first ? 0 : 1], free[iv_first ? 1 : 0], joint);
    if (out.test.p_value < kBiasLevel) {
      ls.outcome |= kClosedLoopBiased;
      (iv_first ? out.notes : out.warnings).push_back(bias_sentence(out.test, iv, ls, out.axes));
    }
  } else if (!have_reference && references == 0) {
    out.fit.outcome |= kUnchecked;
    std::vector<std::string> unused;
    for (const Channel& channel : record.channels()) {
      if (channel.role == Role::kOther) unused.push_back(channel.name);
    }
    out.notes.push_back(
        "The log holds no reference (commanded perturbation), so it cannot be checked whether the "
        "human caused part of the motion; if so, least squares is biased towards minus the robot's "
        "impedance." +
        (unused.empty() ? std::string()
                        : " Not used: " + join(unused) +
                              "; if one is the commanded motion, say so in a map."));
  }
  explain(out, solved[0].fit, options, row_count(spans));
  return out;
}

}  // namespace ulna
