// The outputs of a study by block, as both kinds of analysis take them: failures treated, blocks
// chosen, centred and scaled.
#pragma once

#include <vector>

#include "study/indices.hpp"

namespace ulna {

struct OutputBlocks {
  Outputs outputs;
  std::vector<Index> chosen;  // blocks that are analysed, replicate after replicate
  Index block_rows = 1;
  double centre = 0.0;
  double scale = 1.0;     // outputs are (y - centre) / scale; 1 when they do not vary
  bool constant = false;  // equal up to rounding

  double at(Index block, Index row) const {
    return (outputs.y[chosen[static_cast<std::size_t>(block)] * block_rows + row] - centre) / scale;
  }
};

OutputBlocks output_blocks(const Sampling& sampling, const VectorRef& y,
                           const std::vector<std::int32_t>& status, const IndexSpec& spec,
                           Token* token);

// Tells a bootstrap which coordinates of the blocks a Latin hypercube stratifies, when every block
// of the design is there.
void stratify(const Sampling& sampling, const OutputBlocks& blocks, BlockFeatures& of);

// Entries first, first + 1, ... of all statistics.
Estimates part_of(const Estimates& all, Index first, Index count);

// value, error and both ends times `factor`, then shifted by `shift` (but not the error).
Estimates rescaled(Estimates estimates, double factor, double shift = 0.0);

// The indicator of failures as outputs of the same design, for the analysis of failures itself.
Vector failure_indicator(const Outputs& looked_at);

}  // namespace ulna
