// A Cartesian table: two carriages along x and y, each with a mass and viscous friction. Stands for
// a robot whose own dynamics are to be simple, and for experiments along one axis.
#pragma once

#include "plant/planar_robot.hpp"

namespace ulna {

struct CarriageParameters {
  double mass_kg = 1.0;
  double damping_n_s_m = 1.0;
  double travel_m = 0.25;  // to either side of 0, on each axis
};

class Carriage final : public PlanarRobot {
 public:
  // Throws Error (kArgument) unless mass and travel are positive and damping is not negative.
  explicit Carriage(const CarriageParameters& parameters = {});

  std::string name() const override { return "carriage"; }
  bool has_independent_axes() const override { return true; }
  RobotState at(const Vector2& angle, const Vector2& rate) const override;
  Vector2 angles(const Vector2& position) const override { return position; }
  std::string broken_limit(const Vector2& angle) const override;
  Vector parameters() const override;  // mass, damping
  Matrix regressor(const Vector2& angle, const Vector2& rate,
                   const Vector2& acceleration) const override;

 private:
  CarriageParameters p_;
};

}  // namespace ulna
