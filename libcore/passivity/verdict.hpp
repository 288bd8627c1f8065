// Is the arm passive, and how sure is that? Two approaches side by side: the eigenvalues of the
// identified model over its uncertainty, and the energy that flowed in the recording.
#pragma once

#include <string>
#include <vector>

#include "impedance/estimate.hpp"
#include "passivity/energy.hpp"
#include "passivity/model.hpp"

namespace ulna {

enum class Approach { kModel, kEnergy };

struct VerdictOptions {
  double antisymmetry_threshold = 0.15;
  double level = 0.95;      // of intervals, and the probability that decides
  double min_share = 0.05;  // of the motion, before which the energy index is not judged
  double block_s = 2.0;     // of the energy bootstrap
  Index bootstrap = 1000;
  std::uint64_t seed = 0;
};

struct Verdict {
  Answer answer = Answer::kUndecided;
  Approach approach = Approach::kModel;  // what the verdict rests on
  double probability = 0.0;              // that the arm is passive, by that approach

  ModelMargins model;  // of the estimate itself
  // The antisymmetric part is below the threshold, or within its own error: it does not count.
  bool m_dropped = true;
  bool k_dropped = true;
  double model_probability = 0.0;
  double excess_interval[2] = {0.0, 0.0};  // of model.b_min
  double m_min_interval[2] = {0.0, 0.0};
  double k_min_interval[2] = {0.0, 0.0};

  EnergyIndex energy;               // with beta from the identified stored energy
  double energy_probability = 0.0;  // NaN when the record is too short for it
  double energy_interval[2] = {0.0, 0.0};
  double beta_j = 0.0;  // smallest over the trials
  std::vector<EnergySeries> series;

  std::string reason;        // one sentence: what it rests on
  std::string would_change;  // one sentence: what would change it
};

Verdict assess_passivity(const ImpedanceEstimate& estimate, const VerdictOptions& options,
                         Token* token = nullptr);

}  // namespace ulna
