#include "estimate/identifiability.hpp"

#include <Eigen/SVD>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "estimate/body_evidence.hpp"

namespace ulna {
namespace {

using Kind = BodySensorKind;

// Of the largest singular value: geometry in metres, so that smaller ones are rounding.
constexpr double kRankTolerance = 1e-9;

Index rank_of(const Matrix& m) {
  if (m.size() == 0) return 0;
  Eigen::JacobiSVD<Matrix> svd(m);
  svd.setThreshold(kRankTolerance);
  return svd.rank();
}

// Rows of motion sensors over the base's six accelerations and the hinges'.
Matrix motion_rows(const SensorSuite& suite, const BodyMotion& motion, const Vector& y) {
  const Index columns = 6 + suite.body().dofs();
  std::vector<Vector> rows;
  for (Index s = 0; s < suite.size(); ++s) {
    const BodySensor& sensor = suite.sensor(s);
    const auto present = [&](Index k) {
      return y.size() == 0 || std::isfinite(y[suite.row(s) + k]);
    };
    if (sensor.kind == Kind::kJointAcceleration) {
      if (present(0)) rows.push_back(Vector::Unit(columns, 6 + suite.body().dof(sensor.link)));
      continue;
    }
    const bool turning = sensor.kind == Kind::kAngularAcceleration;
    if (!turning && sensor.kind != Kind::kAccelerometer) continue;
    Matrix jacobian(6, columns);
    motion.jacobian(sensor.link, sensor.position, jacobian);
    const PlacedSensor placed = placed_sensor(sensor, motion.link(sensor.link), Vector3::Zero());
    for (Index k = 0; k < 3; ++k) {
      if (!present(k)) continue;
      rows.push_back((turning ? jacobian.bottomRows<3>() : jacobian.topRows<3>()).transpose() *
                     placed.axes.col(k));
    }
  }
  Matrix all(static_cast<Index>(rows.size()), columns);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    all.row(static_cast<Index>(i)) = rows[i].transpose();
  }
  return all;
}

void find_motion(const SensorSuite& suite, const BodyMotion& motion, const Vector& y,
                 Identifiability& found) {
  found.motion_unknowns = 6 + suite.body().dofs();
  Matrix rows = motion_rows(suite, motion, y);
  // Square at least, so that all directions that nothing measures have a singular vector.
  const Index given = rows.rows();
  rows.conservativeResize(std::max(given, found.motion_unknowns), Eigen::NoChange);
  rows.bottomRows(rows.rows() - given).setZero();
  Eigen::JacobiSVD<Matrix> svd(rows, Eigen::ComputeThinV);
  svd.setThreshold(kRankTolerance);
  found.motion_rank = given == 0 ? 0 : svd.rank();
  const Matrix open = svd.matrixV().rightCols(found.motion_unknowns - found.motion_rank);
  // A tenth of a direction that nothing measures is worth naming.
  constexpr double kPart = 0.1;
  if (open.cols() == 0) return;
  if (open.topRows<6>().norm() > kPart) found.undetermined.emplace_back("base");
  for (Index k = 0; k < suite.body().dofs(); ++k) {
    if (open.row(6 + k).norm() <= kPart) continue;
    found.undetermined.push_back(suite.body().link(suite.body().link_of_dof(k)).joint);
  }
}

void find_wrenches(const SensorSuite& suite, const BodyMotion& motion, const BodyState& state,
                   Identifiability& found) {
  Matrix wrenches(6, 0), forces(6, 0);
  for (const BodySensor& sensor : suite.sensors()) {
    const bool free = sensor.kind == Kind::kFreeWrench || sensor.kind == Kind::kFreeForce;
    if (!free) continue;
    found.free.push_back(sensor.name);
    const PlacedSensor placed = placed_sensor(sensor, motion.link(sensor.link), state.position);
    Matrix6 frame = Matrix6::Zero();
    frame.topLeftCorner<3, 3>() = placed.axes;
    frame.bottomLeftCorner<3, 3>() = cross_matrix(placed.at) * placed.axes;
    frame.bottomRightCorner<3, 3>() = placed.axes;
    const auto append = [&](Matrix& to, Index count) {
      to.conservativeResize(Eigen::NoChange, to.cols() + count);
      to.rightCols(count) = frame.leftCols(count);
    };
    append(wrenches, sensor.kind == Kind::kFreeForce ? 3 : 6);
    append(forces, 3);
  }
  found.wrench_unknowns = wrenches.cols();
  found.wrench_rank = rank_of(wrenches);
  found.force_unknowns = forces.cols();
  found.force_rank = rank_of(forces);
}

std::string words_of(const Identifiability& f) {
  std::string words;
  const Index open = f.wrench_unknowns - f.wrench_rank;
  if (open > 0) {
    words += sentence(10, "The free wrenches of ", join(f.free), " have ", f.wrench_unknowns,
                      " unknowns and the balance of the body tells ", f.wrench_rank, ": ", open,
                      open == 1 ? " combination is" : " combinations are",
                      " decided by the prior alone.");
    if (f.force_unknowns < f.wrench_unknowns) {
      words += sentence(10, " As pure forces they would leave ", f.force_unknowns - f.force_rank,
                        " of ", f.force_unknowns, " open.");
    }
  }
  if (!f.undetermined.empty()) {
    words += (words.empty() ? "" : " ") + std::string("No sensor tells the acceleration of ") +
             join(f.undetermined) + ".";
  }
  return words.empty() ? "All accelerations and external wrenches are determined." : words;
}

}  // namespace

Identifiability identifiability(const SensorSuite& suite, const BodyState& state, const Vector& y) {
  check_state(suite.body(), state);
  require(y.size() == 0 || y.size() == suite.rows(), "y",
          sentence(10, "y has ", y.size(), " numbers, the sensors have ", suite.rows(), " rows"));
  BodyMotion motion(suite.shared_body());
  motion.move(state);
  Identifiability found;
  find_wrenches(suite, motion, state, found);
  find_motion(suite, motion, y, found);
  found.words = words_of(found);
  return found;
}

}  // namespace ulna
