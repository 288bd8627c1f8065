// An exoskeleton as a table: a chain of links on hinges, its motors, and the straps that hold the
// arm. World: x forward, y left, z up; the origin is the device's shoulder centre.
#pragma once

#include <string>
#include <vector>

#include "plant/rigid_tree.hpp"

namespace ulna {

struct ExoLink {
  std::string name;
  Vector3 position = Vector3::Zero();         // in the link before (the first: in the world), m
  Matrix3 orientation = Matrix3::Identity();  // columns: link axes in the link before
  std::string joint;
  Vector3 axis = Vector3::UnitZ();   // of the hinge, link axes
  double lower = 0.0;                // rad
  double upper = 0.0;                // rad
  double reference = 0.0;            // angle at which the link stands as written, rad
  double mass = 0.0;                 // kg
  Vector3 centre = Vector3::Zero();  // of mass, link axes, m
  double inertia[6] = {};            // about it, link axes: xx yy zz xy xz yz, kg m^2
  double damping = 0.0;              // N m s/rad
  double friction = 0.0;             // Coulomb, N m
  double motor_limit = 0.0;          // N m either way; 0: no motor
};

// A strap's mass: a grid of equal spheres that stands still on its link where it is not simulated.
struct ExoStrap {
  std::string name;
  std::string link;
  Vector3 centre = Vector3::Zero();           // of the grid, link axes, m
  Matrix3 orientation = Matrix3::Identity();  // columns: along, across, normal, link axes
  int along = 8;
  int across = 3;
  double pitch = 0.015;  // between points, m
  double radius = 0.01;  // of a point, m
  double mass = 0.05;    // of all points, kg
};

struct ExoDescription {
  std::string name = "NESM";
  std::vector<ExoLink> links;  // each on the one before
  std::vector<ExoStrap> straps;
  std::string upper_link;  // carries the upper arm
  std::string fore_link;   // carries the forearm

  // The published device of four degrees of freedom (Tesfazgi 2023, section 2.2.2).
  static ExoDescription published();
  // The straps of the published simulation: 1.2 kg each, and half a pitch off their centre.
  void use_published_straps();

  // Throws Error (kArgument) that names the link or strap.
  void check() const;
};

// Bodies of the device, straps as parts of their links' children, in the order of the links.
std::vector<RigidBody> bodies_of(const ExoDescription& exo);

Matrix3 inertia_matrix(const double (&moments)[6]);

}  // namespace ulna
