// The estimate as it is published: Sigma^-1 = D' Sigma_D^-1 D + Sigma_d^-1 + Y' Sigma_y^-1 Y as one
// sparse matrix over all of d, factorised by Eigen. For tests and as the bench's baseline.
#pragma once

#include <Eigen/SparseCholesky>

#include "estimate/map_estimator.hpp"
#include "estimate/map_system.hpp"

namespace ulna::made {

struct Normal {
  SparseMatrix information;
  Vector rhs;
};

inline Normal normal_equations(const MapSystem& s, const BodyTree& body,
                               const ModelDeviation& model) {
  Vector weight(s.dynamics.rows());
  for (Index k = 0; k < weight.size(); ++k) {
    const bool linear = k % 6 < 3;
    const double d = k < 6 * body.size()
                         ? (linear ? model.force : model.moment)
                         : (linear ? model.linear_acceleration : model.angular_acceleration);
    weight[k] = 1.0 / (d * d);
  }
  const SparseMatrix weighted = weight.asDiagonal() * s.dynamics;
  const SparseMatrix sensors = s.sensors_weight * s.sensors;
  Normal n;
  SparseMatrix prior(s.unknowns(), s.unknowns());
  std::vector<Eigen::Triplet<double>> diagonal;
  for (Index k = 0; k < s.unknowns(); ++k) {
    diagonal.emplace_back(static_cast<int>(k), static_cast<int>(k), s.prior_weight[k]);
  }
  prior.setFromTriplets(diagonal.begin(), diagonal.end());
  n.information = SparseMatrix(s.dynamics.transpose()) * weighted +
                  SparseMatrix(s.sensors.transpose()) * sensors + prior;
  n.rhs = sensors.transpose() * (s.measured - s.sensors_bias) -
          weighted.transpose() * s.dynamics_bias + s.prior_weight.cwiseProduct(s.prior_mean);
  return n;
}

}  // namespace ulna::made
