#include "plant/soft/cuff.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {

Cuff Cuff::upper_arm() {
  Cuff cuff{.link = "Link3", .position = {0.0, -0.0200, -0.133}};
  cuff.orientation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return cuff;
}

Cuff Cuff::forearm() {
  Cuff cuff{.link = "Link4", .position = {0.0, 0.12, 0.0}};
  cuff.orientation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  cuff.chord = 0.085;
  cuff.slant = 0.050;
  return cuff;
}

void Cuff::set_arc(double radius, double half_angle) {
  chord = 2.0 * radius * std::sin(half_angle);
  slant = 2.0 * radius * std::sin(0.5 * half_angle);
}

void Cuff::check() const {
  require(!link.empty(), "link", "the cuff is on no link");
  require(position.allFinite() && orientation.allFinite() &&
              (orientation.transpose() * orientation - Matrix3::Identity()).norm() < 1e-6 &&
              orientation.determinant() > 0.0,
          "orientation", "the cuff on '" + link + "' must have a finite place and a right frame");
  require(std::isfinite(chord) && std::isfinite(slant) && chord > 0.0 && slant > 0.5 * chord &&
              slant < 0.999 * chord && chord < 1.0,
          "chord",
          "the cuff on '" + link +
              "' must have a chord, and a slant between a half of the chord "
              "and the chord");
  require(std::fabs(squeeze) < 0.02, "squeeze",
          "the lining of the cuff on '" + link + "' must press less than 20 mm into the limb");
  require(std::isfinite(tightness) && tightness >= 0.0, "tightness",
          "the lining of the cuff on '" + link + "' must be tight at a pressure of 0 or more");
  require(std::isfinite(depth) && depth > 0.0 && depth < 1.0, "depth",
          "the cuff on '" + link + "' must have a depth between 0 and 1 m");
}

// The arc's height over its chord follows from its slant (Pythagoras), the
// circle from both.
double Cuff::radius() const {
  return slant * slant / (2.0 * std::sqrt(slant * slant - 0.25 * chord * chord));
}

double Cuff::half_angle() const { return 2.0 * std::asin(slant / (2.0 * radius())); }

double Cuff::face() const { return radius() * std::cos(half_angle() / kPlates); }

Vector3 Cuff::outward(int plate) const {
  const double angle = half_angle() * (2.0 * plate + 1.0 - kPlates) / kPlates;
  return {std::sin(angle), -std::cos(angle), 0.0};
}

Cuff::Faces Cuff::faces(const Vector3& centre, const Matrix3& spread, double foundation) const {
  const double deep = tightness > 0.0 ? std::min(squeeze, tightness / foundation) : squeeze;
  Faces faces;
  for (int k = 0; k < kPlates; ++k) {
    const Vector3 n = outward(k);
    const double limb = n.dot(centre) + std::sqrt(n.dot(spread * n)) - deep;
    faces[static_cast<std::size_t>(k)] = lined ? std::min(face(), limb) : face();
  }
  return faces;
}

double Cuff::penetration(const Faces& faces, const Vector3& at, int& plate) const {
  double most = -kInfinity;
  for (int k = 0; k < kPlates; ++k) {
    const double depth_here = outward(k).dot(at) - faces[static_cast<std::size_t>(k)];
    if (depth_here > most) most = depth_here, plate = k;
  }
  return most;
}

}  // namespace ulna
