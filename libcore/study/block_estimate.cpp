#include "study/block_estimate.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "base/words.hpp"
#include "study/distribution.hpp"
#include "study/stratified.hpp"
#include "study/streams.hpp"

namespace ulna {
namespace {

constexpr Index kBlockChunk = 1024;     // blocks whose features are made at once
constexpr Index kResamplesAtOnce = 64;  // resamples of one matrix product
constexpr Index kMaxBlocks = Index{1} << 31;

Index block_chunks(Index blocks) { return (blocks + kBlockChunk - 1) / kBlockChunk; }

// Sums over fixed chunks in their order: the same bits whatever the threads.
Vector block_means(const BlockFeatures& blocks, Index first, Index count, Token* token) {
  Vector sum = Vector::Zero(blocks.features);
  Matrix chunk;
  for (Index at = 0; at < count; at += kBlockChunk) {
    step(token, 0.0);
    chunk.resize(std::min(kBlockChunk, count - at), blocks.features);
    blocks.fill(first + at, chunk);
    sum += chunk.colwise().sum().transpose();
  }
  return sum / static_cast<double>(count);
}

// Statistics of every resample, resamples x statistics.
Matrix bootstrap_statistics(const BlockFeatures& blocks, const IntervalSpec& spec, Token* token) {
  const Index n = blocks.blocks;
  Matrix out(spec.resamples, blocks.statistics);
  const Index tasks = (spec.resamples + kResamplesAtOnce - 1) / kResamplesAtOnce;
  parallel_for(
      tasks, spec.threads,
      [&](std::ptrdiff_t task) {
        const Index first = task * kResamplesAtOnce;
        const Index count = std::min(kResamplesAtOnce, spec.resamples - first);
        const auto share = [&](double part) {
          return (static_cast<double>(task) + part) / static_cast<double>(tasks);
        };
        std::vector<std::uint16_t> times(static_cast<std::size_t>(n * count), 0);
        for (Index b = 0; b < count; ++b) {
          step(token, share(0.3 * static_cast<double>(b) / static_cast<double>(count)));
          Random random =
              random_of(spec.seed, Use::kBootstrap, 0, static_cast<std::uint64_t>(first + b));
          std::uint16_t* own = times.data() + b * n;
          for (Index draw = 0; draw < n; ++draw) {
            // A block too often by a share of n / 2^32 at most.
            ++own[(std::uint64_t{random.bits()} * static_cast<std::uint64_t>(n)) >> 32];
          }
        }
        Matrix sums = Matrix::Zero(blocks.features, count);
        Matrix weights;
        Matrix chunk;
        for (Index c = 0; c < block_chunks(n); ++c) {
          if (c % 16 == 0) {
            step(token,
                 share(0.3 + 0.7 * static_cast<double>(c) / static_cast<double>(block_chunks(n))));
          }
          const Index begin = c * kBlockChunk;
          const Index rows = std::min(kBlockChunk, n - begin);
          chunk.resize(rows, blocks.features);
          blocks.fill(begin, chunk);
          weights.resize(rows, count);
          for (Index b = 0; b < count; ++b) {
            const std::uint16_t* own = times.data() + b * n + begin;
            for (Index i = 0; i < rows; ++i) weights(i, b) = own[i];
          }
          sums.noalias() += chunk.transpose() * weights;
        }
        sums /= static_cast<double>(n);
        Vector statistics(blocks.statistics);
        for (Index b = 0; b < count; ++b) {
          blocks.evaluate(sums.col(b).data(), n, statistics.data());
          out.row(first + b) = statistics.transpose();
        }
      },
      token);
  return out;
}

// Skewness of the jackknife over 6: the acceleration of Efron 1987, one for each statistic.
Vector accelerations(const BlockFeatures& blocks, const Vector& mean, const Vector& value,
                     Token* token) {
  const Index n = blocks.blocks;
  const auto size = static_cast<double>(n);
  Eigen::ArrayXXd moments = Eigen::ArrayXXd::Zero(blocks.statistics, 3);
  Matrix chunk;
  Vector without(blocks.features);
  Vector statistics(blocks.statistics);
  for (Index begin = 0; begin < n; begin += kBlockChunk) {
    step(token, 1.0);
    chunk.resize(std::min(kBlockChunk, n - begin), blocks.features);
    blocks.fill(begin, chunk);
    for (Index i = 0; i < chunk.rows(); ++i) {
      without = (mean * size - chunk.row(i).transpose()) / (size - 1.0);
      blocks.evaluate(without.data(), n - 1, statistics.data());
      const Eigen::ArrayXd d = (value - statistics).array();
      moments.col(0) += d;
      moments.col(1) += d.square();
      moments.col(2) += d.cube();
    }
  }
  moments /= size;
  const Eigen::ArrayXd centre = moments.col(0);
  const Eigen::ArrayXd second = moments.col(1) - centre.square();
  const Eigen::ArrayXd third = moments.col(2) - 3.0 * centre * moments.col(1) + 2.0 * centre.cube();
  Vector out(blocks.statistics);
  for (Index s = 0; s < out.size(); ++s) {
    out[s] = second[s] > 0.0 ? third[s] / (6.0 * std::sqrt(size) * std::pow(second[s], 1.5)) : 0.0;
  }
  return out;
}

// Linear interpolation between ordered values (Hyndman and Fan 1996, type 7).
double interpolated_quantile(const std::vector<double>& ordered, double p) {
  const double position = p * static_cast<double>(ordered.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  if (below + 1 >= ordered.size()) return ordered.back();
  const double share = position - static_cast<double>(below);
  return ordered[below] + share * (ordered[below + 1] - ordered[below]);
}

double normal_below(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }

void put_bootstrap_intervals(const Matrix& resamples, const IntervalSpec& spec,
                             const Vector& acceleration, Estimates& out) {
  const double tail = 0.5 * (1.0 - spec.level);
  std::vector<double> ordered;
  for (Index s = 0; s < resamples.cols(); ++s) {
    ordered.clear();
    for (Index b = 0; b < resamples.rows(); ++b) {
      if (std::isfinite(resamples(b, s))) ordered.push_back(resamples(b, s));
    }
    // A statistic that its own resamples cannot have has no interval.
    if (ordered.size() < 2 || !std::isfinite(out.value[s])) continue;
    std::sort(ordered.begin(), ordered.end());
    const auto size = static_cast<double>(ordered.size());
    double mean = 0.0;
    for (const double v : ordered) mean += v - out.value[s];
    mean /= size;
    double square = 0.0;
    for (const double v : ordered) {
      const double d = v - out.value[s] - mean;
      square += d * d;
    }
    out.error[s] = std::sqrt(square / (size - 1.0));
    double low = tail;
    double high = 1.0 - tail;
    if (spec.kind == IntervalKind::kBca && ordered.front() < ordered.back()) {
      const auto from = std::lower_bound(ordered.begin(), ordered.end(), out.value[s]);
      const auto to = std::upper_bound(from, ordered.end(), out.value[s]);
      const double below =
          0.5 * static_cast<double>((from - ordered.begin()) + (to - ordered.begin()));
      // Beyond all resamples the correction would be infinite: half a resample keeps it finite.
      const double share = std::clamp(below, 0.5, size - 0.5) / size;
      const double bias = standard_normal_quantile(share);
      const auto corrected = [&](double p) {
        const double z = bias + standard_normal_quantile(p);
        return normal_below(bias + z / std::max(1e-3, 1.0 - acceleration[s] * z));
      };
      low = corrected(low);
      high = corrected(high);
    }
    out.low[s] = interpolated_quantile(ordered, low);
    out.high[s] = interpolated_quantile(ordered, high);
  }
}

// Student's t for a whole number of degrees of freedom: P(|T| < t) is a finite sum
// (Abramowitz and Stegun 26.7.3 and 26.7.4), inverted by bisection.
double student_two_sided(double level, Index dof) {
  const auto inside = [dof](double t) {
    const double angle = std::atan(t / std::sqrt(static_cast<double>(dof)));
    const double c2 = std::cos(angle) * std::cos(angle);
    double term = dof % 2 == 0 ? std::sin(angle) : std::sin(angle) * std::cos(angle);
    double sum = dof == 1 ? 0.0 : term;
    for (Index k = dof % 2 == 0 ? 2 : 3; k < dof; k += 2) {
      term *= c2 * static_cast<double>(k - 1) / static_cast<double>(k);
      sum += term;
    }
    return dof % 2 == 0 ? sum : 2.0 / kPi * (angle + sum);
  };
  double low = 0.0;
  double high = 1.0;
  while (inside(high) < level && high < 1e12) high *= 2.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (inside(middle) < level ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

void put_replicate_intervals(const BlockFeatures& blocks, const IntervalSpec& spec, Estimates& out,
                             Token* token) {
  const Index count = spec.replicates;
  const Index size = blocks.blocks / count;
  Matrix each(blocks.statistics, count);
  for (Index r = 0; r < count; ++r) {
    const Vector mean = block_means(blocks, r * size, size, token);
    blocks.evaluate(mean.data(), size, each.col(r).data());
  }
  const Vector centre = each.rowwise().mean();
  const double t = student_two_sided(spec.level, count - 1);
  for (Index s = 0; s < blocks.statistics; ++s) {
    const double square = (each.row(s).array() - centre[s]).square().sum();
    out.error[s] = std::sqrt(square / static_cast<double>(count * (count - 1)));
    out.low[s] = out.value[s] - t * out.error[s];
    out.high[s] = out.value[s] + t * out.error[s];
  }
}

}  // namespace

Estimates estimate_of_blocks(const BlockFeatures& blocks, const IntervalSpec& spec, Token* token) {
  require(blocks.blocks >= 2 && blocks.blocks < kMaxBlocks, "n",
          sentence(17, "an estimate needs 2 to 2^31 complete blocks, there are ", blocks.blocks));
  require(spec.level > 0.0 && spec.level < 1.0, "level", "level must lie between 0 and 1");
  const Vector mean = block_means(blocks, 0, blocks.blocks, token);
  Estimates out;
  out.value.resize(blocks.statistics);
  out.error.setConstant(blocks.statistics, kNaN);
  out.low = out.error;
  out.high = out.error;
  blocks.evaluate(mean.data(), blocks.blocks, out.value.data());
  switch (spec.kind) {
    case IntervalKind::kNone:
      break;
    case IntervalKind::kReplicates:
      require(spec.replicates >= 2, "interval",
              "an interval from replicates needs a design of at least two: ask for replicates");
      require(blocks.blocks % spec.replicates == 0 && blocks.blocks / spec.replicates >= 2,
              "interval",
              "replicates must have equally many blocks, at least two: after dropped blocks use a "
              "bootstrap interval");
      put_replicate_intervals(blocks, spec, out, token);
      break;
    case IntervalKind::kPercentile:
    case IntervalKind::kBca: {
      require(spec.resamples >= 50 && spec.resamples <= 1000000, "resamples",
              "resamples must be from 50 to a million for an interval");
      const BlockFeatures varying = without_strata(blocks, mean, token);
      const Matrix resamples = bootstrap_statistics(varying, spec, token);
      Vector acceleration;
      if (spec.kind == IntervalKind::kBca) {
        acceleration = accelerations(varying, mean, out.value, token);
      }
      put_bootstrap_intervals(resamples, spec, acceleration, out);
      break;
    }
  }
  return out;
}

}  // namespace ulna
