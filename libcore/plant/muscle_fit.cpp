#include "plant/muscle_fit.hpp"

#include <nlopt.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/error.hpp"
#include "plant/muscle_curves.hpp"

namespace ulna {
namespace {

constexpr double kPriorWeight = 0.001;  // of a range that is 0.1 off the one given
constexpr double kPassiveShare = 0.75;  // of the passive limit that is free of cost
constexpr double kPeakWidth = 20.0 * kPi / 180.0;
constexpr double kPeakMargin = 0.5;  // N m
constexpr int kRounds = 4;           // subplex begins again with fresh steps

void check_table(const MuscleTable& table, const std::vector<Muscle>& muscles) {
  require(table.angle.size() >= 3, "table", "the table must have three angles or more");
  require(muscles.size() == table.muscles.size(), "muscles",
          "there are " + std::to_string(muscles.size()) + " muscles, the table has " +
              std::to_string(table.muscles.size()));
  for (std::size_t k = 0; k < muscles.size(); ++k) {
    require(muscles[k].name == table.muscles[k], "muscles",
            "muscle '" + muscles[k].name + "' is '" + table.muscles[k] + "' in the table");
  }
}

TorqueCurves curves_of(const MuscleTable& table, const std::vector<Muscle>& muscles) {
  const MuscleCurves shape;
  const Index count = table.angle.size();
  TorqueCurves c{Vector::Zero(count), Vector::Zero(count), Vector::Zero(count)};
  for (std::size_t k = 0; k < muscles.size(); ++k) {
    const Muscle& m = muscles[k];
    const auto column = static_cast<Index>(k);
    const double shortest = table.length.col(column).minCoeff();
    const double span = table.length.col(column).maxCoeff() - shortest;
    for (Index i = 0; i < count; ++i) {
      const double share = (table.length(i, column) - shortest) / span;
      const double length = m.range[0] + share * (m.range[1] - m.range[0]);
      const double torque = m.force * table.moment(i, column);
      c.passive[i] += torque * shape.passive(length);
      if (m.group == MuscleGroup::kFlexor) c.flexion[i] += torque * shape.active(length);
      if (m.group == MuscleGroup::kExtensor) c.extension[i] += torque * shape.active(length);
    }
  }
  c.flexion += c.passive;
  c.extension += c.passive;
  return c;
}

double square(double x) { return x * x; }

// A curve's value at an angle, to the table's nearest angle.
double at(const MuscleTable& table, const Vector& curve, double angle) {
  Index i = 0;
  (table.angle.array() - angle).abs().minCoeff(&i);
  return curve[i];
}

class Problem {
 public:
  Problem(const MuscleTable& table, const std::vector<Muscle>& muscles, MuscleFitOptions options,
          Token* token)
      : table_(table), start_(muscles), options_(std::move(options)), token_(token) {}

  // Variables: the two scales, then lower end and width of each range.
  std::size_t size() const { return 2 + 2 * start_.size(); }
  std::vector<double> start() const {
    std::vector<double> x = {1.0, 1.0};
    for (const Muscle& m : start_) {
      x.push_back(std::clamp(m.range[0], kLower[0], kLower[1]));
      x.push_back(std::clamp(m.range[1] - m.range[0], kWidth[0], kWidth[1]));
    }
    return x;
  }
  std::vector<double> bound(int side) const {
    std::vector<double> x(size(), kWidth[side]);
    x[0] = x[1] = kScale[side];
    for (std::size_t k = 0; k < start_.size(); ++k) x[2 + 2 * k] = kLower[side];
    return x;
  }

  std::vector<Muscle> muscles(const double* x) const {
    std::vector<Muscle> muscles = start_;
    for (std::size_t k = 0; k < muscles.size(); ++k) {
      muscles[k].force *= x[muscles[k].group == MuscleGroup::kFlexor ? 0 : 1];
      muscles[k].range[0] = x[2 + 2 * k];
      muscles[k].range[1] = x[2 + 2 * k] + x[3 + 2 * k];
    }
    return muscles;
  }

  double cost(const double* x) {
    ++evaluations_;
    const TorqueCurves c = curves_of(table_, muscles(x));
    return error_cost(c) + peak_cost(c) + passive_cost(c) + prior_cost(x);
  }

  bool stopped() const { return token_ != nullptr && token_->cancelled(); }
  void show(double fraction) const { step(token_, fraction); }
  int evaluations() const { return evaluations_; }

 private:
  static constexpr double kScale[2] = {0.3, 2.0};
  // Well above 0.5, where the engine's muscles begin to push: other poses of the shoulder shorten a
  // path that crosses both joints.
  static constexpr double kLower[2] = {0.65, 1.0};
  static constexpr double kWidth[2] = {0.1, 0.8};

  // The sixteenth power lets the one that is farthest beyond its target decide.
  double error_cost(const TorqueCurves& c) const {
    double cost = 0.0;
    for (const TorqueTarget& t : options_.targets) {
      const double f =
          torque_error(table_.angle, c.flexion, t.reference.angle, t.reference.flexion) /
          t.flexion_error;
      const double e =
          torque_error(table_.angle, c.extension, t.reference.angle, t.reference.extension) /
          t.extension_error;
      cost += std::pow(f, 16.0) + std::pow(e, 16.0);
    }
    return cost;
  }

  // Height, no point higher than the one where the peak is wanted, and none as high far from it; in
  // units of 1 N m.
  double peak_cost(const TorqueCurves& c) const {
    return one_peak_cost(c.flexion, options_.flexion_peak) +
           one_peak_cost(-c.extension,
                         {-options_.extension_peak.torque, options_.extension_peak.angle});
  }

  double one_peak_cost(const Vector& curve, const TorquePeak& wanted) const {
    const double highest = curve.maxCoeff();
    double far = 0.0;
    for (Index i = 0; i < curve.size(); ++i) {
      if (std::fabs(table_.angle[i] - wanted.angle) > kPeakWidth) far = std::max(far, curve[i]);
    }
    return 0.2 * square(highest - wanted.torque) + (highest - at(table_, curve, wanted.angle)) +
           4.0 * std::max(0.0, far + kPeakMargin - highest);
  }

  double passive_cost(const TorqueCurves& c) const {
    double worst = 0.0;
    for (Index i = 0; i < table_.angle.size(); ++i) {
      const double angle = table_.angle[i];
      // The range's ends are angles of the table but for rounding.
      const bool inside = angle > options_.passive_range.lower - 1e-9 &&
                          angle < options_.passive_range.upper + 1e-9;
      if (inside) worst = std::max(worst, std::fabs(c.passive[i]));
    }
    return 10.0 * square(std::max(0.0, worst / options_.passive_limit - kPassiveShare));
  }

  double prior_cost(const double* x) const {
    double cost = 0.0;
    for (std::size_t k = 0; k < start_.size(); ++k) {
      const Muscle& m = start_[k];
      cost += square((x[2 + 2 * k] - m.range[0]) / 0.1) +
              square((x[2 + 2 * k] + x[3 + 2 * k] - m.range[1]) / 0.1);
    }
    return kPriorWeight * cost;
  }

  const MuscleTable& table_;
  const std::vector<Muscle>& start_;
  MuscleFitOptions options_;
  Token* token_;
  int evaluations_ = 0;
};

// NLopt calls through C: nothing may be thrown, and a stop is asked for by a flag.
struct Call {
  Problem* problem;
  nlopt_opt optimiser;
};

double evaluate(unsigned, const double* x, double*, void* data) {
  auto* call = static_cast<Call*>(data);
  if (call->problem->stopped()) nlopt_force_stop(call->optimiser);
  return call->problem->cost(x);
}

double optimise(Problem& problem, std::vector<double>& x, int evaluations) {
  const auto count = static_cast<unsigned>(problem.size());
  const std::unique_ptr<nlopt_opt_s, decltype(&nlopt_destroy)> optimiser(
      nlopt_create(NLOPT_LN_SBPLX, count), &nlopt_destroy);
  if (optimiser == nullptr) throw Error(Fault::kMemory, "", "there is not enough memory to fit");
  Call call{&problem, optimiser.get()};
  nlopt_set_min_objective(optimiser.get(), evaluate, &call);
  nlopt_set_lower_bounds(optimiser.get(), problem.bound(0).data());
  nlopt_set_upper_bounds(optimiser.get(), problem.bound(1).data());
  nlopt_set_initial_step1(optimiser.get(), 0.05);
  nlopt_set_ftol_rel(optimiser.get(), 1e-9);
  nlopt_set_maxeval(optimiser.get(), evaluations);
  double cost = 0.0;
  nlopt_optimize(optimiser.get(), x.data(), &cost);
  return cost;
}

}  // namespace

MuscleTable elbow_table(const ExoScene& scene, Token* token) {
  require(scene.coupling == Coupling::kArmOnly, "scene", "the scene must be of the arm alone");
  const ExoPlant plant(scene);
  std::vector<std::string> names;
  for (const Muscle& muscle : scene.arm.muscles) names.push_back(muscle.name);
  const Vector angle = Vector::LinSpaced(126, 0.0, 125.0 * kPi / 180.0);
  return muscle_table(plant.model(), "elbow_flexion", names, angle, Vector(), token);
}

TorqueCurves torque_curves(const MuscleTable& table, const std::vector<Muscle>& muscles) {
  check_table(table, muscles);
  return curves_of(table, muscles);
}

MuscleFit fit_muscles(const MuscleTable& table, const std::vector<Muscle>& muscles,
                      const MuscleFitOptions& options, Token* token) {
  check_table(table, muscles);
  require(options.evaluations >= 1, "evaluations", "evaluations must be 1 or more");
  require(std::isfinite(options.passive_limit) && options.passive_limit > 0.0, "passive_limit",
          "the passive limit must be positive");
  MuscleFitOptions o = options;
  if (o.targets.empty()) o.targets = {{amis_torque(), 12.0, 12.0}, {buchanan_torque(), 6.0, 8.0}};
  for (const TorqueTarget& t : o.targets) {
    require(t.flexion_error > 0.0 && t.extension_error > 0.0, "targets",
            "the errors wanted of " + t.reference.name + " must be positive");
  }
  Problem problem(table, muscles, o, token);
  std::vector<double> x = problem.start();
  MuscleFit fit;
  for (int round = 0; round < kRounds; ++round) {
    problem.show(static_cast<double>(round) / kRounds);
    fit.objective = optimise(problem, x, o.evaluations);
  }
  problem.show(1.0);
  fit.muscles = problem.muscles(x.data());
  fit.flexor_scale = x[0];
  fit.extensor_scale = x[1];
  fit.curves = curves_of(table, fit.muscles);
  fit.evaluations = problem.evaluations();
  return fit;
}

}  // namespace ulna
