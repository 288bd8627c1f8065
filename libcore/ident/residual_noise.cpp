#include "ident/residual_noise.hpp"

#include <algorithm>
#include <cmath>

namespace ulna {

ResidualNoise residual_noise(const std::vector<Vector>& residuals, Index most_order) {
  Index rows = 0;
  Index shortest = most_order + 1;
  for (const Vector& e : residuals) {
    rows += e.size();
    shortest = std::min(shortest, e.size());
  }
  most_order = std::max<Index>(0, std::min({most_order, shortest - 1, rows / 20}));
  // Sums divided by all rows, whatever the lag: the model is then stable.
  Vector covariance = Vector::Zero(most_order + 1);
  for (const Vector& e : residuals) {
    for (Index lag = 0; lag <= most_order; ++lag) {
      covariance[lag] += e.head(e.size() - lag).dot(e.tail(e.size() - lag));
    }
  }
  const double n = static_cast<double>(rows);
  covariance /= n;
  ResidualNoise best{{}, covariance[0], covariance[0]};
  if (!(covariance[0] > 0.0)) return best;
  double least = n * std::log(covariance[0]);
  Vector ar;
  double innovation = covariance[0];
  for (Index order = 1; order <= most_order; ++order) {  // Levinson and Durbin
    double sum = covariance[order];
    for (Index l = 0; l < order - 1; ++l) sum -= ar[l] * covariance[order - 1 - l];
    const double reflection = sum / innovation;
    Vector next(order);
    for (Index l = 0; l < order - 1; ++l) next[l] = ar[l] - reflection * ar[order - 2 - l];
    next[order - 1] = reflection;
    ar = next;
    innovation *= 1.0 - reflection * reflection;
    if (!(innovation > 0.0)) break;
    const double criterion = n * std::log(innovation) + static_cast<double>(order) * std::log(n);
    if (criterion < least) {
      least = criterion;
      best.ar = ar;
      best.innovation = innovation;
    }
  }
  return best;
}

Matrix score_covariance(const Matrix& psi, const ResidualNoise& noise) {
  const Index order = noise.ar.size();
  if (order == 0) return noise.variance * (psi * psi.transpose());
  // A score is the sum over the innovations of what each of them reaches later.
  Matrix reach = psi;
  for (Index k = psi.cols() - 1; k-- > 0;) {
    const Index most = std::min(order, psi.cols() - 1 - k);
    for (Index l = 0; l < most; ++l) reach.col(k) += noise.ar[l] * reach.col(k + 1 + l);
  }
  return noise.innovation * (reach * reach.transpose());
}

}  // namespace ulna
