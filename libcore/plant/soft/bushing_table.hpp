// Bushings of an interface over the stiffness of its tissue: a few full plants are reduced once,
// and what lies between them is interpolated. Reducing a plant takes longer than a run of what it
// becomes.
#pragma once

#include <vector>

#include "plant/soft/reduced_plant.hpp"

namespace ulna {

class BushingTable {
 public:
  // Reduces the scene at `levels` stiffnesses of the tissue (N/m, all interfaces alike) whose
  // logarithms are evenly spaced from `low` to `high`. The rest of the scene is that of the table:
  // bushings of arms of other sizes are taken to be the same. Throws Error (kArgument) for a range
  // that is none, and what reduce() throws.
  BushingTable(const SoftScene& scene, double low, double high, Index levels,
               const ReductionOptions& options = {}, int threads = 0, Token* token = nullptr);

  // stiffness: of the tissue of each interface, N/m. Linear in its logarithm, each interface by
  // itself; convex combinations of bushings are bushings. Throws Error (kArgument) beyond the ends.
  std::vector<Bushing> at(const std::vector<double>& stiffness) const;

  const std::vector<double>& levels() const { return levels_; }

 private:
  std::vector<double> levels_;                  // N/m
  std::vector<std::vector<Bushing>> bushings_;  // of each level
};

}  // namespace ulna
