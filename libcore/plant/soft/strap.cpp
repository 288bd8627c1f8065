#include "plant/soft/strap.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/error.hpp"

namespace ulna {
namespace {

using Vector2 = Eigen::Vector2d;

std::string in_mm(double length) {
  char text[40];
  std::snprintf(text, sizeof text, "%.1f mm", 1e3 * length);
  return text;
}

// Upper convex hull from the leftmost to the rightmost point.
std::vector<Vector2> upper_hull(std::vector<Vector2> points) {
  std::sort(points.begin(), points.end(),
            [](const Vector2& a, const Vector2& b) { return a.x() < b.x(); });
  std::vector<Vector2> hull;
  for (const Vector2& p : points) {
    while (hull.size() >= 2) {
      const Vector2 u = hull.back() - hull[hull.size() - 2];
      const Vector2 v = p - hull.back();
      if (u.x() * v.y() - u.y() * v.x() < 0.0) break;
      hull.pop_back();
    }
    hull.push_back(p);
  }
  return hull;
}

double length_of(const std::vector<Vector2>& path) {
  double length = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) length += (path[i] - path[i - 1]).norm();
  return length;
}

Vector2 along_path(const std::vector<Vector2>& path, double distance) {
  for (std::size_t i = 1; i < path.size(); ++i) {
    const double piece = (path[i] - path[i - 1]).norm();
    if (distance <= piece && piece > 0.0) {
      return path[i - 1] + distance / piece * (path[i] - path[i - 1]);
    }
    distance -= piece;
  }
  return path.back();
}

}  // namespace

void StrapOptions::check() const {
  const auto positive = [this](double value, const char* argument, const char* what) {
    require(std::isfinite(value) && value > 0.0, argument,
            "the strap around the " + limb + " must have a positive " + what);
  };
  require(along >= 3 && along <= 60 && across >= 1 && across <= 20, "strap",
          "the strap around the " + limb +
              " must have between 3 and 60 points along and 1 and 20 across");
  positive(pitch, "pitch", "pitch");
  positive(half_width, "half_width", "distance of its anchors");
  positive(stiffness, "stiffness", "stiffness");
  positive(mass, "mass", "mass");
  positive(thickness, "thickness", "thickness");
  require(std::isfinite(anchor), "anchor",
          "the height of the anchors of the strap around the " + limb + " must be finite");
  require(std::isfinite(viscosity) && viscosity >= 0.0, "viscosity",
          "the viscosity of the strap around the " + limb + " must be 0 or more");
  require(std::isfinite(pretension) && pretension >= 0.0, "pretension",
          "the pretension of the strap around the " + limb + " must be 0 or more");
  require(std::isfinite(length) && length >= 0.0, "length",
          "the length of the strap around the " + limb +
              " must be positive, or 0 for the one that its pretension asks for");
}

Strap::Strap(const StrapOptions& options) : options_(options) {
  options.check();
  for (int c = 0; c + 1 < options.along; ++c) {
    for (int r = 0; r < options.across; ++r) {
      edges_.push_back({index(c, r), index(c + 1, r), true});
    }
  }
  for (int c = 1; c + 1 < options.along; ++c) {
    for (int r = 0; r + 1 < options.across; ++r) {
      edges_.push_back({index(c, r), index(c, r + 1), false});
    }
  }
}

// Moving points first, column by column; then both ends.
int Strap::index(int column, int row) const {
  if (column == 0) return moving() + row;
  if (column + 1 == options_.along) return moving() + options_.across + row;
  return (column - 1) * options_.across + row;
}

Matrix Strap::row_path(double z, const Vector3& centre, const Matrix3& q) const {
  const Eigen::Matrix2d flat = q.topLeftCorner<2, 2>();
  const Vector2 cross = q.block<2, 1>(0, 2);
  const double dz = z - centre.z();
  const Vector2 middle = centre.head<2>() - dz * (flat.inverse() * cross);
  const double level = 1.0 - dz * dz * (q(2, 2) - cross.dot(flat.inverse() * cross));
  if (level <= 0.01) {
    throw Error(Fault::kArgument, "strap",
                "the strap around the " + options_.limb + " lies beside it, not around it");
  }
  const Vector2 left(-options_.half_width, options_.anchor);
  const Vector2 right(options_.half_width, options_.anchor);
  std::vector<Vector2> points = {left, right};
  const Eigen::Matrix2d root = flat.llt().matrixL();
  for (int i = 0; i < 720; ++i) {
    const double angle = 2.0 * kPi * i / 720.0;
    const Vector2 away =
        std::sqrt(level) * (root.transpose().inverse() * Vector2(std::cos(angle), std::sin(angle)));
    const Vector2 normal = (flat * away).normalized();
    const Vector2 at = middle + away + 0.5 * options_.thickness * normal;
    if (at.x() > left.x() && at.x() < right.x()) points.push_back(at);
  }
  const std::vector<Vector2> path = upper_hull(std::move(points));
  const double length = length_of(path);
  Matrix row(3, options_.along);
  for (int c = 0; c < options_.along; ++c) {
    row.col(c) << along_path(path, length * c / (options_.along - 1)), z;
  }
  return row;
}

Strap::Donned Strap::don(const Vector3& centre, const Matrix3& ellipsoid) const {
  Donned donned;
  donned.points.resize(3, points());
  for (int r = 0; r < options_.across; ++r) {
    const double z = options_.pitch * (r - 0.5 * (options_.across - 1));
    const Matrix row = row_path(z, centre, ellipsoid);
    for (int c = 0; c < options_.along; ++c) donned.points.col(index(c, r)) = row.col(c);
  }
  const double slack = options_.pretension / (options_.across * options_.stiffness);
  for (const Edge& e : edges_) {
    const double length = (donned.points.col(e.a) - donned.points.col(e.b)).norm();
    const double rest = !e.along                ? length
                        : options_.length > 0.0 ? options_.length / (options_.along - 1)
                                                : length - slack;
    // Webbing that would have to be a half longer than it is cannot be closed.
    if (rest < length / 1.5) {
      throw Error(Fault::kArgument, "strap",
                  "the strap around the " + options_.limb + " is too short: it has " +
                      in_mm(rest * (options_.along - 1)) + " without tension and must reach over " +
                      in_mm(length * (options_.along - 1)));
    }
    donned.rest.push_back(rest);
  }
  return donned;
}

Strap::Webbing Strap::webbing(const Matrix& points, const std::vector<double>& rest) const {
  const Index n = 3 * moving();
  Webbing web{Vector::Zero(n), Matrix::Zero(n, n), Matrix::Zero(n, n), 0.0, 0.0};
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    const Edge& e = edges_[i];
    const Vector3 apart = points.col(e.b) - points.col(e.a);
    const double length = apart.norm();
    const double longer = length - rest[i];
    if (e.along && longer <= 0.0) continue;
    const Vector3 unit = apart / length;
    const double pull = options_.stiffness * longer;
    web.energy += 0.5 * pull * longer;
    if (e.along) web.tension += pull / (options_.along - 1);
    const Matrix3 axial = unit * unit.transpose();
    const Matrix3 turn = std::max(pull, 0.0) / length * (Matrix3::Identity() - axial);
    const auto put = [&](Matrix& matrix, const Matrix3& block) {
      const bool a = e.a < moving(), b = e.b < moving();
      if (a) matrix.block<3, 3>(3 * e.a, 3 * e.a) += block;
      if (b) matrix.block<3, 3>(3 * e.b, 3 * e.b) += block;
      if (!a || !b) return;
      matrix.block<3, 3>(3 * e.a, 3 * e.b) -= block;
      matrix.block<3, 3>(3 * e.b, 3 * e.a) -= block;
    };
    put(web.stiffness, options_.stiffness * axial + turn);
    put(web.damping, options_.viscosity * axial);
    if (e.a < moving()) web.force.segment<3>(3 * e.a) += pull * unit;
    if (e.b < moving()) web.force.segment<3>(3 * e.b) -= pull * unit;
  }
  return web;
}

}  // namespace ulna
