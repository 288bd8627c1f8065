#include "sim/excitation_model.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna::sim {
namespace {

void check_level(double level, const char* argument) {
  require(std::isfinite(level) && level >= 0.0 && level <= 1.0, argument,
          sentence(6, "the excitation of the ", argument, " is ", level,
                   "; it must be between 0 and 1"));
}

void check_number(double value, const char* argument) {
  require(std::isfinite(value) && value >= 0.0 && value <= 1000.0, argument,
          std::string(argument) + " must be between 0 and 1000");
}

Vector group_levels(const ExcitationModel& model, const std::vector<MuscleGroup>& groups) {
  Vector levels(static_cast<Index>(groups.size()));
  for (Index k = 0; k < levels.size(); ++k) {
    const MuscleGroup group = groups[static_cast<std::size_t>(k)];
    levels[k] = group == MuscleGroup::kFlexor     ? model.flexors
                : group == MuscleGroup::kExtensor ? model.extensors
                                                  : model.shoulder;
  }
  return levels;
}

// Torque at a pose is linear in activation; the elbow is the joint that the extensors turn most.
double balancing_level(const ExcitationModel& model, const MobilisedPlant& plant,
                       const VectorRef& angle) {
  const std::unique_ptr<MuscleProbe> probe = plant.probe();
  const Vector rest = Vector::Zero(angle.size());
  ExcitationModel apart = model;
  apart.extensors = 0.0;
  const Vector without = probe->torque(angle, rest, group_levels(apart, plant.groups()));
  apart.extensors = 1.0;
  const Vector gain = probe->torque(angle, rest, group_levels(apart, plant.groups())) - without;
  Index elbow = 0;
  const bool any = gain.size() > 0 && gain.cwiseAbs().maxCoeff(&elbow) > 1e-9;
  const double level = any ? -without[elbow] / gain[elbow] : -1.0;
  if (!(level >= 0.0 && level <= 1.0)) {
    throw Error(Fault::kAnalysis, "balanced",
                "no excitation of the extensors balances the flexors at the "
                "start: lower the "
                "flexors' or start elsewhere");
  }
  return level;
}

}  // namespace

void ExcitationModel::check() const {
  check_level(flexors, "flexors");
  check_level(extensors, "extensors");
  check_level(shoulder, "shoulder");
  check_number(rate_gain, "rate_gain");
  check_number(rate_threshold, "rate_threshold");
  check_number(length_gain, "length_gain");
  check_number(length_threshold, "length_threshold");
  require(std::isfinite(delay_s) && delay_s >= 0.0 && delay_s <= 1.0, "delay_s",
          "the delay of the reflex must be between 0 and 1 s");
}

Nerves::Nerves(const ExcitationModel& model, const MobilisedPlant& plant,
               const VectorRef& human_angle, double step_s)
    : model_(model) {
  if (model_.balanced) model_.extensors = balancing_level(model_, plant, human_angle);
  levels_ = group_levels(model_, plant.groups());
  const double delay = model_.kind == ExcitationKind::kStretchReflex ? model_.delay_s : 0.0;
  // What a step left is one step old already.
  const auto steps = std::max<Index>(1, static_cast<Index>(std::lround(delay / step_s)));
  length_.resize(static_cast<std::size_t>(steps));
  rate_.resize(static_cast<std::size_t>(steps));
}

Vector Nerves::excitation(const MobilisedRun& run) {
  if (model_.kind == ExcitationKind::kConstant) return levels_;
  const auto ring = static_cast<Index>(length_.size());
  const auto slot = static_cast<std::size_t>(calls_ % ring);
  length_[slot] = run.muscle_length();
  rate_[slot] = run.muscle_rate();
  const auto oldest = static_cast<std::size_t>(calls_ + 1 < ring ? 0 : (calls_ + 1) % ring);
  ++calls_;
  const Vector& length = length_[oldest];
  const Vector& rate = rate_[oldest];
  Vector excitation = levels_;
  for (Index k = 0; k < levels_.size(); ++k) {
    excitation[k] += model_.rate_gain * std::max(0.0, rate[k] - model_.rate_threshold);
    if (model_.kind == ExcitationKind::kStretchReflex) {
      excitation[k] += model_.length_gain * std::max(0.0, length[k] - model_.length_threshold);
    }
  }
  return excitation.cwiseMax(0.0).cwiseMin(1.0);
}

}  // namespace ulna::sim
