#include "plant/parity_interface.hpp"

#include <array>
#include <map>

namespace ulna {
namespace {

std::string numbered(const std::string& name, std::initializer_list<int> numbers) {
  std::string text = name;
  for (const int number : numbers) text += "_" + std::to_string(number);
  return text;
}

using GridPlace = std::array<int, 3>;

ParityShell shell_of(const std::string& name, const GridPlace& count) {
  ParityShell shell;
  shell.name = name;
  const Vector3 last(count[0] - 1, count[1] - 1, count[2] - 1);
  const Vector3 half = 0.5 * ParityShell::kSpacing * last;
  std::map<GridPlace, std::size_t> at;
  for (int i = 0; i < count[0]; ++i) {
    for (int j = 0; j < count[1]; ++j) {
      for (int k = 0; k < count[2]; ++k) {
        const bool surface = i == 0 || j == 0 || k == 0 || i == count[0] - 1 || j == count[1] - 1 ||
                             k == count[2] - 1;
        if (!surface) continue;
        const Vector3 unit =
            (2.0 * Vector3(i, j, k).cwiseQuotient(last) - Vector3::Ones()).normalized();
        const Vector3 position = half.cwiseProduct(unit);
        at[{i, j, k}] = shell.elements.size();
        shell.elements.push_back({numbered(name, {i, j, k}), position, position.normalized()});
      }
    }
  }
  for (const auto& [place, element] : at) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      GridPlace next = place;
      ++next[axis];
      const auto found = at.find(next);
      if (found != at.end()) shell.neighbours.emplace_back(element, found->second);
    }
  }
  return shell;
}

// anchors: of the first and the last column's middle points, link axes; `across` leads from one to
// the next in a column.
ParityStrap strap_of(const std::string& name, const std::string& link, const Vector3& position,
                     const Matrix3& orientation, const Vector3& anchor, const Vector3& across) {
  ParityStrap strap{name, link, position, orientation, {}, {}};
  constexpr double kPitch = ParityStrap::kPitch;
  const auto index = [](int along, int row) {
    return static_cast<std::size_t>(along * ParityStrap::kAcross + row);
  };
  for (int i = 0; i < ParityStrap::kAlong; ++i) {
    for (int j = 0; j < ParityStrap::kAcross; ++j) {
      ParityStrap::Point point;
      point.name = numbered(name, {i, j});
      // Half a pitch off the middle, as the engine made such grids.
      point.position =
          kPitch * Vector3(i - 0.5 * ParityStrap::kAlong, j - 0.5 * ParityStrap::kAcross, 0.0);
      point.end = i == 0 || i == ParityStrap::kAlong - 1;
      if (point.end) {
        const double side = i == 0 ? -1.0 : 1.0;
        point.anchor =
            Vector3(side * anchor.x(), anchor.y(), anchor.z()) + (j - 1) * kPitch * across;
      }
      strap.points.push_back(point);
    }
  }
  for (int i = 0; i + 1 < ParityStrap::kAlong; ++i) {
    for (int j = 0; j < ParityStrap::kAcross; ++j) {
      strap.threads.emplace_back(index(i, j), index(i + 1, j));
    }
  }
  for (int i = 0; i < ParityStrap::kAlong; ++i) {
    for (int j = 0; j + 1 < ParityStrap::kAcross; ++j) {
      strap.threads.emplace_back(index(i, j), index(i, j + 1));
    }
  }
  return strap;
}

}  // namespace

ParityShell ParityShell::upper_arm() { return shell_of("upper_tissue", {9, 5, 5}); }
ParityShell ParityShell::forearm() { return shell_of("fore_tissue", {9, 4, 4}); }

ParityStrap ParityStrap::upper_arm() {
  Matrix3 quarter;  // about x
  quarter << 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0;
  return strap_of("upper_strap", "Link3", {0.0, -0.05, -0.133}, quarter, {0.045, -0.015, -0.133},
                  Vector3::UnitZ());
}

ParityStrap ParityStrap::forearm() {
  return strap_of("fore_strap", "Link4", {0.0, 0.12, 0.02}, Matrix3::Identity(),
                  {0.045, 0.120, -0.005}, Vector3::UnitY());
}

ParityCuff ParityCuff::upper_arm() {
  ParityCuff cuff{.name = "upper_cuff", .link = "Link3", .boxes = {}};
  constexpr double kPlaces[3][3] = {
      {0.054, 0.00668, 63.7}, {0.0372, 0.0273, 38.2}, {0.0133, 0.0387, 12.7}};  // m m degrees
  for (std::size_t i = 0; i < 6; ++i) {
    const double* p = kPlaces[i / 2];
    const double side = i % 2 == 0 ? 1.0 : -1.0;
    cuff.boxes[i] = {{0.0125, 0.005, 0.05},
                     {side * p[0], p[1], -0.133},
                     Vector3::UnitZ(),
                     -side * p[2] * kDegree};
  }
  return cuff;
}

ParityCuff ParityCuff::forearm() {
  ParityCuff cuff{.name = "fore_cuff", .link = "Link4", .boxes = {}};
  constexpr double kPlaces[3][3] = {
      {0.0412, -0.0311, 53.0}, {0.0272, -0.0439, 31.8}, {0.0095, -0.0508, 10.6}};
  for (std::size_t i = 0; i < 6; ++i) {
    const double* p = kPlaces[i / 2];
    const double side = i % 2 == 0 ? 1.0 : -1.0;
    cuff.boxes[i] = {{0.00873, 0.05, 0.005},
                     {side * p[0], 0.12, p[1]},
                     Vector3::UnitY(),
                     -side * p[2] * kDegree};
  }
  return cuff;
}

}  // namespace ulna
