// What errors of the robot's parameters do to M, B and K: linear propagation against identifying
// anew.
#include "impedance/force_budget.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "../ident/made_robot.hpp"
#include "base/error.hpp"
#include "ident/virtual_sensor.hpp"
#include "impedance/natural.hpp"

namespace ulna {
namespace {

Vector natural(const ImpedanceEstimate& e) {
  Vector out(14);
  out << e.fit.m.transpose().reshaped(), e.fit.b.transpose().reshaped(),
      e.fit.k.transpose().reshaped(), e.fit.x0;
  return out;
}

// Table A.1's standard deviations, ten times over so that they matter.
Matrix parameter_covariance() {
  const Vector sd = 10.0 * Vector{{3e-5, 7e-5, 4e-5, 1.76e-3, 7.2e-4}};
  Matrix out = sd.cwiseAbs2().asDiagonal();
  out(0, 1) = out(1, 0) = 0.5 * sd[0] * sd[1];
  return out;
}

VirtualForce sensed(const MadeLog& log, const CapstanParameters& robot, bool errors,
                    const char* reference) {
  VirtualSensorOptions options;
  options.acceleration = "a";
  options.reference = reference;
  if (errors) options.parameter_covariance = parameter_covariance();
  return sense_force(*log.record, CapstanRobot(robot), options);
}

TEST(ForceBudget, IsTheDerivativeOfTheIdentification) {
  MadeRobot made;
  made.angle_noise = 1e-5;
  made.torque_noise = 0.01;
  made.wobble_rad = 0.01;
  const MadeLog log = make_robot_log(made);
  for (const char* reference : {"", "ref"}) {
    const VirtualForce force = sensed(log, {}, true, reference);
    const ImpedanceEstimate estimate = identify_impedance(force.record, {});
    const ForceBudget budget = force_budget(estimate, force.errors);
    const Vector before = natural(estimate);
    for (std::size_t k = 0; k < 5; ++k) {
      CapstanParameters changed;
      const double h = 1e-5;
      changed.alpha[k] += h;
      const VirtualForce other = sensed(log, changed, false, reference);
      const Vector slope = (natural(identify_impedance(other.record, {})) - before) / h;
      for (Index i = 0; i < 14; ++i) {
        // M, B and K are linear in the force; x0 = -K^-1 c is not, and h is a step.
        const double tolerance = i < 12 ? 1e-6 : 1e-3;
        EXPECT_NEAR(budget.sensitivity(i, static_cast<Index>(k)), slope[i],
                    tolerance * std::max(1.0, std::abs(slope[i])))
            << "parameter " << k << ", natural " << i << ", reference " << reference;
      }
    }
  }
}

TEST(ForceBudget, CoversWhatWrongRobotsGive) {
  // Monte Carlo: robots drawn from the covariance, one recording.
  MadeRobot made;
  made.rate_hz = 250.0;
  made.duration_s = 20.0;
  const MadeLog log = make_robot_log(made);
  const VirtualForce force = sensed(log, {}, true, "");
  const ImpedanceEstimate estimate = identify_impedance(force.record, {});
  const ForceBudget budget = force_budget(estimate, force.errors);
  const Matrix root = parameter_covariance().llt().matrixL();
  Random random(9);
  const int draws = 150;
  Matrix table(draws, 12);
  for (int i = 0; i < draws; ++i) {
    Vector u(5);
    for (double& v : u) v = random.normal();
    CapstanParameters drawn;
    const Vector shift = root * u;
    for (std::size_t k = 0; k < 5; ++k) drawn.alpha[k] += shift[static_cast<Index>(k)];
    table.row(i) =
        natural(identify_impedance(sensed(log, drawn, false, "").record, {})).head(12).transpose();
  }
  const Matrix centred = table.rowwise() - table.colwise().mean();
  const Vector scatter = (centred.colwise().squaredNorm() / (draws - 1)).cwiseSqrt().transpose();
  for (Index k = 0; k < 12; ++k) {
    // Four standard errors of a standard deviation from 150 draws: 23 %.
    EXPECT_NEAR(scatter[k] / std::sqrt(budget.systematic(k, k)), 1.0, 0.24) << k;
  }
  EXPECT_GT((budget.total - budget.systematic).diagonal().minCoeff(), 0.0);
}

TEST(ForceBudget, RefusesAnotherRecord) {
  MadeRobot made;
  made.duration_s = 20.0;
  made.rate_hz = 250.0;
  const VirtualForce force = sensed(make_robot_log(made), {}, true, "");
  made.duration_s = 25.0;
  const VirtualForce other = sensed(make_robot_log(made), {}, true, "");
  const ImpedanceEstimate estimate = identify_impedance(other.record, {});
  const auto refused = [&](const ForceErrors& errors) {
    try {
      force_budget(estimate, errors);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refused(force.errors).find("rows"), std::string::npos);
  EXPECT_NE(refused({}).find("nothing is known"), std::string::npos);
}

}  // namespace
}  // namespace ulna
