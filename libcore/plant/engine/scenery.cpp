#include "plant/engine/scenery.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "signal/finite.hpp"

namespace ulna {

Matrix3 axes_along(const Vector3& z, const Vector3& towards) {
  Matrix3 axes;
  axes.col(2) = z.normalized();
  Vector3 side = towards - towards.dot(axes.col(2)) * axes.col(2);
  if (side.norm() < 1e-6 * towards.norm()) side = axes.col(2).unitOrthogonal();
  axes.col(0) = side.normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

Shape bar(const Vector3& from, const Vector3& to, double radius, const Colour& colour,
          ShapeKind kind) {
  const Vector3 way = to - from;
  const double length = way.norm();
  Shape shape{.kind = kind, .position = 0.5 * (from + to), .colour = colour};
  if (kind == ShapeKind::kArrow) shape.position = from;
  shape.size = Vector3(radius, radius, kind == ShapeKind::kArrow ? length : 0.5 * length);
  if (length < 1e-9) {
    shape.kind = ShapeKind::kSphere;
    return shape;
  }
  shape.orientation = axes_along(way);
  return shape;
}

Colour activation_colour(double activation) {
  // Blue, violet, red of like lightness, so that the middle is not grey.
  constexpr float kStops[3][3] = {
      {0.13F, 0.36F, 0.78F}, {0.55F, 0.25F, 0.60F}, {0.86F, 0.11F, 0.10F}};
  const double a = std::isnan(activation) ? 0.0 : std::clamp(activation, 0.0, 1.0);
  const int k = a < 0.5 ? 0 : 1;
  const auto share = static_cast<float>(2.0 * a - k);
  Colour colour{0.0F, 0.0F, 0.0F, 1.0F};
  for (std::size_t i = 0; i < 3; ++i) {
    colour[i] = (1.0F - share) * kStops[k][i] + share * kStops[k + 1][i];
  }
  return colour;
}

std::vector<Shape> force_arrows(const Matrix& points, const Matrix& forces, double scale,
                                const Colour& colour) {
  require(points.cols() == 3 && forces.cols() == 3 && points.rows() == forces.rows(), "forces",
          "points and forces must have three columns and as many rows as each other");
  require_finite(points, "points");
  require_finite(forces, "forces");
  require(std::isfinite(scale) && scale > 0.0, "scale", "the arrows' scale must be positive");
  std::vector<Shape> arrows;
  for (Index i = 0; i < points.rows(); ++i) {
    const Vector3 from = points.row(i).transpose();
    const Vector3 way = scale * forces.row(i).transpose();
    if (way.norm() < 1e-4) continue;  // shorter than it is wide to the eye
    arrows.push_back(
        bar(from, from + way, std::min(0.006, 0.15 * way.norm()), colour, ShapeKind::kArrow));
    arrows.back().framed = false;
  }
  return arrows;
}

}  // namespace ulna
