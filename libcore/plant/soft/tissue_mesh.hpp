// The surface of an ellipsoid as elements on a cube's shell: points, areas and
// triangles, and the place of any direction on it. Axes are the ellipsoid's
// own.
#pragma once

#include <array>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna {

// Where a ray from the centre meets the surface: how much each element near
// there counts. Shares are smooth in the position, so that what slides over the
// surface meets no edges.
struct SurfacePlace {
  std::vector<int> element;
  Vector share;     // of each, sums to 1
  Matrix gradient;  // elements x 3: d share / d position, 1/m
  double radius;    // of the undeformed ellipsoid along the ray, m
  Vector3 slope;    // d (distance from the centre - radius) / d position
};

class TissueMesh {
 public:
  // counts: points along each edge of the cube, 2 or more; 9 x 5 x 5 are 162
  // elements. Throws Error (kArgument) for axes that are not positive and
  // counts outside 2 ... 40.
  TissueMesh(const Vector3& semi_axes, const std::array<int, 3>& counts);

  int size() const { return static_cast<int>(radius_.size()); }
  const Vector3& semi_axes() const { return semi_axes_; }
  const Vector3& direction(int element) const { return direction_[at(element)]; }
  double radius(int element) const { return radius_[at(element)]; }  // m
  Vector3 point(int element) const { return radius(element) * direction(element); }
  double area(int element) const { return area_[element]; }         // m^2
  double volume_rate(int element) const { return rate_[element]; }  // d volume / d radius, m^2
  double surface() const { return area_.sum(); }

  // Stiffness matrix of the surface Laplacian (piecewise linear elements),
  // positive semidefinite, independent of the number of elements in the limit.
  const Matrix& laplacian() const { return laplacian_; }

  // The place of a position that is not the centre.
  SurfacePlace place(const Vector3& position) const;

 private:
  struct Triangle {
    std::array<int, 3> corner;
  };
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  void add_points(const std::array<int, 3>& counts);
  void add_faces(const std::array<int, 3>& counts);
  void add_triangle(int a, int b, int c);
  void measure();

  Vector3 semi_axes_;
  std::vector<int> index_of_grid_;
  std::vector<Vector3> direction_;
  std::vector<double> radius_;
  std::vector<Triangle> triangles_;
  Matrix on_sphere_;  // 3 x elements: their points on the unit sphere
  double reach_;      // of an element there
  Vector area_;
  Vector rate_;
  Matrix laplacian_;
};

}  // namespace ulna
