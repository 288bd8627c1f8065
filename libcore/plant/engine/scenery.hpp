// What is drawn beside the engine's own shapes: shapes fixed to bodies, forces, and what stands
// around. Lengths m, world: z up; colours red, green, blue, opacity between 0 and 1.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna {

using Colour = std::array<float, 4>;

enum class ShapeKind {
  kSphere,     // size: radius
  kEllipsoid,  // size: semi-axes
  kCapsule,    // along z; size: radius, -, half the length between the ends' centres
  kCylinder,   // along z; size: radius, -, half the length
  kBox,        // size: half sides
  kArrow,      // along z from the position; size: radius, -, length with the tip
};

struct Shape {
  ShapeKind kind = ShapeKind::kSphere;
  Vector3 position = Vector3::Zero();
  Matrix3 orientation = Matrix3::Identity();  // columns: the shape's axes
  Vector3 size = Vector3::Zero();
  Colour colour = {0.5F, 0.5F, 0.5F, 1.0F};
  float shine = 0.3F;  // 0: dull, 1: polished
  bool framed = true;  // the default camera shows all of it
};

// Axes of a shape whose z points along a vector and whose x as nearly as can be towards another.
Matrix3 axes_along(const Vector3& z, const Vector3& towards = Vector3::UnitX());

// Between two points; a sphere where they are the same.
Shape bar(const Vector3& from, const Vector3& to, double radius, const Colour& colour,
          ShapeKind kind = ShapeKind::kCapsule);

struct BodyShape {
  std::string body;  // "": the world
  Shape shape;       // in the body's frame
};

struct Scenery {
  std::vector<BodyShape> shapes;
  bool engine_shapes = true;       // those of the model are drawn too
  bool muscles = true;             // actuators on tendons, blue at no activation to red at full
  double muscle_pressure = 1.3e6;  // N/m^2: a muscle's belly is as wide as its peak force over this
  bool floor = false;
  double floor_height = 0.0;       // m
  std::vector<std::string> sweep;  // joints that a film shows in all of their ranges
};

// From blue (0) to red (1); beyond, the ends.
Colour activation_colour(double activation);

// Forces that act at points, as arrows: metres a newton.
std::vector<Shape> force_arrows(const Matrix& points, const Matrix& forces, double scale,
                                const Colour& colour);

}  // namespace ulna
