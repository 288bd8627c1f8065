// The planar capstan robot of Dyck 2013, appendix A: both motors sit at the base and the second
// angle is measured against the ground, so the Jacobian has one column a link.
#pragma once

#include <array>

#include "plant/friction.hpp"
#include "plant/planar_robot.hpp"

namespace ulna {

struct CapstanParameters {
  std::array<double, 2> link_m = {0.254, 0.2667};  // d1, d2: 10 and 10.5 inches
  // Table A.1: alpha_1 ... alpha_3 kg m^2, alpha_4 and alpha_5 N m s/rad.
  std::array<double, 5> alpha = {0.06929, 0.04217, 0.04416, 0.06510, 0.07389};
  // Dry friction beside alpha_4 and alpha_5; their `viscous` must be 0.
  std::array<Friction, 2> dry = {};
};

class CapstanRobot final : public PlanarRobot {
 public:
  // Throws Error (kArgument) unless the lengths are positive, the inertia is positive definite at
  // every pose (alpha_1 alpha_3 > alpha_2^2 / 4) and the friction is sound.
  explicit CapstanRobot(const CapstanParameters& parameters = {});

  const CapstanParameters& description() const noexcept { return p_; }

  std::string name() const override { return "capstan robot"; }
  RobotState at(const Vector2& angle, const Vector2& rate) const override;
  Vector2 angles(const Vector2& position) const override;         // (A.4)
  std::string broken_limit(const Vector2& angle) const override;  // (A.2)
  Vector parameters() const override;                             // alpha
  Matrix regressor(const Vector2& angle, const Vector2& rate,
                   const Vector2& acceleration) const override;  // 2 x 5, of (A.5)

 private:
  CapstanParameters p_;
};

}  // namespace ulna
