// The linear system behind the maximum a posteriori estimate, in the frames and the order of
// Latella et al. 2021, (5)-(7), as sparse matrices: to look at, to prove the solvers, and to
// measure them against.
//
//   d = [a_0 e_0 ... a_N-1 e_N-1   f_1 ... f_N-1   q''_1 ... q''_n],   12 N + 6 (N - 1) + n numbers
//
// with a_i the proper acceleration of link i (of its origin, then angular), e_i its net external
// wrench, f_i the wrench of its parent on it, all in link axes about the link's origin.
#pragma once

#include <Eigen/SparseCore>

#include "estimate/body_sensors.hpp"

namespace ulna {

using SparseMatrix = Eigen::SparseMatrix<double>;

struct MapSystem {
  // D d + b_D = 0: Newton and Euler of each link (6 N rows), then the step of acceleration over
  // each joint (6 (N - 1) rows).
  SparseMatrix dynamics;
  Vector dynamics_bias;
  // Y d + b_Y = y: rows of the suite that were there and that are no external wrenches, then the
  // net external wrench of each link.
  SparseMatrix sensors;
  Vector sensors_bias, measured;
  SparseMatrix sensors_weight;  // inverse covariance, blocks of 6 for the wrenches
  // Prior on d: inverse variances and mean. Zero weights are no prior.
  Vector prior_weight, prior_mean;

  Index unknowns() const { return dynamics.cols(); }
};

struct MapLayout {
  explicit MapLayout(const BodyTree& body) : links(body.size()), dofs(body.dofs()) {}
  Index links, dofs;
  Index acceleration(Index link) const { return 12 * link; }
  Index external(Index link) const { return 12 * link + 6; }
  Index joint_wrench(Index link) const { return 12 * links + 6 * (link - 1); }
  Index joint_acceleration(Index dof) const { return 18 * links - 6 + dof; }
  Index unknowns() const { return 18 * links - 6 + dofs; }
};

// The system at one frame. Sizes must be those of the body and the suite.
MapSystem map_system(const SensorSuite& suite, const BodyState& state, const VectorRef& y);

}  // namespace ulna
