#include "plant/soft/bushing.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "base/error.hpp"

namespace ulna {

Twist coordinates(const LimbPose& donned, const LimbPose& pose) {
  const Eigen::AngleAxisd turn(Matrix3(pose.orientation * donned.orientation.transpose()));
  Twist at;
  at << pose.position - donned.position, turn.angle() * turn.axis();
  return at;
}

void Bushing::check() const {
  require(origin.allFinite() && preload.allFinite() && stiffness.allFinite() && damping.allFinite(),
          "bushing", "bushing '" + name + "' holds a number that is not finite");
  const auto semidefinite = [](const Matrix6& m) {
    const double scale = m.cwiseAbs().maxCoeff() + 1e-300;
    if ((m - m.transpose()).cwiseAbs().maxCoeff() > 1e-9 * scale) return false;
    const Eigen::SelfAdjointEigenSolver<Matrix6> solver(m, Eigen::EigenvaluesOnly);
    return solver.eigenvalues().minCoeff() >= -1e-9 * scale;
  };
  require(semidefinite(stiffness), "stiffness",
          "the stiffness of bushing '" + name + "' must be symmetric and positive semidefinite");
  require(semidefinite(damping), "damping",
          "the damping of bushing '" + name + "' must be symmetric and positive semidefinite");
}

}  // namespace ulna
