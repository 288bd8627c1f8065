// A strap over the opening of a cuff: a grid of points held together by webbing
// that only pulls along the strap. Both short ends are fixed to the cuff.
// Everything is in the cuff's frame; its weight and inertia as a whole are part
// of the link, `mass` is for its motion against the link.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna {

struct StrapOptions {
  std::string limb = "limb";   // that it is around, for messages
  int along = 8;               // points from one end to the other, the ends included
  int across = 3;              // rows
  double pitch = 0.015;        // of the rows, m
  double half_width = 0.045;   // of the anchors from the cuff's middle, m
  double anchor = -0.005;      // height of the anchors over the arc's axis, m
  double stiffness = 20000.0;  // of the webbing between two points, N/m
  double viscosity = 20.0;     // of it, N s/m
  double pretension = 100.0;   // of the whole strap when donned, N
  double length = 0.0;         // without tension, m; 0: as long as the pretension asks for
  double thickness = 0.002;    // m
  double mass = 0.05;          // of all points, kg
  void check() const;          // throws Error (kArgument)
};

class Strap {
 public:
  explicit Strap(const StrapOptions& options);

  const StrapOptions& options() const { return options_; }
  int points() const { return options_.along * options_.across; }
  int moving() const { return points() - 2 * options_.across; }  // the first of all points
  double area() const { return options_.pitch * spacing(); }     // that a point stands for, m^2
  double point_mass() const { return options_.mass / points(); }

  // Laid around a limb: an ellipsoid with its centre and its matrix Q, (y - c)'
  // Q (y - c) = 1, in the cuff's frame. Points lie on the shortest path of
  // their row; the webbing's lengths without tension follow. Throws Error
  // (kArgument) for straps that are too short or miss the limb.
  struct Donned {
    Matrix points;             // 3 x points, m
    std::vector<double> rest;  // of each edge, m
  };
  Donned don(const Vector3& centre, const Matrix3& ellipsoid) const;

  // Forces on the moving points and how they change, for positions of all
  // points.
  struct Webbing {
    Vector force;      // 3 a moving point, N
    Matrix stiffness;  // -d force / d position, positive semidefinite, N/m
    Matrix damping;    // N s/m
    double energy;     // J
    double tension;    // mean over the strap's length of the sum over rows, N
  };
  Webbing webbing(const Matrix& points, const std::vector<double>& rest) const;

 private:
  struct Edge {
    int a, b;
    bool along;
  };
  double spacing() const { return 2.0 * options_.half_width / (options_.along - 1); }
  int index(int column, int row) const;
  Matrix row_path(double z, const Vector3& centre, const Matrix3& ellipsoid) const;

  StrapOptions options_;
  std::vector<Edge> edges_;
};

}  // namespace ulna
