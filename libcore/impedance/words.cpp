#include "impedance/words.hpp"

#include <algorithm>
#include <cmath>

#include "base/words.hpp"

namespace ulna {
namespace {

constexpr double kLeastLagS = 1e-3;

// Names of the free parameters in the order of structure_map, found from the map itself.
std::vector<std::string> parameter_names(const Matrix& map, const std::vector<std::string>& axes) {
  const Index n = static_cast<Index>(axes.size());
  const Index p = 3 * n + 1;
  static const char* const kTerm[] = {"m", "b", "k"};
  std::vector<std::string> names;
  for (Index column = 0; column < map.cols(); ++column) {
    Index entry = 0;
    while (map(entry, column) == 0.0) ++entry;
    const auto row = static_cast<std::size_t>(entry / p);
    const Index r = entry % p;
    names.push_back(r == 3 * n ? "the constant of " + axes[row]
                               : std::string(kTerm[r / n]) + "_" + axes[row] +
                                     (n > 1 ? axes[static_cast<std::size_t>(r % n)] : ""));
  }
  return names;
}

}  // namespace

std::string unidentifiable(const Fit& fit, const std::vector<std::string>& axes) {
  const Index n = static_cast<Index>(axes.size());
  const Index p = 3 * n + 1;
  static const char* const kSignal[] = {"acceleration of ", "velocity of ", "position of "};
  std::vector<std::string> parts;
  if (fit.transform.rows() == fit.transform.cols()) {
    // Every output has the same regressors: speak of the motion. The direction lives in one output.
    Vector motion = Vector::Zero(p);
    for (Index i = 0; i < n; ++i) {
      const Vector along = (fit.transform * fit.weakest).segment(i * p, p);
      if (along.norm() > motion.norm()) motion = along;
    }
    motion.normalize();
    for (Index r = 0; r < p; ++r) {
      if (std::abs(motion[r]) < 0.25) continue;
      parts.push_back(sentence(2, motion[r], " ",
                               r == 3 * n
                                   ? std::string("a constant")
                                   : kSignal[r / n] + axes[static_cast<std::size_t>(r % n)]));
    }
    return "the recorded motion hardly moves along one combination of signals (in units of their "
           "size: " +
           join(parts) + ")";
  }
  const std::vector<std::string> names = parameter_names(fit.transform, axes);
  for (Index r = 0; r < fit.weakest.size(); ++r) {
    if (std::abs(fit.weakest[r]) < 0.25) continue;
    parts.push_back(sentence(2, fit.weakest[r], " ", names[static_cast<std::size_t>(r)]));
  }
  return "the data do not tell these parameters apart: " + join(parts);
}

std::string bias_sentence(const DifferenceTest& test, const ImpedanceFit& iv,
                          const ImpedanceFit& ls, const std::vector<std::string>& axes) {
  // The diagonal stiffness that moves most, in its own standard errors, says it best.
  const Index n = iv.k.rows();
  const Index p = 3 * n + 1;
  Index worst = 0;
  double most = -1.0;
  for (Index i = 0; i < n; ++i) {
    const Index at = i * p + 2 * n + i;
    const double z = std::abs(test.difference[at]) / std::max(test.standard_error[at], 1e-300);
    if (z > most) {
      most = z;
      worst = i;
    }
  }
  const std::string axis = axes[static_cast<std::size_t>(worst)];
  return sentence(
      3,
      "Least squares is biased by the closed loop: part of the motion was caused by the human's "
      "own force, and the robot's impedance leaks in with the wrong sign (k_",
      axis, n > 1 ? axis : "", " = ", ls.k(worst, worst), " by least squares, ", iv.k(worst, worst),
      " by instrumental variables; test of equality: p ",
      test.p_value < 1e-4 ? std::string("< 0.0001") : sentence(2, "= ", test.p_value), ").");
}

const Vector& judged_vaf(const ImpedanceFit& fit) {
  return fit.vaf.allFinite() ? fit.vaf : fit.vaf_train;
}

void explain(ImpedanceEstimate& out, const Fit& reported, const ImpedanceOptions& options,
             Index rows) {
  Index worst = 0;
  const double low = judged_vaf(out.fit).minCoeff(&worst);
  if (low < options.poor_vaf && (out.fit.outcome & kPoorFit) == 0) {
    out.notes.push_back(sentence(
        3, "The model accounts for ", low, " % of the held-out force along ",
        out.axes[static_cast<std::size_t>(worst)], ", but for ", out.fit.vaf_reference[worst],
        " % of what the perturbation caused: the rest is force of the human's own, or comes from "
        "motion that the log does not hold."));
  }
  if ((out.fit.outcome & kPoorFit) != 0) {
    out.warnings.push_back(
        sentence(3, "A second-order model does not describe this recording: it ",
                 low > 0.0 ? sentence(3, "accounts for only ", low, " % of the variance of")
                           : std::string("predicts worse than the mean of"),
                 " the held-out force along ", out.axes[static_cast<std::size_t>(worst)],
                 ". Active muscles, reflexes or friction may be at work; M, B and K are then no "
                 "more than the best second-order summary."));
  }
  const Index n = out.n;
  bool negative_inertia = true;
  for (Index i = 0; i < n; ++i) {
    const double error = std::sqrt(out.fit.covariance(i * n + i, i * n + i));
    negative_inertia = negative_inertia && out.fit.m(i, i) < -3.0 * error;
  }
  if (negative_inertia) {
    out.fit.outcome |= kSuspectData;
    out.warnings.emplace_back(kNegativeInertia);
  }
  if ((out.fit.outcome & kIllConditioned) != 0) {
    out.warnings.push_back(sentence(3, "The estimate is ill-conditioned (condition number ",
                                    out.fit.condition, "): ", unidentifiable(reported, out.axes),
                                    "."));
  }
  if (out.lag.available && std::abs(out.lag.lag_s) > kLeastLagS &&
      std::abs(out.lag.lag_s) > 4.0 * out.lag.standard_error_s) {
    out.fit.outcome |= kForceLag;
    out.warnings.push_back(sentence(
        3, "The force channel seems to be ", std::abs(out.lag.lag_s) * 1e3, " ms (standard error ",
        out.lag.standard_error_s * 1e3, " ms) ", out.lag.lag_s > 0 ? "later" : "earlier",
        " than the position: a lag t changes the damping by about t (M w^2 - K) at w rad/s. A "
        "model that does not fit can look like a lag."));
  }
  if ((out.fit.outcome & kNotFinite) != 0) {
    out.warnings.push_back(
        "The stiffness matrix is singular, so there is no equilibrium position x0.");
  }
  if ((out.fit.outcome & kNotConverged) != 0) {
    out.warnings.push_back("The constrained fit did not converge to its tolerance.");
  }
  if (out.fit.constrained) {
    out.notes.push_back(
        "A positive-semidefinite constraint is active: standard errors are those of the symmetric "
        "model without it.");
  }
  if (out.held_out_rows == 0) {
    out.warnings.push_back(
        "No data were held out, so the fit could not be validated on fresh data.");
  }
  if (out.report.short_trials) {
    out.notes.push_back(
        "A trial is shorter than the low pass needs to settle: its ends were extended by less than "
        "the filter's memory.");
  }
  out.provenance = out.record->provenance();
  out.provenance.push_back(sentence(
      6, "prepared: Savitzky-Golay order ", out.report.order, ", window ", out.report.window,
      out.report.lowpass_order > 0
          ? sentence(6, ", zero-phase Butterworth order ", out.report.lowpass_order, " at ",
                     out.report.lowpass_hz, " Hz (-3 dB at ", out.report.effective_cutoff_hz,
                     " Hz)")
          : std::string(", no low pass")));
  out.provenance.push_back(sentence(
      6, "identified: ",
      out.fit.estimator == Estimator::kInstrumental ? "instrumental variables" : "least squares",
      ", ", rows, " rows, ",
      options.errors == ErrorModel::kNeweyWest
          ? sentence(6, "Newey-West errors, lag ", options.hac_lag_s, " s")
          : sentence(6, "block bootstrap, ", options.bootstrap, " resamples"),
      ", seed ", options.seed));
}

}  // namespace ulna
