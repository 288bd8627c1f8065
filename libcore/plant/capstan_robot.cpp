#include "plant/capstan_robot.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

// (A.2)
constexpr std::array<double, 2> kLowest = {-55.0, 0.0};
constexpr std::array<double, 2> kHighest = {90.0, 145.0};
constexpr double kLeastBetweenLinks = 35.0;

}  // namespace

CapstanRobot::CapstanRobot(const CapstanParameters& parameters) : p_(parameters) {
  for (int j = 0; j < 2; ++j) {
    const double length = p_.link_m[static_cast<std::size_t>(j)];
    require(std::isfinite(length) && length > 0.0, "link_m",
            "the length of link " + std::to_string(j + 1) + " must be a positive number of metres");
    check_friction(p_.dry[static_cast<std::size_t>(j)], "dry_friction", j + 1);
    require(p_.dry[static_cast<std::size_t>(j)].viscous == 0.0, "dry_friction",
            "viscous friction is alpha_4 and alpha_5: leave it out of the dry friction");
  }
  for (std::size_t i = 0; i < 5; ++i) {
    require(std::isfinite(p_.alpha[i]), "alpha",
            "alpha_" + std::to_string(i + 1) + " must be a finite number");
  }
  require(
      p_.alpha[0] > 0.0 && p_.alpha[2] > 0.0 &&
          p_.alpha[0] * p_.alpha[2] > 0.25 * p_.alpha[1] * p_.alpha[1],
      "alpha",
      "the inertia is not positive definite at every pose: alpha_1 and alpha_3 must be positive "
      "and alpha_1 alpha_3 above alpha_2^2 / 4");
  require(p_.alpha[3] >= 0.0 && p_.alpha[4] >= 0.0, "alpha",
          "alpha_4 and alpha_5 are friction and must not be negative");
}

RobotState CapstanRobot::at(const Vector2& angle, const Vector2& rate) const {
  const double d1 = p_.link_m[0];
  const double d2 = p_.link_m[1];
  const double s1 = std::sin(angle[0]);
  const double c1 = std::cos(angle[0]);
  const double s2 = std::sin(angle[1]);
  const double c2 = std::cos(angle[1]);
  // Of the difference theta_1 - theta_2.
  const double s12 = s1 * c2 - c1 * s2;
  const double c12 = c1 * c2 + s1 * s2;
  const double half = 0.5 * p_.alpha[1];

  RobotState s;
  s.position << d1 * c1 + d2 * s2, d1 * s1 - d2 * c2;  // (A.1)
  s.jacobian << -d1 * s1, d2 * c2, d1 * c1, d2 * s2;   // (A.3), errata
  s.jacobian_rate << -d1 * c1 * rate[0], -d2 * s2 * rate[1], -d1 * s1 * rate[0], d2 * c2 * rate[1];
  s.inertia << p_.alpha[0], -half * s12, -half * s12, p_.alpha[2];  // (A.6)
  // The sign of C21 follows from the Lagrangian; as printed it would make energy, see the errata.
  s.coriolis << 0.0, half * c12 * rate[1], -half * c12 * rate[0], 0.0;
  s.friction << p_.alpha[3] * rate[0] + friction_force(p_.dry[0], rate[0]),
      p_.alpha[4] * rate[1] + friction_force(p_.dry[1], rate[1]);
  return s;
}

Vector2 CapstanRobot::angles(const Vector2& position) const {
  const double d1 = p_.link_m[0];
  const double d2 = p_.link_m[1];
  if (!position.allFinite()) {
    throw Error(Fault::kData, "position", "the position is not a finite number");
  }
  const double distance = position.norm();
  // A handle on the very edge of the reach may come out of (A.1) with a rounding error outside.
  const double rounding = 1e-12 * (d1 + d2);
  if (distance > d1 + d2 + rounding || distance < std::abs(d1 - d2) - rounding ||
      distance <= rounding) {
    throw Error(Fault::kData, "position",
                sentence(4, "it is ", distance, " m from the base, the reach is ",
                         std::abs(d1 - d2), " to ", d1 + d2, " m"));
  }
  const double square = distance * distance;
  const double beta = (square + d1 * d1 - d2 * d2) / (2.0 * d1 * distance);
  const double alpha = (d1 * d1 + d2 * d2 - square) / (2.0 * d1 * d2);
  const double first =
      std::acos(std::clamp(beta, -1.0, 1.0)) + std::atan2(position.y(), position.x());
  return {first, first + std::acos(std::clamp(alpha, -1.0, 1.0)) - 0.5 * kPi};
}

std::string CapstanRobot::broken_limit(const Vector2& angle) const {
  constexpr double kRounding = 1e-9;  // degrees; poses at a stop are allowed
  for (int j = 0; j < 2; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const double degrees = angle[j] / kDegree;
    if (!(degrees >= kLowest[at] - kRounding && degrees <= kHighest[at] + kRounding)) {
      return sentence(4, "joint ", j + 1, " is at ", degrees, " deg, beyond its limits of ",
                      kLowest[at], " to ", kHighest[at], " deg");
    }
  }
  const double between = angle[0] / kDegree - (angle[1] / kDegree - 90.0);
  if (between < kLeastBetweenLinks - kRounding) {
    return sentence(4, "the links are ", between, " deg apart, they collide below ",
                    kLeastBetweenLinks, " deg");
  }
  return {};
}

Vector CapstanRobot::parameters() const { return Eigen::Map<const Vector>(p_.alpha.data(), 5); }

Matrix CapstanRobot::regressor(const Vector2& angle, const Vector2& rate,
                               const Vector2& acceleration) const {
  const double s12 = std::sin(angle[0] - angle[1]);
  const double c12 = std::cos(angle[0] - angle[1]);
  Matrix y = Matrix::Zero(2, 5);
  y(0, 0) = acceleration[0];
  y(0, 1) = 0.5 * (c12 * rate[1] * rate[1] - s12 * acceleration[1]);
  y(0, 3) = rate[0];
  y(1, 1) = 0.5 * (-c12 * rate[0] * rate[0] - s12 * acceleration[0]);
  y(1, 2) = acceleration[1];
  y(1, 4) = rate[1];
  return y;
}

}  // namespace ulna
