#include "plant/soft/bushing_table.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/pool.hpp"

namespace ulna {
namespace {

SoftScene with_tissue(SoftScene scene, double stiffness) {
  for (SoftInterfaceOptions& i : scene.interfaces) i.tissue.stiffness = stiffness;
  return scene;
}

Bushing between(const Bushing& a, const Bushing& b, double share) {
  Bushing c = a;
  const auto mix = [share](const auto& x, const auto& y) { return (x + share * (y - x)).eval(); };
  c.origin = mix(a.origin, b.origin);
  c.preload = mix(a.preload, b.preload);
  c.stiffness = mix(a.stiffness, b.stiffness);
  c.damping = mix(a.damping, b.damping);
  return c;
}

}  // namespace

BushingTable::BushingTable(const SoftScene& scene, double low, double high, Index levels,
                           const ReductionOptions& options, int threads, Token* token) {
  require(std::isfinite(low) && std::isfinite(high) && low > 0.0 && high > low, "low",
          "the range of a table's stiffness must go from above 0 upwards");
  require(levels >= 2 && levels <= 100, "levels", "a table needs between 2 and 100 levels");
  for (Index k = 0; k < levels; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(levels - 1);
    // The ends as they were given, not as their logarithms come back.
    levels_.push_back(k == 0 ? low : k == levels - 1 ? high : low * std::pow(high / low, share));
  }
  bushings_.resize(levels_.size());
  parallel_for(
      levels, threads,
      [&](std::ptrdiff_t k) {
        const auto at = static_cast<std::size_t>(k);
        Token part(token);
        bushings_[at] = reduce(SoftPlant(with_tissue(scene, levels_[at])), options, &part).bushings;
      },
      token);
}

std::vector<Bushing> BushingTable::at(const std::vector<double>& stiffness) const {
  std::vector<Bushing> result = bushings_.front();
  for (std::size_t b = 0; b < result.size(); ++b) {
    const auto interface = static_cast<std::size_t>(result[b].interface);
    require(interface < stiffness.size(), "stiffness",
            "a stiffness is needed for each interface of the table");
    const double k = stiffness[interface];
    require(k >= levels_.front() && k <= levels_.back(), "stiffness",
            "a stiffness of " + std::to_string(k) + " N/m lies beyond the table, " +
                std::to_string(levels_.front()) + " to " + std::to_string(levels_.back()));
    const auto above = std::upper_bound(levels_.begin() + 1, levels_.end() - 1, k);
    const auto high = static_cast<std::size_t>(above - levels_.begin());
    const double share =
        std::log(k / levels_[high - 1]) / std::log(levels_[high] / levels_[high - 1]);
    result[b] = between(bushings_[high - 1][b], bushings_[high][b], share);
  }
  return result;
}

}  // namespace ulna
