#include "plant/isometric.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

Vector degrees(std::initializer_list<double> values) {
  Vector angle(static_cast<Index>(values.size()));
  std::copy(values.begin(), values.end(), angle.data());
  return angle * (kPi / 180.0);
}

Vector vector(std::initializer_list<double> values) {
  Vector v(static_cast<Index>(values.size()));
  std::copy(values.begin(), values.end(), v.data());
  return v;
}

// Force of each muscle as the engine has it, at one excitation for all and no movement.
Vector forces_at(EngineRun& run, double excitation) {
  run.velocity().setZero();
  run.control().setZero();
  run.activation().setConstant(excitation);
  run.forward();
  return run.actuator_force();
}

}  // namespace

MuscleTable muscle_table(const EngineModel& model, const std::string& joint,
                         const std::vector<std::string>& muscles, const VectorRef& angle,
                         const VectorRef& pose, Token* token) {
  const Index position = model.position_of(joint);
  const Index velocity = model.velocity_of(joint);
  require(pose.size() == 0 || pose.size() == model.positions(), "pose",
          "pose has " + std::to_string(pose.size()) + " numbers, " +
              std::to_string(model.positions()) + " are expected");
  require(angle.size() > 0, "angle", "angle must have one entry or more");
  require_finite(angle, "angle");
  std::vector<Index> columns;
  for (const std::string& name : muscles) {
    const Index i = model.at(Part::kActuator, name);
    model.values(ModelQuantity::kMuscle, name);
    columns.push_back(i);
  }
  const auto count = static_cast<Index>(columns.size());
  MuscleTable t;
  t.muscles = muscles;
  t.angle = angle;
  for (Matrix* m : {&t.length, &t.moment, &t.active, &t.passive}) m->resize(angle.size(), count);
  EngineRun run(model);
  run.position() = pose.size() == 0 ? model.reference() : Vector(pose);
  for (Index i = 0; i < angle.size(); ++i) {
    step(token, static_cast<double>(i) / static_cast<double>(angle.size()));
    run.position()[position] = angle[i];
    const Vector passive = forces_at(run, 0.0);
    const Vector full = forces_at(run, 1.0);
    const Matrix moment = run.actuator_moment();
    const Vector length = run.actuator_length();
    for (Index k = 0; k < count; ++k) {
      const Index c = columns[static_cast<std::size_t>(k)];
      // The engine's force along a path is negative where the muscle pulls.
      t.length(i, k) = length[c];
      t.moment(i, k) = -moment(c, velocity);
      t.passive(i, k) = passive[c] * moment(c, velocity);
      t.active(i, k) = (full[c] - passive[c]) * moment(c, velocity);
    }
  }
  step(token, 1.0);
  return t;
}

TorquePeak peak_of(const VectorRef& angle, const VectorRef& torque) {
  require(angle.size() > 0 && angle.size() == torque.size(), "torque",
          "torque must have one entry for each angle");
  Index at = 0;
  torque.cwiseAbs().maxCoeff(&at);
  return {torque[at], angle[at]};
}

TorqueReference amis_torque() {
  return {"Amis", degrees({0, 30, 60, 90, 120, 145}), vector({53, 68, 76, 70, 51, 35}),
          vector({-35, -41, -51, -52, -46, -42})};
}

TorqueReference buchanan_torque() {
  return {"Buchanan", degrees({20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120, 130}),
          vector({40, 44, 50, 56, 62, 69, 74, 78, 78, 75, 68, 57}),
          vector({-18, -23, -30, -35, -40, -45, -48, -50, -51, -50, -47, -41})};
}

double torque_error(const VectorRef& angle, const VectorRef& torque,
                    const VectorRef& reference_angle, const VectorRef& reference_torque) {
  require(angle.size() >= 2 && angle.size() == torque.size(), "torque",
          "torque must have one entry for each of two angles or more");
  require(reference_angle.size() == reference_torque.size(), "reference",
          "the reference must have one torque for each angle");
  double sum = 0.0;
  int count = 0;
  for (Index r = 0; r < reference_angle.size(); ++r) {
    const double x = reference_angle[r];
    Index i = 0;
    while (i + 2 < angle.size() && angle[i + 1] < x) ++i;
    require(angle[i] < angle[i + 1], "angle", "angle must rise from entry to entry");
    // Written angles are rounded: half a millionth of a degree outside counts as inside.
    if (x < angle[0] - 1e-8 || x > angle[angle.size() - 1] + 1e-8) continue;
    const double share = (x - angle[i]) / (angle[i + 1] - angle[i]);
    const double read = torque[i] + share * (torque[i + 1] - torque[i]);
    sum += (read - reference_torque[r]) * (read - reference_torque[r]);
    ++count;
  }
  if (count == 0) {
    throw Error(Fault::kData, "angle", "no angle of the reference is within those of the curve");
  }
  return std::sqrt(sum / count);
}

}  // namespace ulna
