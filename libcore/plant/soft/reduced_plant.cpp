#include "plant/soft/reduced_plant.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

using Wrenches = std::array<Wrench, 2>;  // of cuff and strap

LimbPose moved(const LimbPose& pose, const Twist& by) {
  const double angle = by.tail<3>().norm();
  LimbPose after = pose;
  after.position += by.head<3>();
  if (angle > 0.0) {
    after.orientation =
        Eigen::AngleAxisd(angle, by.tail<3>() / angle).toRotationMatrix() * pose.orientation;
  }
  return after;
}

struct Answer {
  Wrenches moving;  // at the end of the move
  Wrenches held;    // some time after
};

Wrenches wrenches_of(const InterfaceRun& run) { return {run.cuff().wrench, run.strap().wrench}; }

// The limb goes to `by` at a steady speed and stays there.
Answer answer(InterfaceRun run, const LimbPose& start, const Twist& by, double dt,
              const ReductionOptions& o) {
  const int moving = std::max(1, static_cast<int>(std::lround(o.ramp / dt)));
  const int holding = std::max(1, static_cast<int>(std::lround(o.hold / dt)));
  Answer answer;
  for (int i = 0; i < moving; ++i) {
    run.impose(moved(start, by * i / moving), by / (moving * dt));
  }
  answer.moving = wrenches_of(run);
  const LimbPose there = moved(start, by);
  for (int i = 0; i < holding; ++i) run.impose(there, Twist::Zero());
  answer.held = wrenches_of(run);
  return answer;
}

// The nearest symmetric matrix without negative eigenvalues.
Matrix6 semidefinite(const Matrix6& m) {
  const Eigen::SelfAdjointEigenSolver<Matrix6> solver(0.5 * (m + m.transpose()));
  const Twist values = solver.eigenvalues().cwiseMax(0.0);
  const Matrix6 made =
      solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
  return 0.5 * (made + made.transpose());
}

// Metres and radians in one norm: a radian moves the skin by about this much.
constexpr double kLength = 0.05;

double size_of(const Matrix6& m) {
  Twist scale;
  scale << 1.0, 1.0, 1.0, 1.0 / kLength, 1.0 / kLength, 1.0 / kLength;
  return (scale.asDiagonal() * m * scale.asDiagonal()).norm();
}

}  // namespace

void ReductionOptions::check() const {
  const auto positive = [](double value, const char* argument) {
    require(std::isfinite(value) && value > 0.0, argument,
            std::string(argument) + " must be positive");
  };
  positive(settling, "settling");
  positive(shift, "shift");
  positive(turn, "turn");
  positive(ramp, "ramp");
  positive(hold, "hold");
  require(std::isfinite(elbow), "elbow", "the elbow's angle must be finite");
  require(activation >= 0.0 && activation <= 1.0, "activation",
          "activation must be between 0 and 1");
}

Reduction probe(const InterfaceRun& interface, const LimbPose& pose, int index,
                const std::string& name, double dt, const ReductionOptions& o) {
  // What it would come to without being moved.
  const Answer rest = answer(interface, pose, Twist::Zero(), dt, o);
  Matrix6 stiffness[2], damping[2], one_sided[2];
  for (int axis = 0; axis < 6; ++axis) {
    const double amplitude = axis < 3 ? o.shift : o.turn;
    Twist by = Twist::Zero();
    by[axis] = amplitude;
    const Answer there = answer(interface, pose, by, dt, o);
    const Answer back = answer(interface, pose, -by, dt, o);
    for (std::size_t part = 0; part < 2; ++part) {
      stiffness[part].col(axis) = -(there.held[part] - back.held[part]) / (2.0 * amplitude);
      one_sided[part].col(axis) = -(there.held[part] - rest.held[part]) / amplitude;
      const Wrench extra =
          (there.moving[part] - there.held[part]) - (back.moving[part] - back.held[part]);
      damping[part].col(axis) = -extra / (2.0 * amplitude / o.ramp);
    }
  }
  Reduction reduction;
  for (std::size_t part = 0; part < 2; ++part) {
    const double size = std::max(size_of(stiffness[part]), 1e-12);
    reduction.asymmetry.push_back(size_of(0.5 * (stiffness[part] - stiffness[part].transpose())) /
                                  size);
    reduction.linearity.push_back(size_of(one_sided[part] - stiffness[part]) / size);
    reduction.bushings.push_back({.name = name + (part == 0 ? "_cuff" : "_strap"),
                                  .interface = index,
                                  .strap = part == 1,
                                  .origin = coordinates(interface.donned(), pose),
                                  .preload = rest.held[part],
                                  .stiffness = semidefinite(stiffness[part]),
                                  .damping = semidefinite(damping[part])});
  }
  return reduction;
}

Reduction reduce(const SoftPlant& full, const ReductionOptions& options, Token* token) {
  options.check();
  require(!full.is_reduced(), "plant", "the plant is reduced already");
  // The device stands still: so much damping that it does not move while the arm settles in it.
  const ExoScene& scene = full.plant().scene();
  std::vector<Change> still;
  for (const ExoLink& link : scene.exo.links) {
    still.push_back({ModelQuantity::kJointDamping, link.joint, {1e6}});
  }
  EngineRun run(full.model().changed(still));
  Vector angle(static_cast<Index>(scene.exo.links.size()));
  for (Index j = 0; j < angle.size(); ++j) {
    angle[j] = scene.exo.links[static_cast<std::size_t>(j)].reference;
  }
  angle[angle.size() - 1] = options.elbow;
  full.attach(run, angle);
  for (const Muscle& muscle : scene.arm.muscles) {
    if (muscle.group == MuscleGroup::kShoulder) continue;
    run.control()[full.model().at(Part::kActuator, muscle.name)] = options.activation;
  }
  const double dt = full.model().timestep();
  const auto steps = static_cast<Index>(std::lround(options.settling / dt));
  for (Index i = 0; i < steps; ++i) {
    run.step();
    step(token, 0.5 * static_cast<double>(i) / static_cast<double>(steps));
  }
  Reduction all;
  for (std::size_t i = 0; i < full.interfaces().size(); ++i) {
    Reduction one = probe(interface_run(run, i), interface_pose(run, i), static_cast<int>(i),
                          full.interfaces()[i]->options().name, dt, options);
    all.bushings.insert(all.bushings.end(), one.bushings.begin(), one.bushings.end());
    all.asymmetry.insert(all.asymmetry.end(), one.asymmetry.begin(), one.asymmetry.end());
    all.linearity.insert(all.linearity.end(), one.linearity.begin(), one.linearity.end());
    step(token, 0.5 + 0.5 * static_cast<double>(i + 1) / static_cast<double>(all.bushings.size()));
  }
  return all;
}

}  // namespace ulna
