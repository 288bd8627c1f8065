// Laurent series of a matrix of rational functions about a point, from its values on a circle
// around it (the trapezoidal rule on Cauchy's integrals, which converges geometrically). What a
// pole on the imaginary axis or at infinity leaves is found without subtracting large numbers, and
// modes that cancel vanish by themselves.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "signal/polynomial.hpp"

namespace ulna {

using MatrixFunction = std::function<Eigen::MatrixXcd(Complex)>;

class Expansion {
 public:
  // About `center`, or about infinity in 1/s. radius: in s, or in 1/s; no pole but those at the
  // centre may lie within 3 radii.
  static Expansion about(const MatrixFunction& f, Complex center, double radius);
  static Expansion about_infinity(const MatrixFunction& f, double radius);

  // Coefficient of (z / radius)^k, z = s - center or 1/s, -kPrincipal <= k <= kRegular.
  const Eigen::MatrixXcd& operator[](int k) const;
  // Largest Frobenius norm on the circle: coefficients are exact to rounding of this.
  double size() const { return size_; }
  double radius() const { return radius_; }
  Complex center() const { return center_; }
  bool at_infinity() const { return at_infinity_; }

  // Where the series stands in for the function: |z| up to half the radius.
  bool covers(Complex s) const;
  // Without the principal part.
  Eigen::MatrixXcd regular(Complex s) const;
  // Largest k with |c_-k| above share * size(); 0 when there is no pole.
  int order(double share) const;

  static constexpr int kPrincipal = 6;
  static constexpr int kRegular = 24;

 private:
  Complex center_ = 0.0;
  bool at_infinity_ = false;
  double radius_ = 1.0;
  double size_ = 0.0;
  std::vector<Eigen::MatrixXcd> c_;
};

}  // namespace ulna
