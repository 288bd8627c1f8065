#include "plant/engine/compose.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace ulna::engine {
namespace {

using Light = std::array<double, 3>;  // 0 ... 255

constexpr Light kTop = {221.0, 229.0, 239.0};
constexpr Light kBottom = {252.0, 252.0, 253.0};
constexpr Light kFloor = {236.0, 239.0, 243.0};
constexpr Light kLine = {158.0, 168.0, 180.0};
constexpr Light kOutline = {30.0, 34.0, 40.0};
constexpr double kOutlineShare = 0.55;
constexpr double kSpacing = 0.1;  // of the lines on the floor, m
constexpr double kLineWidth = 0.0024;

Light mixed(const Light& a, const Light& b, double share) {
  return {a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])};
}

double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// How much of a pixel of `size` (m) a line takes; every tenth line is twice as wide.
double line_share(double coordinate, double size) {
  const double line = std::round(coordinate / kSpacing);
  const double away = std::fabs(coordinate - line * kSpacing);
  const bool tenth = std::fabs(std::remainder(line, 10.0)) < 0.5;
  const double width = tenth ? 2.0 * kLineWidth : kLineWidth;
  const double drawn = std::max(width, size);
  return width / drawn * std::clamp((0.5 * drawn - away) / size + 0.5, 0.0, 1.0);
}

// Distance along the view from a value of the depth buffer.
std::vector<float> distances(const Rendered& r, const View& v) {
  std::vector<float> z(r.depth.size());
  const double product = v.near * v.far;
  const double span = v.far - v.near;
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double d = r.depth[i];
    z[i] = d >= 1.0 ? std::numeric_limits<float>::infinity()
                    : static_cast<float>(product / (v.far - d * span));
  }
  return z;
}

class Composer {
 public:
  Composer(const Rendered& rendered, const View& view, const Backdrop& backdrop)
      : r_(rendered), v_(view), b_(backdrop), right_(view.right()), z_(distances(r_, v_)) {}

  bool is_background(std::size_t place) const {
    return b_.wall > 0.0 ? static_cast<double>(z_[place]) > 0.98 * b_.wall : std::isinf(z_[place]);
  }
  float distance(std::size_t place) const { return z_[place]; }
  std::size_t place(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(r_.width) +
           static_cast<std::size_t>(column);
  }

  // Column and row from the bottom left.
  Light at(int column, int row) const {
    const std::size_t here = place(column, row);
    const std::uint8_t* p = r_.rgb.data() + 3 * here;
    const Light drawn = {static_cast<double>(p[0]), static_cast<double>(p[1]),
                         static_cast<double>(p[2])};
    if (b_.wall == 0.0) return drawn;
    if (is_background(here)) {
      const Light behind = background(column, row);
      return {drawn[0] * behind[0] / 255.0, drawn[1] * behind[1] / 255.0,
              drawn[2] * behind[2] / 255.0};
    }
    return b_.outline && is_edge(column, row) ? mixed(drawn, kOutline, kOutlineShare) : drawn;
  }

 private:
  // Something else lies well behind the next pixel.
  bool is_edge(int column, int row) const {
    const float limit = 1.02F * z_[place(column, row)];
    return (column + 1 < r_.width && z_[place(column + 1, row)] > limit) ||
           (column > 0 && z_[place(column - 1, row)] > limit) ||
           (row + 1 < r_.height && z_[place(column, row + 1)] > limit) ||
           (row > 0 && z_[place(column, row - 1)] > limit);
  }

  Light background(int column, int row) const {
    const Light sky = mixed(kBottom, kTop, smooth_step(0.0, 1.0, (row + 0.5) / r_.height));
    if (!b_.floor) return sky;
    const double pixel = 2.0 * v_.tangent / r_.height;  // at a distance of 1 m
    const Vector3 ray = v_.forward + pixel * ((column + 0.5 - 0.5 * r_.width) * right_ +
                                              (row + 0.5 - 0.5 * r_.height) * v_.up);
    const double drop = v_.position.z() - b_.floor_height;
    if (drop <= 0.0 || ray.z() > -1e-6) return sky;
    const double z = -drop / ray.z();
    const Vector3 p = v_.position + z * ray;
    const double away = std::hypot(p.x() - b_.centre.x(), p.y() - b_.centre.y());
    const double seen = 1.0 - smooth_step(0.3 * b_.radius, b_.radius, away);
    if (seen <= 0.0) return sky;
    Light floor = kFloor;
    if (b_.grid) {
      const double size = pixel * z * ray.norm() / -ray.z();
      floor = mixed(floor, kLine, std::max(line_share(p.x(), size), line_share(p.y(), size)));
    }
    return mixed(sky, floor, seen);
  }

  const Rendered& r_;
  const View& v_;
  const Backdrop& b_;
  Vector3 right_;
  std::vector<float> z_;
};

}  // namespace

Vector3 View::right() const { return forward.cross(up); }

void compose(const Rendered& rendered, const View& view, const Backdrop& backdrop, int samples,
             std::uint8_t* rgb, float* depth) {
  const Composer composer(rendered, view, backdrop);
  const int width = rendered.width / samples;
  const int height = rendered.height / samples;
  for (int y = 0; y < height; ++y) {
    const int bottom = (height - 1 - y) * samples;
    for (int x = 0; x < width; ++x) {
      Light sum = {0.0, 0.0, 0.0};
      float nearest = std::numeric_limits<float>::infinity();
      for (int j = 0; j < samples; ++j) {
        for (int i = 0; i < samples; ++i) {
          const Light light = composer.at(x * samples + i, bottom + j);
          for (std::size_t c = 0; c < 3; ++c) sum[c] += light[c];
          const std::size_t place = composer.place(x * samples + i, bottom + j);
          if (!composer.is_background(place)) {
            nearest = std::min(nearest, composer.distance(place));
          }
        }
      }
      for (const double c : sum) *rgb++ = static_cast<std::uint8_t>(c / (samples * samples) + 0.5);
      if (depth != nullptr) *depth++ = nearest;
    }
  }
}

}  // namespace ulna::engine
