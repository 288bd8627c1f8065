#include <cmath>

#include "base/error.hpp"
#include "study/indices.hpp"
#include "study/output_blocks.hpp"

namespace ulna {
namespace {

// Effects of every block, blocks x groups, and halves of the squared changes of the output.
struct BlockEffects {
  Matrix effect;
  Matrix half_square;
  std::vector<bool> single;  // a group of one factor: its effect has a sign
};

BlockEffects effects_of(const OutputBlocks& blocks, const Sampling& sampling, Token* token) {
  const Index groups = sampling.groups();
  const Index factors = sampling.spec().factors;
  const auto count = static_cast<Index>(blocks.chosen.size());
  std::vector<Index> group_of = sampling.spec().group_of;
  std::vector<Index> members(static_cast<std::size_t>(groups), 0);
  if (group_of.empty()) {
    for (Index k = 0; k < factors; ++k) group_of.push_back(k);
  }
  for (const Index g : group_of) ++members[static_cast<std::size_t>(g)];
  BlockEffects out;
  out.effect.resize(count, groups);
  out.half_square.resize(count, groups);
  for (const Index m : members) out.single.push_back(m == 1);
  const std::vector<Index> compared = compared_rows(sampling);
  PointRows points(sampling.block_rows(), factors);
  for (Index i = 0; i < count; ++i) {
    if (i % 1024 == 0) step(token, 0.0);
    const Index block = blocks.chosen[static_cast<std::size_t>(i)];
    sampling.fill(block * sampling.block_rows(), points);
    for (Index row = 1; row < sampling.block_rows(); ++row) {
      const Index before = compared[static_cast<std::size_t>(row)];
      // The step of a group is the root mean square of its factors' steps, which is the step itself
      // on the grid of trajectories.
      double square = 0.0;
      double signed_step = 0.0;
      Index group = -1;
      for (Index k = 0; k < factors; ++k) {
        const double d = points(row, k) - points(before, k);
        if (d == 0.0) continue;
        group = group_of[static_cast<std::size_t>(k)];
        square += d * d;
        signed_step = d;
      }
      if (group < 0) {
        throw Error(Fault::kData, "sampling", "a step of the design moves no factor");
      }
      const double change = blocks.at(i, row) - blocks.at(i, before);
      const auto size = static_cast<double>(members[static_cast<std::size_t>(group)]);
      const double length = size == 1.0 ? signed_step : std::sqrt(square / size);
      out.effect(i, group) = change / length;
      out.half_square(i, group) = 0.5 * change * change;
    }
  }
  return out;
}

}  // namespace

// Features of a block: y, y^2 of its first row; a group: |E|, E - c, (E - c)^2, half of the squared
// change; c the mean effect of the data, so that a small spread about a large mean keeps its
// digits. Statistics: mean, variance, mu, mu*, sigma, total.
Indices elementary_effects(const Sampling& sampling, const VectorRef& y,
                           const std::vector<std::int32_t>& status, const IndexSpec& spec,
                           Token* token) {
  const Scheme scheme = sampling.spec().scheme;
  require(scheme == Scheme::kRadial || scheme == Scheme::kTrajectories, "sampling",
          "elementary effects need a radial design or trajectories");
  require(sampling.has_points(), "sampling", "elementary effects need the points of the runs");
  require(spec.estimator == IndexEstimator::kDefault, "estimator",
          "elementary effects have one estimator");
  const OutputBlocks blocks = output_blocks(sampling, y, status, spec, token);
  const Index groups = sampling.groups();
  const BlockEffects effects = effects_of(blocks, sampling, token);
  const Eigen::RowVectorXd centre = effects.effect.colwise().mean();

  BlockFeatures of;
  of.blocks = static_cast<Index>(blocks.chosen.size());
  of.features = 2 + 4 * groups;
  of.statistics = 2 + 4 * groups;
  of.fill = [&](Index first, Eigen::Ref<Matrix> out) {
    const Index n = out.rows();
    for (Index i = 0; i < n; ++i) {
      const double value = blocks.at(first + i, 0);
      out(i, 0) = value;
      out(i, 1) = value * value;
    }
    for (Index g = 0; g < groups; ++g) {
      const auto effect = effects.effect.col(g).segment(first, n);
      out.col(2 + 4 * g) = effect.cwiseAbs();
      out.col(3 + 4 * g) = (effect.array() - centre[g]).matrix();
      out.col(4 + 4 * g) = (effect.array() - centre[g]).square().matrix();
      out.col(5 + 4 * g) = effects.half_square.col(g).segment(first, n);
    }
  };
  of.evaluate = [&](const double* m, Index n, double* out) {
    const auto size = static_cast<double>(n);
    out[0] = m[0];
    out[1] = m[1] - m[0] * m[0];
    double* mu = out + 2;
    double* mu_star = mu + groups;
    double* sigma = mu_star + groups;
    double* total = sigma + groups;
    for (Index g = 0; g < groups; ++g) {
      const double* f = m + 2 + 4 * g;
      const bool single = effects.single[static_cast<std::size_t>(g)];
      mu[g] = single ? centre[g] + f[1] : kNaN;
      mu_star[g] = f[0];
      const double square = std::max(0.0, f[2] - f[1] * f[1]);
      sigma[g] = single ? std::sqrt(square * size / (size - 1.0)) : kNaN;
      total[g] = out[1] > 0.0 ? f[3] / out[1] : kNaN;
    }
  };
  stratify(sampling, blocks, of);
  IntervalSpec interval = spec.interval;
  interval.replicates = sampling.spec().replicates;
  const Estimates all = estimate_of_blocks(of, interval, token);

  Indices out;
  out.groups = groups;
  out.blocks = of.blocks;
  out.failures = blocks.outputs.report;
  if (blocks.constant) out.outcome = IndexOutcome::kConstant;
  out.mean = rescaled(part_of(all, 0, 1), blocks.scale, blocks.centre);
  out.variance = rescaled(part_of(all, 1, 1), blocks.scale * blocks.scale);
  out.mu = rescaled(part_of(all, 2, groups), blocks.scale);
  out.mu_star = rescaled(part_of(all, 2 + groups, groups), blocks.scale);
  out.sigma = rescaled(part_of(all, 2 + 2 * groups, groups), blocks.scale);
  if (sampling.independent_steps()) {
    out.total = part_of(all, 2 + 3 * groups, groups);
    if (blocks.constant) {
      for (Vector* v : {&out.total.value, &out.total.error, &out.total.low, &out.total.high}) {
        v->setConstant(kNaN);
      }
    }
    if (out.failures.rows > 0) {
      IndexSpec plain = spec;
      plain.on_failure = OnFailure::kError;
      const Outputs looked = look_at_outputs(sampling, y, status);
      Indices indicator = elementary_effects(sampling, failure_indicator(looked), {}, plain, token);
      if (indicator.outcome == IndexOutcome::kGood) {
        out.failure_total = std::move(indicator.total);
      }
    }
  }
  return out;
}

}  // namespace ulna
