#include "passivity/energy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

// Points of one block that its path is remembered by: E and D are smooth between them.
constexpr Index kPointsPerBlock = 32;
constexpr Index kLeastBlocks = 5;  // fewer say nothing about scatter

}  // namespace

EnergySeries absorbed_energy(MatrixRef force, MatrixRef velocity, double rate_hz, Index stride) {
  require(force.rows() == velocity.rows() && force.cols() == velocity.cols(), "velocity",
          "force and velocity must have the same shape");
  require(rate_hz > 0.0, "rate_hz", "the sampling rate must be positive");
  const Index rows = force.rows();
  const Index kept = rows == 0 ? 0 : (rows - 1 + stride - 1) / stride + 1;
  EnergySeries out{Vector(kept), Vector(kept), Vector(kept), {}};
  double energy = 0.0;
  double motion = 0.0;
  double last_power = 0.0;
  double last_speed = 0.0;
  for (Index i = 0, k = 0; i < rows; ++i) {
    const double power = -force.row(i).dot(velocity.row(i));
    const double speed = velocity.row(i).squaredNorm();
    if (i > 0) {
      energy += 0.5 * (power + last_power) / rate_hz;
      motion += 0.5 * (speed + last_speed) / rate_hz;
    }
    last_power = power;
    last_speed = speed;
    if (i % stride != 0 && i != rows - 1) continue;
    out.time_s[k] = static_cast<double>(i) / rate_hz;
    out.energy_j[k] = energy;
    out.dissipation[k] = motion;
    ++k;
  }
  return out;
}

EnergyIndex energy_index(const EnergySeries& series, double beta_j, double min_share) {
  return energy_index(std::vector<EnergySeries>{series}, {beta_j}, min_share);
}

EnergyIndex energy_index(const std::vector<EnergySeries>& trials, const std::vector<double>& beta_j,
                         double min_share) {
  EnergyIndex out{std::numeric_limits<double>::infinity(), kNaN};
  for (std::size_t t = 0; t < trials.size(); ++t) {
    const EnergySeries& series = trials[t];
    if (series.dissipation.size() == 0) continue;
    const double least = min_share * series.dissipation.tail(1)[0];
    for (Index i = 0; i < series.dissipation.size(); ++i) {
      const double moved = series.dissipation[i];
      if (!(moved > 0.0) || moved < least) continue;
      const double delta = (series.energy_j[i] - beta_j[t]) / moved;
      if (delta < out.delta) out = {delta, series.time_s[i]};
    }
  }
  if (std::isinf(out.delta)) out.delta = kNaN;
  return out;
}

std::vector<double> energy_index_bootstrap(const std::vector<EnergySeries>& trials,
                                           double min_share, double block_s, Index count,
                                           std::uint64_t seed, Token* token) {
  struct Block {
    Vector lost, moved;  // increments of E - V and D from the block's start
    Vector stored;       // V
  };
  const auto cut = [&](const EnergySeries& series) {
    std::vector<Block> blocks;
    const Index rows = series.time_s.size();
    if (rows <= kLeastBlocks) return blocks;
    const double wanted =
        std::min(series.time_s[rows - 1] / block_s, static_cast<double>(rows - 1));
    const Index pieces = std::clamp(static_cast<Index>(wanted), kLeastBlocks, rows - 1);
    const bool knows = series.stored_j.size() == rows;
    const auto stored = [&](Index row) { return knows ? series.stored_j[row] : 0.0; };
    for (Index b = 0; b < pieces; ++b) {
      const Index begin = (rows - 1) * b / pieces;
      const Index end = (rows - 1) * (b + 1) / pieces;
      const Index points = std::min<Index>(kPointsPerBlock, end - begin);
      Block block{Vector(points), Vector(points), Vector(points)};
      for (Index k = 0; k < points; ++k) {
        const Index row = begin + (end - begin) * (k + 1) / points;
        block.stored[k] = stored(row);
        block.lost[k] = series.energy_j[row] - series.energy_j[begin] - stored(row) + stored(begin);
        block.moved[k] = series.dissipation[row] - series.dissipation[begin];
      }
      blocks.push_back(std::move(block));
    }
    return blocks;
  };
  std::vector<std::vector<Block>> blocks;
  for (const EnergySeries& series : trials) blocks.push_back(cut(series));

  std::vector<double> out;
  for (Index replicate = 0; replicate < count; ++replicate) {
    step(token, static_cast<double>(replicate) / static_cast<double>(count));
    Random random(seed, static_cast<std::uint64_t>(replicate));
    double delta = std::numeric_limits<double>::infinity();
    for (std::size_t t = 0; t < trials.size(); ++t) {
      std::vector<const Block*> order(blocks[t].size());
      double total = 0.0;
      for (const Block*& drawn : order) {
        const auto size = static_cast<std::int64_t>(blocks[t].size());
        drawn = &blocks[t][static_cast<std::size_t>(random.below(size))];
        total += drawn->moved.tail(1)[0];
      }
      double lost = 0.0;
      double moved = 0.0;
      for (const Block* block : order) {
        for (Index k = 0; k < block->lost.size(); ++k) {
          const double d = moved + block->moved[k];
          if (d > 0.0 && d >= min_share * total) {
            delta = std::min(delta, (lost + block->lost[k] + block->stored[k]) / d);
          }
        }
        lost += block->lost.tail(1)[0];
        moved += block->moved.tail(1)[0];
      }
    }
    if (std::isfinite(delta)) out.push_back(delta);
  }
  return out;
}

}  // namespace ulna
