#include "impedance/reflex_words.hpp"

#include <cmath>

#include "base/words.hpp"
#include "impedance/words.hpp"

namespace ulna {

void explain_reflex(ReflexEstimate& e) {
  const ReflexOptions& o = e.options;
  const auto warn = [&](ReflexOutcome bit, std::string words) {
    e.outcome |= bit;
    e.warnings.push_back(std::move(words));
  };
  const double inertia_error = std::sqrt(e.fit.covariance(kReflexM, kReflexM));
  if (e.fit.value[kReflexM] < -3.0 * inertia_error) warn(kReflexSuspectData, kNegativeInertia);
  if (e.held_out_rows == 0) {
    e.notes.push_back("Nothing was held out: the VAF is of the data behind the estimate.");
  }
  if (!std::isfinite(e.p_value)) {
    e.outcome |= kReflexUntested;
    e.notes.push_back(sentence(3, "Only ", e.test_blocks,
                               " blocks: too few to test whether there is a reflex path; record "
                               "longer or shorten block_s."));
  } else if (e.p_value > o.level) {
    warn(kReflexNotSignificant, sentence(2, "No reflex path is shown (p = ", e.p_value,
                                         "): its gain, dynamics and delay mean nothing."));
  }
  const bool shown = (e.outcome & kReflexNotSignificant) == 0;
  if ((e.outcome & kReflexDelayAtBound) != 0 && shown) {
    const double delay = e.fit.value[kReflexDelay];
    e.warnings.push_back(
        sentence(3, "The delay lies at the end of its range (", 1e3 * delay,
                 " ms): slow or direction-dependent intrinsic torque passes for a reflex. Give the "
                 "intrinsic path an impulse response, add powers of the position, or set a "
                 "physiological range."));
  }
  if ((e.outcome & kReflexDynamicsAtBound) != 0 && shown) {
    e.warnings.push_back(
        "The reflex dynamics lie at the end of their range: the data do not determine them.");
  }
  if (!e.fit.converged) {
    warn(kReflexNotConverged, "The search for delay and dynamics did not converge.");
  }
  const double judged = std::isfinite(e.vaf) ? e.vaf : e.vaf_train;
  if (judged < o.poor_vaf) {
    warn(kReflexPoorFit, sentence(3, "Both paths together account for ", judged,
                                  " % of the torque's variance, less than ", o.poor_vaf, " %."));
  }
  if (std::isfinite(e.vaf_train_other)) {
    e.notes.push_back(sentence(4, "Velocity of the other direction would account for ",
                               e.vaf_train_other, " % of the identification part, this one for ",
                               e.vaf_train, " %."));
  }
  if (e.impulse.available && std::isfinite(e.impulse.vaf)) {
    e.notes.push_back(sentence(4, "With impulse responses for both paths the held-out VAF is ",
                               e.impulse.vaf, " %; of their ", e.impulse.values,
                               " values the data determine about ", std::lround(e.impulse.rank),
                               ", the rest is smoothed."));
  } else if (o.reflex_irf_s > 0.0 && !e.impulse.available) {
    e.notes.push_back("The trials are too short for impulse responses of both paths.");
  }
  e.notes.push_back(
      "The position is taken as the cause of the torque, as under a position-controlled robot.");
  e.provenance.push_back(sentence(
      6, "parallel cascade: ",
      o.intrinsic == Intrinsic::kSecondOrder ? "second-order" : "impulse-response",
      " intrinsic path, reflex of order ", o.order, " on the ", e.side > 0 ? "rising" : "falling",
      " side, delay ", o.delay_min_s, " to ", o.delay_max_s, " s"));
}

}  // namespace ulna
