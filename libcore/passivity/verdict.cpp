#include "passivity/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "impedance/natural.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

template <class... Parts>
std::string sentence(const Parts&... parts) {
  std::ostringstream text;
  text.precision(3);
  (text << ... << parts);
  return text.str();
}

void interval(const std::vector<double>& sample, double level, double (&out)[2]) {
  out[0] = sample_quantile(sample, 0.5 * (1.0 - level));
  out[1] = sample_quantile(sample, 0.5 * (1.0 + level));
}

struct ModelDraws {
  std::vector<double> m_min, b_min, k_min;
  double probability = 0.0;
};

// An antisymmetric part that the estimate itself allows to drop is dropped in the draws too: the
// question is then about the symmetric parts. One above the threshold has to fall below it.
ModelDraws draw_model(const ImpedanceEstimate& estimate, const ModelMargins& best,
                      double antisymmetry_threshold) {
  const Index n = estimate.n;
  const Matrix draws = parameter_draws(estimate.fit);
  ModelDraws out;
  Index passive = 0;
  Index valid = 0;
  for (Index i = 0; i < draws.rows(); ++i) {
    const auto part = [&](Index term) { return matrix_of_row(draws, i, term * n * n, n); };
    if (!draws.row(i).head(3 * n * n).allFinite()) continue;
    const ModelMargins margins = model_passivity(part(0), part(1), part(2), antisymmetry_threshold);
    out.m_min.push_back(margins.m_min);
    out.b_min.push_back(margins.b_min);
    out.k_min.push_back(margins.k_min);
    ++valid;
    const bool symmetric =
        (best.m_symmetric || margins.m_symmetric) && (best.k_symmetric || margins.k_symmetric);
    if (symmetric && margins.m_min >= 0.0 && margins.b_min >= 0.0 && margins.k_min >= 0.0)
      ++passive;
  }
  out.probability = valid > 0 ? static_cast<double>(passive) / static_cast<double>(valid) : kNaN;
  return out;
}

// Energy the identified spring and mass hold at a prepared row; not below zero.
double stored_energy(const ImpedanceEstimate& estimate, const PreparedTrial& trial) {
  const ImpedanceFit& fit = estimate.fit;
  if (!fit.x0.allFinite()) return 0.0;
  const Vector offset = trial.position().row(0).transpose() - fit.x0;
  const Vector velocity = trial.velocity().row(0).transpose();
  return std::max(0.0, 0.5 * offset.dot(fit.k * offset) + 0.5 * velocity.dot(fit.m * velocity));
}

Answer decide(double probability, double level) {
  if (std::isnan(probability)) return Answer::kUndecided;
  if (probability >= level) return Answer::kPassive;
  return probability <= 1.0 - level ? Answer::kNotPassive : Answer::kUndecided;
}

const char* word(Answer answer) {
  switch (answer) {
    case Answer::kPassive:
      return "passive";
    case Answer::kNotPassive:
      return "not passive";
    case Answer::kUndecided:
      break;
  }
  return "undecided";
}

// How much longer the record must be for the margin to leave zero, when it is the weakest link.
std::string what_would_change(const ImpedanceEstimate& estimate, const Verdict& verdict) {
  if (verdict.approach == Approach::kEnergy) {
    return "A model that describes the recording (more of the force accounted for) would let the "
           "verdict "
           "rest on the impedance; the energy verdict holds for this perturbation only.";
  }
  struct Margin {
    const char* name;
    double value;
    const double* interval;
  };
  const Margin margins[] = {{"inertia", verdict.model.m_min, verdict.m_min_interval},
                            {"damping", verdict.model.b_min, verdict.excess_interval},
                            {"stiffness", verdict.model.k_min, verdict.k_min_interval}};
  const Margin* weakest = &margins[0];
  const auto distance = [](const Margin& margin) {
    return margin.value / std::max(margin.interval[1] - margin.interval[0], 1e-300);
  };
  for (const Margin& margin : margins) {
    if (distance(margin) < distance(*weakest)) weakest = &margin;
  }
  if (!verdict.model.k_symmetric || !verdict.model.m_symmetric) {
    return sentence(
        "An antisymmetric part of ", verdict.model.k_symmetric ? "M" : "K",
        " below the threshold would: repeat the trial to see whether it is a property of the "
        "arm or an error of the measurement.");
  }
  const double width = weakest->interval[1] - weakest->interval[0];
  if (verdict.answer == Answer::kUndecided) {
    const double factor = std::pow(0.5 * width / std::max(std::abs(weakest->value), 1e-300), 2.0);
    return sentence("The smallest ", weakest->name, " eigenvalue, ", weakest->value, " (95 % ",
                    weakest->interval[0], " to ", weakest->interval[1],
                    "), is what leaves it open; about ", std::max(1.5, std::min(factor, 1000.0)),
                    " times as much data of this kind would settle its sign.");
  }
  (void)estimate;
  return sentence("The closest margin is the smallest ", weakest->name, " eigenvalue, ",
                  weakest->value, " (95 % ", weakest->interval[0], " to ", weakest->interval[1],
                  "): the verdict changes only if that changes sign.");
}

}  // namespace

Verdict assess_passivity(const ImpedanceEstimate& estimate, const VerdictOptions& options) {
  require(options.level > 0.5 && options.level < 1.0, "level",
          "the level must lie between 0.5 and 1");
  require(options.min_share >= 0.0 && options.min_share < 1.0, "min_share",
          "the share of the motion must be at least 0 and below 1");
  require(options.block_s > 0.0, "block_s", "the block length must be positive");
  Verdict out;
  const ImpedanceFit& fit = estimate.fit;
  out.model = model_passivity(fit.m, fit.b, fit.k, options.antisymmetry_threshold);
  const ModelDraws draws = draw_model(estimate, out.model, options.antisymmetry_threshold);
  out.model_probability = draws.probability;
  interval(draws.b_min, options.level, out.excess_interval);
  interval(draws.m_min, options.level, out.m_min_interval);
  interval(draws.k_min, options.level, out.k_min_interval);

  // Energy has twice the band of the signals; ten points for each of its periods show all of it.
  const PrepareReport& filters = estimate.report;
  const Index stride = std::max<Index>(
      1, static_cast<Index>(filters.rate_hz / (20.0 * filters.effective_cutoff_hz)));
  std::vector<double> beta;
  for (const PreparedTrial& trial : estimate.prepared->trials) {
    out.series.push_back(absorbed_energy(trial.force(), trial.velocity(), filters.rate_hz, stride));
    beta.push_back(-stored_energy(estimate, trial));
  }
  out.beta_j = *std::min_element(beta.begin(), beta.end());
  out.energy = energy_index(out.series, beta, options.min_share);
  const std::vector<double> replicates = energy_index_bootstrap(
      out.series, out.beta_j, options.min_share, options.block_s, options.bootstrap, options.seed);
  interval(replicates, options.level, out.energy_interval);
  out.energy_probability = kNaN;
  if (!replicates.empty()) {
    const auto absorbed =
        std::count_if(replicates.begin(), replicates.end(), [](double d) { return d >= 0.0; });
    out.energy_probability = static_cast<double>(absorbed) / static_cast<double>(replicates.size());
  }

  // The model speaks for every motion, but only when it describes this one.
  const bool model_holds =
      (fit.outcome & (kPoorFit | kClosedLoopBiased | kIllConditioned | kNotConverged)) == 0;
  out.approach = model_holds ? Approach::kModel : Approach::kEnergy;
  out.probability = model_holds ? out.model_probability : out.energy_probability;
  out.answer = decide(out.probability, options.level);
  const Answer other =
      decide(model_holds ? out.energy_probability : out.model_probability, options.level);

  std::string dropped;
  if (estimate.n > 1 && estimate.structure.model == Model::kFree && model_holds) {
    dropped =
        sentence(" Antisymmetric parts of M (", 100.0 * out.model.antisymmetry_m, " %) and K (",
                 100.0 * out.model.antisymmetry_k, " %) are ",
                 out.model.m_symmetric && out.model.k_symmetric ? "dropped" : "not both dropped",
                 "; the threshold is ", 100.0 * options.antisymmetry_threshold, " %.");
  }
  if (model_holds) {
    out.reason = sentence(
        "It rests on the identified model: the chance that M and K are positive "
        "semidefinite and the smallest damping is not negative is ",
        out.model_probability, ".", dropped);
    if (out.answer != Answer::kUndecided && other != Answer::kUndecided && other != out.answer) {
      out.answer = Answer::kUndecided;
      out.reason += sentence(" The energy balance of this recording says ", word(other),
                             ", so the two approaches disagree.");
    }
  } else {
    out.reason = sentence(
        "It rests on the energy that the arm absorbed in this recording, because the model does "
        "not hold "
        "(see the warnings); the model by itself would say ",
        word(other), ".");
  }
  out.would_change = what_would_change(estimate, out);
  return out;
}

}  // namespace ulna
