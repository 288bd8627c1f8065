#include "study/output_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/words.hpp"
#include "study/permutation.hpp"
#include "study/streams.hpp"

namespace ulna {
namespace {

std::vector<Index> choose_blocks(const Sampling& sampling, const IndexSpec& spec) {
  const Index n = sampling.spec().n;
  const Index wanted = spec.blocks == 0 ? n : spec.blocks;
  require(wanted >= 1 && wanted <= n, "blocks",
          sentence(17, "blocks must be from 1 to ", n, ", the blocks of a replicate"));
  std::vector<Index> out;
  for (Index r = 0; r < sampling.spec().replicates; ++r) {
    if (spec.subset == Subset::kPrefix || wanted == n) {
      for (Index b = 0; b < wanted; ++b) out.push_back(r * n + b);
      continue;
    }
    const Permutation order(
        n, random_of(spec.interval.seed, Use::kSubset, static_cast<std::uint64_t>(r), 0));
    for (Index b = 0; b < wanted; ++b) out.push_back(r * n + order(b));
  }
  return out;
}

}  // namespace

OutputBlocks output_blocks(const Sampling& sampling, const VectorRef& y,
                           const std::vector<std::int32_t>& status, const IndexSpec& spec,
                           Token* token) {
  OutputBlocks out;
  out.block_rows = sampling.block_rows();
  out.outputs = look_at_outputs(sampling, y, status);
  treat_failures(sampling, spec.on_failure, spec.interval.seed, out.outputs, token);
  out.chosen = choose_blocks(sampling, spec);
  std::erase_if(out.chosen, [&](Index block) {
    for (Index row = 0; row < out.block_rows; ++row) {
      if (out.outputs.failed[static_cast<std::size_t>(block * out.block_rows + row)]) return true;
    }
    return false;
  });
  if (out.chosen.size() < 2) {
    throw Error(Fault::kData, "y",
                "an estimate needs at least two complete blocks; run a larger design");
  }
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  double sum = 0.0;
  for (const Index block : out.chosen) {
    for (Index row = 0; row < out.block_rows; ++row) {
      const double value = out.outputs.y[block * out.block_rows + row];
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  // From the lowest, so that a large mean takes no digits.
  for (const Index block : out.chosen) {
    sum += (out.outputs.y.segment(block * out.block_rows, out.block_rows).array() - low).sum();
  }
  const auto count = static_cast<double>(out.chosen.size()) * static_cast<double>(out.block_rows);
  out.centre = low + sum / count;
  require(std::isfinite(high - low) && std::isfinite(sum), "y",
          "the outputs are so large that their differences overflow: change their unit");
  const double largest = std::max(std::abs(low), std::abs(high));
  out.constant = high - low <= 16.0 * std::numeric_limits<double>::epsilon() * largest;
  if (!out.constant) out.scale = high - low;
  return out;
}

void stratify(const Sampling& sampling, const OutputBlocks& blocks, BlockFeatures& of) {
  if (static_cast<Index>(blocks.chosen.size()) != sampling.blocks()) return;
  of.coordinates = sampling.stratified_coordinates();
  of.fill_coordinates = [&sampling](Index first, Eigen::Ref<PointRows> out) {
    sampling.fill_strata(first, out);
  };
}

Estimates part_of(const Estimates& all, Index first, Index count) {
  return {all.value.segment(first, count), all.error.segment(first, count),
          all.low.segment(first, count), all.high.segment(first, count)};
}

Estimates rescaled(Estimates estimates, double factor, double shift) {
  estimates.value = (estimates.value.array() * factor + shift).matrix();
  estimates.error *= factor;
  estimates.low = (estimates.low.array() * factor + shift).matrix();
  estimates.high = (estimates.high.array() * factor + shift).matrix();
  return estimates;
}

Vector failure_indicator(const Outputs& looked_at) {
  Vector out(looked_at.y.size());
  for (Index i = 0; i < out.size(); ++i) {
    out[i] = looked_at.failed[static_cast<std::size_t>(i)] ? 1.0 : 0.0;
  }
  return out;
}

}  // namespace ulna
