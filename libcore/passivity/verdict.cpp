#include "passivity/verdict.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "base/words.hpp"
#include "impedance/natural.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

template <class... Parts>
std::string say(const Parts&... parts) {
  return sentence(3, parts...);
}

void interval(const std::vector<double>& sample, double level, double (&out)[2]) {
  out[0] = sample_quantile(sample, 0.5 * (1.0 - level));
  out[1] = sample_quantile(sample, 0.5 * (1.0 + level));
}

struct ModelDraws {
  std::vector<double> m_min, b_min, k_min;
  double probability = 0.0;
};

// Is the antisymmetric part of a matrix more than its own error? Entry by entry over the draws, at
// 95 % for all entries together.
bool antisymmetry_is_real(const Matrix& draws, Index first, Index n) {
  const double pairs = static_cast<double>(n * (n - 1) / 2);
  const double z = normal_quantile(1.0 - 0.025 / std::max(pairs, 1.0));
  for (Index i = 0; i < n; ++i) {
    for (Index j = i + 1; j < n; ++j) {
      const Vector entry = draws.col(first + i * n + j) - draws.col(first + j * n + i);
      const double mean = entry.mean();
      const double error = std::sqrt((entry.array() - mean).square().mean());
      if (std::abs(mean) > z * error) return true;
    }
  }
  return false;
}

// Draws scatter about the estimate as the estimate about the truth, and the smallest eigenvalue of
// a noisy matrix is too small on average: the draws repeat that bias. Mirroring them at the
// estimate takes it out (the basic bootstrap). An antisymmetric part counts only where the verdict
// keeps it.
ModelDraws draw_model(const ImpedanceEstimate& estimate, const ModelMargins& best,
                      const Matrix& draws, bool symmetric) {
  const Index n = estimate.n;
  ModelDraws out;
  Index passive = 0;
  Index valid = 0;
  for (Index i = 0; i < draws.rows(); ++i) {
    const auto part = [&](Index term) { return matrix_of_row(draws, i, term * n * n, n); };
    if (!draws.row(i).head(3 * n * n).allFinite()) continue;
    const ModelMargins margins = model_passivity(part(0), part(1), part(2));
    out.m_min.push_back(2.0 * best.m_min - margins.m_min);
    out.b_min.push_back(2.0 * best.b_min - margins.b_min);
    out.k_min.push_back(2.0 * best.k_min - margins.k_min);
    ++valid;
    if (symmetric && out.m_min.back() >= 0.0 && out.b_min.back() >= 0.0 &&
        out.k_min.back() >= 0.0) {
      ++passive;
    }
  }
  out.probability = valid > 0 ? static_cast<double>(passive) / static_cast<double>(valid) : kNaN;
  return out;
}

// Energy that the identified spring, the mass and the payload hold at every stride-th row and the
// last; zero where M or K would store less than nothing, which says that the model cannot tell.
Vector stored_energy(const ImpedanceEstimate& estimate, const PreparedTrial& trial, Index stride,
                     Index kept) {
  const ImpedanceFit& fit = estimate.fit;
  const Index n = estimate.n;
  const Matrix mass =
      0.5 * (fit.m + fit.m.transpose()) + estimate.payload_kg * Matrix::Identity(n, n);
  const Matrix spring = 0.5 * (fit.k + fit.k.transpose());
  const auto holds = [](const Matrix& matrix) {
    return Eigen::SelfAdjointEigenSolver<Matrix>(matrix, Eigen::EigenvaluesOnly).eigenvalues()[0] >=
           0.0;
  };
  const bool kinetic = holds(mass);
  const bool elastic = fit.x0.allFinite() && holds(spring);
  Vector out = Vector::Zero(kept);
  for (Index i = 0; i < kept; ++i) {
    const Index row = std::min(i * stride, trial.rows() - 1);
    const Vector velocity = trial.velocity().row(row).transpose();
    if (kinetic) out[i] += 0.5 * velocity.dot(mass * velocity);
    if (!elastic) continue;
    const Vector offset = trial.position().row(row).transpose() - fit.x0;
    out[i] += 0.5 * offset.dot(spring * offset);
  }
  // What counts is what could have come out within the recording: a spring stretched all along, as
  // when x0 is far away, excuses nothing by the part that it never gave back.
  if (kept > 0) out.array() -= out.minCoeff();
  return out;
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

// The weakest margin, and how much more data would settle its sign.
std::string what_would_change(const Verdict& verdict) {
  if (verdict.approach == Approach::kEnergy) {
    return "A model that describes the recording (more of the force accounted for) would let the "
           "verdict rest on the impedance; the energy verdict holds for this perturbation only.";
  }
  struct Margin {
    const char* name;
    double value;
    const double* interval;
  };
  const Margin margins[] = {{"inertia", verdict.model.m_min, verdict.m_min_interval},
                            {"damping", verdict.model.b_min, verdict.excess_interval},
                            {"stiffness", verdict.model.k_min, verdict.k_min_interval}};
  const auto width = [](const Margin& margin) { return margin.interval[1] - margin.interval[0]; };
  const Margin* weakest = nullptr;  // a margin without scatter is fixed by the model
  for (const Margin& margin : margins) {
    if (!(width(margin) > 0.0)) continue;
    if (weakest == nullptr || margin.value / width(margin) < weakest->value / width(*weakest)) {
      weakest = &margin;
    }
  }
  if (weakest == nullptr)
    return "The parameters have no uncertainty: nothing in this record would.";
  const std::string eigenvalue =
      say("the smallest ", weakest->name, " eigenvalue, ", weakest->value, " (",
          weakest->interval[0], " to ", weakest->interval[1], ")");
  const bool settled = weakest->interval[0] > 0.0 || weakest->interval[1] < 0.0;
  if (settled && weakest->value > 0.0 && (!verdict.k_dropped || !verdict.m_dropped)) {
    return say("An antisymmetric part of ", verdict.k_dropped ? "M" : "K",
               " below the threshold would: repeat the trial to see whether it is a property of "
               "the arm or an error of the measurement.");
  }
  if (settled) {
    return say("The closest margin is ", eigenvalue,
               ": the model's answer changes only if that changes sign.");
  }
  const double factor =
      std::pow(0.5 * width(*weakest) / std::max(std::abs(weakest->value), 1e-300), 2.0);
  return say("It depends most on ", eigenvalue, "; about ", std::clamp(factor, 1.5, 1000.0),
             " times as much data of this kind would settle its sign.");
}

}  // namespace

Verdict assess_passivity(const ImpedanceEstimate& estimate, const VerdictOptions& options,
                         Token* token) {
  require(options.level > 0.5 && options.level < 1.0, "level",
          "the level must lie between 0.5 and 1");
  require(options.min_share >= 0.0 && options.min_share < 1.0, "min_share",
          "the share of the motion must be at least 0 and below 1");
  require(std::isfinite(options.block_s) && options.block_s > 0.0, "block_s",
          "the block length must be positive");
  require(options.bootstrap >= 50 && options.bootstrap <= 10'000'000, "bootstrap",
          "the number of resamples must be from 50 to ten million");
  Verdict out;
  const ImpedanceFit& fit = estimate.fit;
  out.model = model_passivity(fit.m, fit.b, fit.k, options.antisymmetry_threshold);
  const Index n = estimate.n;
  const Matrix parameters = parameter_draws(fit);
  out.m_dropped = out.model.m_symmetric || !antisymmetry_is_real(parameters, 0, n);
  out.k_dropped = out.model.k_symmetric || !antisymmetry_is_real(parameters, 2 * n * n, n);
  const ModelDraws draws =
      draw_model(estimate, out.model, parameters, out.m_dropped && out.k_dropped);
  out.model_probability = fit.constrained ? kNaN : draws.probability;
  interval(draws.b_min, options.level, out.excess_interval);
  interval(draws.m_min, options.level, out.m_min_interval);
  interval(draws.k_min, options.level, out.k_min_interval);

  // Energy has twice the band of the signals; ten points for each of its periods show all of it.
  const PrepareReport& filters = estimate.report;
  const Index stride = std::max<Index>(
      1, static_cast<Index>(filters.rate_hz / (20.0 * filters.effective_cutoff_hz)));
  std::vector<double> beta;
  for (const PreparedTrial& trial : estimate.prepared->trials) {
    step(token,
         static_cast<double>(beta.size()) / static_cast<double>(estimate.prepared->trials.size()));
    EnergySeries series = absorbed_energy(trial.force(), trial.velocity(), filters.rate_hz, stride);
    series.stored_j = stored_energy(estimate, trial, stride, series.time_s.size());
    beta.push_back(-series.stored_j[0]);
    out.series.push_back(std::move(series));
  }
  out.beta_j = *std::min_element(beta.begin(), beta.end());
  out.energy = energy_index(out.series, beta, options.min_share);
  const std::vector<double> replicates = energy_index_bootstrap(
      out.series, options.min_share, options.block_s, options.bootstrap, options.seed, token);
  interval(replicates, options.level, out.energy_interval);
  // Blocks in another order can miss the very stretch that sets the index: the interval holds it
  // too.
  out.energy_interval[0] = std::min(out.energy_interval[0], out.energy.delta);
  out.energy_interval[1] = std::max(out.energy_interval[1], out.energy.delta);
  out.energy_probability = kNaN;
  if (!replicates.empty()) {
    const auto absorbed =
        std::count_if(replicates.begin(), replicates.end(), [](double d) { return d >= 0.0; });
    out.energy_probability = static_cast<double>(absorbed) / static_cast<double>(replicates.size());
  }

  // The model speaks for every motion, but only when it describes this one and was free to say no.
  constexpr std::uint32_t kDoubts =
      kPoorFit | kClosedLoopBiased | kIllConditioned | kNotConverged | kForceLag | kSuspectData;
  const bool model_holds = (fit.outcome & kDoubts) == 0 && !fit.constrained;
  out.approach = model_holds ? Approach::kModel : Approach::kEnergy;
  out.probability = model_holds ? out.model_probability : out.energy_probability;
  out.answer = decide(out.probability, options.level);
  const Answer other =
      decide(model_holds ? out.energy_probability : out.model_probability, options.level);

  std::string dropped;
  if (n > 1 && estimate.structure.model == Model::kFree && model_holds) {
    const auto part = [&](const char* name, double size, bool below, bool drop) {
      const std::string share =
          std::isfinite(size) ? say(" (", 100.0 * size, " %)") : std::string();
      return say(" The antisymmetric part of ", name, share,
                 below  ? " is below the threshold and dropped."
                 : drop ? " is within its error and dropped."
                        : " is above the threshold and beyond its error: it counts.");
    };
    dropped = say(part("M", out.model.antisymmetry_m, out.model.m_symmetric, out.m_dropped),
                  part("K", out.model.antisymmetry_k, out.model.k_symmetric, out.k_dropped),
                  " The threshold is ", 100.0 * options.antisymmetry_threshold, " %.");
  }
  if (model_holds) {
    const bool symmetric = out.m_dropped && out.k_dropped;
    out.reason =
        say("It rests on the identified model: ",
            symmetric
                ? say("the chance that M and K are positive semidefinite and the smallest damping "
                      "is not negative is ",
                      out.model_probability, ".")
                : std::string("a stiffness or inertia that is not symmetric can give energy out."),
            dropped);
    if (out.answer != Answer::kUndecided && other != Answer::kUndecided && other != out.answer) {
      out.answer = Answer::kUndecided;
      out.reason += say(" The energy balance of this recording says ", word(other),
                        ", so the two approaches disagree.");
    }
  } else {
    out.reason =
        say("It rests on the energy that the arm absorbed in this recording, because ",
            fit.constrained ? "the fit was constrained to be passive and met the constraint"
                            : "the model does not hold (see the warnings)",
            fit.constrained ? std::string(".")
                            : say("; the model by itself would say ", word(other), "."));
  }
  out.would_change = what_would_change(out);
  return out;
}

}  // namespace ulna
