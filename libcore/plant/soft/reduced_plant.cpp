#include "plant/soft/reduced_plant.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

// Metres and radians in one norm: a radian moves the skin by about this much.
constexpr double kTurnLength = 0.05;

Twist turn_scale() {
  Twist scale = Twist::Ones();
  scale.tail<3>().setConstant(1.0 / kTurnLength);
  return scale;
}

// The nearest symmetric matrix without negative eigenvalues.
Matrix6 semidefinite(const Matrix6& m) {
  const Eigen::SelfAdjointEigenSolver<Matrix6> solver(0.5 * (m + m.transpose()));
  const Twist values = solver.eigenvalues().cwiseMax(0.0);
  const Matrix6 made =
      solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
  return 0.5 * (made + made.transpose());
}

// Where the limb was, and what one part did to it there.
struct Path {
  std::vector<Twist> at;
  std::vector<Wrench> wrench;

  template <class Value>
  static Value mean(const std::vector<Value>& values) {
    Value sum = Value::Zero();
    for (const Value& v : values) sum += v;
    return sum / static_cast<double>(values.size());
  }
};

// Symmetric K nearest to `prior` among those that explain the path: the least
// of sum |w - mean w + K (x - mean x)|^2 + weight |K - prior|^2, in scaled
// coordinates. Its correction E solves E S + S E + 2 weight E = R + R', S = sum
// dx dx', R = sum (what the prior misses) dx'.
Matrix6 explain(const Path& path, const Matrix6& prior) {
  const Twist scale = turn_scale();
  const Twist x0 = Path::mean(path.at);
  const Wrench w0 = Path::mean(path.wrench);
  const Matrix6 scaled = scale.asDiagonal() * prior * scale.asDiagonal();
  Matrix6 moved = Matrix6::Zero(), missed = Matrix6::Zero();
  for (std::size_t i = 0; i < path.at.size(); ++i) {
    const Twist dx = (path.at[i] - x0).cwiseQuotient(scale);
    const Wrench dw = (path.wrench[i] - w0).cwiseProduct(scale);
    moved += dx * dx.transpose();
    missed += (-dw - scaled * dx) * dx.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6> solver(moved);
  const Matrix6& axes = solver.eigenvectors();
  Matrix6 correction = axes.transpose() * (missed + missed.transpose()) * axes;
  const double weight = 1e-3 * solver.eigenvalues().sum() + 1e-300;
  for (int a = 0; a < 6; ++a) {
    for (int b = 0; b < 6; ++b) {
      correction(a, b) /= solver.eigenvalues()[a] + solver.eigenvalues()[b] + 2.0 * weight;
    }
  }
  const Matrix6 found = semidefinite(scaled + axes * correction * axes.transpose());
  return scale.cwiseInverse().asDiagonal() * found * scale.cwiseInverse().asDiagonal();
}

double misfit_of(const Bushing& bushing, const Path& path) {
  const Twist scale = turn_scale();
  double missed = 0.0, whole = 0.0;
  for (std::size_t i = 0; i < path.at.size(); ++i) {
    const Wrench change = path.wrench[i] - bushing.preload;
    const Wrench answer = -bushing.stiffness * (path.at[i] - bushing.origin);
    missed += (change - answer).cwiseProduct(scale).squaredNorm();
    whole += change.cwiseProduct(scale).squaredNorm();
  }
  return std::sqrt(missed / std::max(whole, 1e-300));
}

}  // namespace

void ReductionOptions::check() const {
  require(std::isfinite(start) && std::isfinite(end) && start != end, "start",
          "the movement must have a start and an end that differ");
  require(poses >= 4 && poses <= 1000, "poses",
          "the movement must be followed through 4 to 1000 poses");
  require(activation >= 0.0 && activation <= 1.0, "activation",
          "activation must be between 0 and 1");
}

Reduction reduce(const SoftPlant& full, const ReductionOptions& options, Token* token) {
  options.check();
  constexpr int kSteps = 4;  // to a balance that nothing disturbs any more
  const ExoScene& scene = full.plant().scene();
  Vector angle(static_cast<Index>(scene.exo.links.size()));
  for (Index j = 0; j < angle.size(); ++j) {
    angle[j] = scene.exo.links[static_cast<std::size_t>(j)].reference;
  }
  angle[angle.size() - 1] = options.start;
  StillArm arm(full, angle);
  arm.balance(kSteps);
  arm.activate(options.activation);
  arm.balance(kSteps);

  const std::size_t parts = 2 * arm.size();
  std::vector<Path> path(parts);
  std::vector<Matrix6> stiffness(parts, Matrix6::Zero()), damping(parts, Matrix6::Zero());
  const auto take = [&] {
    for (std::size_t i = 0; i < arm.size(); ++i) {
      const Twist at = coordinates(arm.interface(i).donned(), arm.pose(i));
      const StillArm::Resistance stiff = arm.stiffness(i);
      const StillArm::Resistance damp = arm.damping(i);
      path[2 * i].at.push_back(at);
      path[2 * i + 1].at.push_back(at);
      path[2 * i].wrench.push_back(arm.interface(i).cuff().wrench);
      path[2 * i + 1].wrench.push_back(arm.interface(i).strap().wrench);
      stiffness[2 * i] += stiff.cuff;
      stiffness[2 * i + 1] += stiff.strap;
      damping[2 * i] += damp.cuff;
      damping[2 * i + 1] += damp.strap;
    }
  };
  take();
  for (int k = 1; k < options.poses; ++k) {
    step(token, static_cast<double>(k) / options.poses);
    const double share = static_cast<double>(k) / (options.poses - 1);
    arm.bend(options.start + share * (options.end - options.start));
    take();
  }

  Reduction reduction;
  for (std::size_t k = 0; k < parts; ++k) {
    const SoftInterfaceOptions& o = full.interfaces()[k / 2]->options();
    Bushing bushing{.name = o.name + (k % 2 == 0 ? "_cuff" : "_strap"),
                    .interface = static_cast<int>(k / 2),
                    .strap = k % 2 == 1,
                    .origin = Path::mean(path[k].at),
                    .preload = Path::mean(path[k].wrench)};
    bushing.stiffness = explain(path[k], stiffness[k] / options.poses);
    bushing.damping = semidefinite(damping[k] / options.poses);
    reduction.misfit.push_back(misfit_of(bushing, path[k]));
    reduction.bushings.push_back(std::move(bushing));
  }
  return reduction;
}

}  // namespace ulna
