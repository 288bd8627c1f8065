// What holds the arm in the published simulation, as numbers: ellipsoid shells of spheres on radial
// slides around the bones, straps as grids of spheres that are free to move, cuffs of six boxes.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna {

// Tissue: the surface of a grid, drawn onto an ellipsoid. Axes of the bone that carries it.
struct ParityShell {
  struct Element {
    std::string name;  // "<shell>_<ix>_<iy>_<iz>"
    Vector3 position;  // of the body on the ellipsoid, from its centre, m
    Vector3 outward;   // direction of the slide, away from the centre
  };
  std::string name;
  std::vector<Element> elements;
  std::vector<std::pair<std::size_t, std::size_t>> neighbours;  // elements side by side in the grid

  static constexpr double kSpacing = 0.02;  // of the grid, m
  static constexpr double kRadius = 0.01;   // of an element, whose sphere is this far inside, m
  static constexpr double kMass = 0.003;    // of an element, and of the sphere at the centre, kg

  static ParityShell upper_arm();  // 9 x 5 x 5
  static ParityShell forearm();    // 9 x 4 x 4
};

// Strap: 8 x 3 points in a plane; the two short ends are welded to the link.
struct ParityStrap {
  struct Point {
    std::string name;  // "<strap>_<along>_<across>"
    Vector3 position;  // as written, strap frame, m
    bool end = false;
    Vector3 anchor = Vector3::Zero();  // of an end, link axes, m
  };
  std::string name, link;
  Vector3 position;     // of the strap's frame in the link, m
  Matrix3 orientation;  // columns: strap axes in the link
  std::vector<Point> points;
  std::vector<std::pair<std::size_t, std::size_t>>
      threads;  // of constant length: along, then across

  static constexpr int kAlong = 8;
  static constexpr int kAcross = 3;
  static constexpr double kPitch = 0.015;  // m
  static constexpr double kRadius = 0.01;  // m
  static constexpr double kMass = 0.05;    // of a point, kg

  static ParityStrap upper_arm();
  static ParityStrap forearm();
};

struct ParityBox {
  Vector3 half;      // sides, m
  Vector3 position;  // in the link, m
  Vector3 axis;      // of its turn
  double angle;      // rad
};

struct ParityCuff {
  std::string name, link;
  std::array<ParityBox, 6> boxes;

  static ParityCuff upper_arm();
  static ParityCuff forearm();
};

}  // namespace ulna
