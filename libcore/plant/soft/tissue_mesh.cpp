#include "plant/soft/tissue_mesh.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {

TissueMesh::TissueMesh(const Vector3& semi_axes, const std::array<int, 3>& counts)
    : semi_axes_(semi_axes) {
  require(semi_axes.allFinite() && semi_axes.minCoeff() > 1e-3 && semi_axes.maxCoeff() < 1.0,
          "semi_axes", "the tissue's semi-axes must be between 1 mm and 1 m");
  for (const int n : counts) {
    require(n >= 2 && n <= 40, "counts", "the tissue must have between 2 and 40 points an edge");
  }
  add_points(counts);
  add_faces(counts);
  measure();
}

// Grid points on the cube's surface, pushed out to the unit sphere and
// stretched to the ellipsoid.
void TissueMesh::add_points(const std::array<int, 3>& n) {
  index_of_grid_.assign(at(n[0] * n[1] * n[2]), -1);
  int grid = 0;
  for (int k = 0; k < n[2]; ++k) {
    for (int j = 0; j < n[1]; ++j) {
      for (int i = 0; i < n[0]; ++i, ++grid) {
        const bool inside = i > 0 && i + 1 < n[0] && j > 0 && j + 1 < n[1] && k > 0 && k + 1 < n[2];
        if (inside) continue;
        const Vector3 cube(2.0 * i / (n[0] - 1) - 1.0, 2.0 * j / (n[1] - 1) - 1.0,
                           2.0 * k / (n[2] - 1) - 1.0);
        const Vector3 point = semi_axes_.cwiseProduct(cube.normalized());
        index_of_grid_[at(grid)] = size();
        radius_.push_back(point.norm());
        direction_.push_back(point.normalized());
      }
    }
  }
}

void TissueMesh::add_faces(const std::array<int, 3>& n) {
  const auto index = [&](std::array<int, 3> g) {
    return index_of_grid_[at((g[2] * n[1] + g[1]) * n[0] + g[0])];
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3;
    const std::size_t v = (axis + 2) % 3;
    for (const int side : {0, n[axis] - 1}) {
      for (int i = 0; i + 1 < n[u]; ++i) {
        for (int j = 0; j + 1 < n[v]; ++j) {
          std::array<int, 3> g{};
          const auto corner = [&](int di, int dj) {
            g[axis] = side;
            g[u] = i + di;
            g[v] = j + dj;
            return index(g);
          };
          const int a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
          // Diagonals that mirror each other keep the mesh as symmetric as the
          // ellipsoid.
          const bool even = (2 * i + 1 < n[u]) == (2 * j + 1 < n[v]);
          add_triangle(a, b, even ? d : c);
          even ? add_triangle(b, c, d) : add_triangle(a, c, d);
        }
      }
    }
  }
}

void TissueMesh::add_triangle(int a, int b, int c) {
  Matrix3 corners;
  corners << point(a), point(b), point(c);
  if (corners.determinant() < 0.0) {
    std::swap(b, c);
  }
  triangles_.push_back({{a, b, c}});
}

void TissueMesh::measure() {
  area_ = Vector::Zero(size());
  rate_ = Vector::Zero(size());
  laplacian_ = Matrix::Zero(size(), size());
  for (const Triangle& t : triangles_) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int i = t.corner[k], j = t.corner[(k + 1) % 3], l = t.corner[(k + 2) % 3];
      const Vector3 cross = (point(j) - point(i)).cross(point(l) - point(i));
      area_[i] += cross.norm() / 6.0;
      rate_[i] += point(j).cross(point(l)).dot(direction(i)) / 6.0;
      // The angle at i weighs the edge across from it by half its cotangent.
      const double weight = 0.5 * (point(j) - point(i)).dot(point(l) - point(i)) / cross.norm();
      laplacian_(j, l) -= weight;
      laplacian_(l, j) -= weight;
      laplacian_(j, j) += weight;
      laplacian_(l, l) += weight;
    }
  }
  // As far as the longest side of a triangle, so that each place has its
  // corners within reach.
  on_sphere_.resize(3, size());
  for (int i = 0; i < size(); ++i) on_sphere_.col(i) = point(i).cwiseQuotient(semi_axes_);
  reach_ = 0.0;
  for (const Triangle& t : triangles_) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3 side = on_sphere_.col(t.corner[k]) - on_sphere_.col(t.corner[(k + 1) % 3]);
      reach_ = std::max(reach_, side.norm());
    }
  }
}

// A partition of unity with the kernel (1 - (d / reach)^2)^3, d on the unit
// sphere.
SurfacePlace TissueMesh::place(const Vector3& position) const {
  const Vector3 scaled = position.cwiseQuotient(semi_axes_);
  const double length = scaled.norm();
  const Vector3 unit = scaled / length;
  const double narrow = 1.0 / (reach_ * reach_);
  SurfacePlace place;
  std::vector<double> weight;
  double sum = 0.0;
  for (int i = 0; i < size(); ++i) {
    const double inside = 1.0 - (unit - on_sphere_.col(i)).squaredNorm() * narrow;
    if (inside <= 0.0) continue;
    place.element.push_back(i);
    weight.push_back(inside);
    sum += inside * inside * inside;
  }
  const auto n = static_cast<Index>(weight.size());
  place.share.resize(n);
  place.gradient.resize(n, 3);
  // d weight / d unit, then unit by scaled by position.
  Vector3 total = Vector3::Zero();
  for (Index k = 0; k < n; ++k) {
    const auto i = static_cast<std::size_t>(k);
    place.share[k] = weight[i] * weight[i] * weight[i] / sum;
    const Vector3 slope =
        -6.0 * weight[i] * weight[i] * narrow / sum * (unit - on_sphere_.col(place.element[i]));
    place.gradient.row(k) = slope.transpose();
    total += slope;
  }
  const Matrix3 turn = (Matrix3::Identity() - unit * unit.transpose()) / length *
                       semi_axes_.cwiseInverse().asDiagonal();
  place.gradient = ((place.gradient - place.share * total.transpose()) * turn).eval();
  const double distance = position.norm();
  place.radius = distance / length;
  place.slope = position / distance - position / (distance * length) +
                distance / (length * length * length) * scaled.cwiseQuotient(semi_axes_);
  return place;
}

}  // namespace ulna
