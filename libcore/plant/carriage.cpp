#include "plant/carriage.hpp"

#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {

Carriage::Carriage(const CarriageParameters& parameters) : p_(parameters) {
  require(std::isfinite(p_.mass_kg) && p_.mass_kg > 0.0, "mass_kg",
          "the mass of the carriage must be a positive number of kg");
  require(std::isfinite(p_.damping_n_s_m) && p_.damping_n_s_m >= 0.0, "damping_n_s_m",
          "the damping of the carriage must be 0 or a positive number of N s/m");
  require(std::isfinite(p_.travel_m) && p_.travel_m > 0.0, "travel_m",
          "the travel of the carriage must be a positive number of metres");
}

RobotState Carriage::at(const Vector2& angle, const Vector2& rate) const {
  RobotState s;
  s.position = angle;
  s.jacobian.setIdentity();
  s.jacobian_rate.setZero();
  s.inertia = p_.mass_kg * Matrix2::Identity();
  s.coriolis.setZero();
  s.friction = p_.damping_n_s_m * rate;
  return s;
}

std::string Carriage::broken_limit(const Vector2& angle) const {
  for (int j = 0; j < 2; ++j) {
    if (std::abs(angle[j]) <= p_.travel_m) continue;
    return sentence(4, "axis ", j + 1, " is at ", angle[j], " m, beyond its travel of ",
                    p_.travel_m, " m to either side");
  }
  return angle.allFinite() ? std::string() : "the position is not a finite number";
}

Vector Carriage::parameters() const { return Vector{{p_.mass_kg, p_.damping_n_s_m}}; }

Matrix Carriage::regressor(const Vector2&, const Vector2& rate, const Vector2& acceleration) const {
  Matrix y(2, 2);
  y << acceleration, rate;
  return y;
}

}  // namespace ulna
