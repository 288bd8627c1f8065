// A cuff: six plates along an arc. Cuff frame: origin on the axis of the arc's
// circle, x across, y towards the opening, z along the limb.
#pragma once

#include <array>

#include "plant/rigid_tree.hpp"

namespace ulna {

struct Cuff {
  std::string link;                           // that carries it
  Vector3 position = Vector3::Zero();         // of its frame in the link, m
  Matrix3 orientation = Matrix3::Identity();  // columns: x y z in link axes
  double chord = 0.110;                       // width of the opening, m
  double slant = 0.070;                       // from the bottom of the arc to its end, m
  double depth = 0.100;                       // along the limb, m
  // Lined, it is padded out to the limb that is put in and presses into it this
  // far (m); the published cuff is not, and lets the limb roll about in it.
  bool lined = true;
  double squeeze = 0.008;
  // Mean pressure on the skin at which the lining is tight, Pa: it presses less
  // far into a limb that is too stiff for all of `squeeze`. 0: always all of
  // it.
  double tightness = 0.0;

  static Cuff upper_arm();  // published, on Link3
  static Cuff forearm();    // on Link4
  // The arc of a circle of that radius, from its bottom to `half_angle` on both
  // sides.
  void set_arc(double radius, double half_angle);
  void check() const;  // throws Error (kArgument)

  static constexpr int kPlates = 6;
  double radius() const;             // of the circle through the plates' edges, m
  double half_angle() const;         // of the arc, rad
  double face() const;               // distance of the plates from the axis, m
  Vector3 outward(int plate) const;  // normal of a plate, away from the limb, cuff frame

  // Distance of each plate or its lining from the axis for a limb with its
  // centre at `centre` and with points y: (y - centre)' inverse(spread) (y -
  // centre) = 1, cuff frame. foundation: stiffness of the limb's surface for
  // each area, N/m^3.
  using Faces = std::array<double, kPlates>;
  Faces faces(const Vector3& centre, const Matrix3& spread, double foundation) const;

  // How far a position (cuff frame) is beyond the plate that it is beyond most,
  // and which that is.
  double penetration(const Faces& faces, const Vector3& position, int& plate) const;
};

}  // namespace ulna
