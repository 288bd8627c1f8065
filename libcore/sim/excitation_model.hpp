// What the nerves of a passively moved arm do: excitation of each muscle from its own length and
// its rate. Levels are 0 to 1 and clipped there.
#pragma once

#include <vector>

#include "plant/mobilised.hpp"

namespace ulna::sim {

enum class ExcitationKind {
  kConstant,  // co-contraction at a level: the published one
  // level + g_v max(0, v - v_0) + g_l max(0, l - l_0), from normalised length l and its rate v a
  // delay ago: a stretch reflex with thresholds.
  kStretchReflex,
  // level + g_v max(0, v - v_0) without delay, of muscles that the movement stretches: Lance's
  // velocity-dependent resistance.
  kVelocityDependent,
};

struct ExcitationModel {
  ExcitationKind kind = ExcitationKind::kConstant;
  double flexors = 0.4;    // level of the elbow's flexors
  double extensors = 0.4;  // of its extensors
  double shoulder = 0.0;   // of the shoulder's muscles
  // The level of the extensors is chosen so that the arm at the start pulls neither way.
  bool balanced = false;
  double rate_gain = 0.5;         // g_v, s: excitation for one optimal length a second
  double rate_threshold = 0.1;    // v_0, 1/s
  double length_gain = 0.0;       // g_l, excitation for one optimal length
  double length_threshold = 1.0;  // l_0
  double delay_s = 0.04;          // of the reflex

  // Throws Error (kArgument) with the option that cannot be.
  void check() const;
};

// The nerves of one run: keeps the past that a reflex answers to.
class Nerves {
 public:
  // Chooses the level of the extensors at `human_angle` where the model is balanced. Throws Error
  // (kAnalysis) when no level balances the flexors.
  Nerves(const ExcitationModel& model, const MobilisedPlant& plant, const VectorRef& human_angle,
         double step_s);

  // Excitation for the next step; one call a step, after it.
  Vector excitation(const MobilisedRun& run);
  Vector levels() const { return levels_; }

 private:
  ExcitationModel model_;
  Vector levels_;
  std::vector<Vector> length_, rate_;  // of the last `delay` steps, in a ring
  Index calls_ = 0;
};

}  // namespace ulna::sim
