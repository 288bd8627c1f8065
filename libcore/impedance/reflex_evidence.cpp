#include "impedance/reflex_evidence.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "base/random.hpp"
#include "stats/distributions.hpp"

namespace ulna {
namespace {

constexpr Index kVafReplicates = 500;
constexpr Index kLeastVafBlocks = 5;  // fewer have no interval
constexpr std::uint64_t kVafStream = 1u << 23;

// Sums of squares of a block, each about the mean of its run.
struct BlockSums {
  double torque = 0.0, both = 0.0, intrinsic = 0.0, reflex = 0.0, without = 0.0;

  void add(const BlockSums& other) {
    torque += other.torque;
    both += other.both;
    intrinsic += other.intrinsic;
    reflex += other.reflex;
    without += other.without;
  }
};

std::vector<BlockSums> validation_blocks(const std::vector<CascadeTrial>& trials,
                                         const std::vector<CascadePaths>& paths,
                                         const std::vector<Span>& spans, double block_rows) {
  std::vector<BlockSums> out;
  for (const Span& span : spans) {
    const auto t = static_cast<std::size_t>(span.trial);
    const Index first = std::max(span.begin, paths[t].first);
    const Index last = std::min(span.end, paths[t].last);
    if (last - first < 10) continue;
    const Index rows = last - first;
    const auto centred = [&](const Vector& values) {
      return Vector(values.array() - values.mean());
    };
    const Vector y = centred(trials[t].torque.segment(first, rows));
    const Vector i = centred(paths[t].intrinsic.segment(first, rows));
    const Vector r = centred(paths[t].reflex.segment(first, rows));
    const Vector w = centred(paths[t].without.segment(first, rows));
    const Index pieces =
        std::max<Index>(1, static_cast<Index>(static_cast<double>(rows) / block_rows));
    for (Index k = 0; k < pieces; ++k) {
      const Index at = rows * k / pieces;
      const Index count = rows * (k + 1) / pieces - at;
      const auto square = [&](const Vector& values) {
        return values.segment(at, count).squaredNorm();
      };
      out.push_back({square(y), square(y - i - r), square(y - i), square(y - r), square(y - w)});
    }
  }
  return out;
}

}  // namespace

CascadePaths paths_of(const CascadeTrial& trial, const CascadeGrid& grid,
                      const ReflexOptions& options, const CascadeFit& fitted) {
  const Index rows = trial.torque.size();
  const Index lags = grid.intrinsic_lags;
  const Index path = lags > 0 ? 2 * lags + 1 : 3;
  CascadePaths out;
  out.first = std::min(rows, trial.edge + grid.back);
  out.last = std::max(out.first, rows - trial.edge - grid.ahead);
  const auto intrinsic = [&](const Vector& theta) {
    Vector torque = Vector::Zero(rows);
    if (lags == 0) {
      torque = trial.motion * Vector(theta.head(3).reverse());
    } else {
      for (Index k = -lags; k <= lags; ++k) {
        const Index shift = k * grid.irf_step;
        torque.segment(out.first, out.last - out.first) +=
            theta[k + lags] * trial.motion.col(0).segment(out.first - shift, out.last - out.first);
      }
    }
    return Vector(torque + trial.powers * theta.segment(path, trial.powers.cols()));
  };
  out.intrinsic = intrinsic(fitted.theta);
  out.without = intrinsic(fitted.theta_without);
  const Vector& q = fitted.solution.parameters;
  const CausalElement element{options.order, std::exp(q[0]),
                              options.order == 2 ? std::exp(q[1]) : 1.0};
  const Matrix response = element_response(element, trial.drive, grid.step);
  out.reflex.resize(rows);
  const double delay = q[options.order] / grid.step;
  for (Index i = 0; i < rows; ++i) {
    out.reflex[i] = fitted.theta[fitted.theta.size() - 1] *
                    delayed_value(response, grid.step, static_cast<double>(i) - delay);
  }
  return out;
}

void validate_paths(ReflexEstimate& out, const std::vector<CascadeTrial>& trials,
                    const std::vector<CascadePaths>& paths, const Split& split, double block_rows,
                    std::uint64_t seed) {
  const std::vector<BlockSums> held_out =
      validation_blocks(trials, paths, split.held_out, block_rows);
  const auto sum = [](const std::vector<BlockSums>& blocks) {
    BlockSums total;
    for (const BlockSums& block : blocks) total.add(block);
    return total;
  };
  const auto vaf = [](double error, double torque) {
    return torque > 0.0 ? 100.0 * (1.0 - error / torque) : kNaN;
  };
  const BlockSums all = sum(held_out);
  out.vaf = vaf(all.both, all.torque);
  out.vaf_intrinsic = vaf(all.intrinsic, all.torque);
  out.vaf_reflex = vaf(all.reflex, all.torque);
  out.vaf_without = vaf(all.without, all.torque);
  const BlockSums seen = sum(validation_blocks(trials, paths, split.train, block_rows));
  out.vaf_train = vaf(seen.both, seen.torque);
  out.vaf_train_without = vaf(seen.without, seen.torque);
  for (double* interval : {out.vaf_interval, out.gain_interval}) interval[0] = interval[1] = kNaN;
  if (static_cast<Index>(held_out.size()) < kLeastVafBlocks) return;
  std::vector<double> vafs, gains;
  for (Index r = 0; r < kVafReplicates; ++r) {
    Random random(seed, kVafStream + static_cast<std::uint64_t>(r));
    BlockSums drawn;
    for (std::size_t b = 0; b < held_out.size(); ++b) {
      drawn.add(held_out[static_cast<std::size_t>(
          random.below(static_cast<std::int64_t>(held_out.size())))]);
    }
    vafs.push_back(vaf(drawn.both, drawn.torque));
    gains.push_back(vafs.back() - vaf(drawn.without, drawn.torque));
  }
  out.vaf_interval[0] = sample_quantile(vafs, 0.025);
  out.vaf_interval[1] = sample_quantile(vafs, 0.975);
  out.gain_interval[0] = sample_quantile(gains, 0.025);
  out.gain_interval[1] = sample_quantile(gains, 0.975);
}

ScoreTest test_reflex(const Prepared& prepared, const std::vector<Span>& spans,
                      const ReflexOptions& options, const CascadeGrid& grid, const Cascade& cascade,
                      const CascadeFit& fitted, const std::vector<int>& sides, double position_mean,
                      Token* token) {
  const Vector residual = cascade.torque() - cascade.linear() * fitted.theta_without;
  const auto blocks = score_blocks(cascade.sample().bounds,
                                   static_cast<Index>(options.block_s * grid.sample_rate()));
  const Eigen::HouseholderQR<Matrix> qr(cascade.linear());
  const Matrix basis =
      qr.householderQ() * Matrix::Identity(cascade.linear().rows(), cascade.linear().cols());
  std::vector<Matrix> candidates;
  for (const int side : sides) {
    const auto trials = cascade_trials(prepared, options, side, position_mean);
    const CascadeSample sample =
        cascade_sample(trials, spans, grid.back, grid.ahead, grid.stride, 2 + options.drift);
    const RunOffsets offsets(sample, options.drift);
    for (const double omega : {6.0, 15.0, 45.0}) {
      for (int k = 0; k < 5; ++k) {
        step(token, 0.8);
        const double delay = options.delay_min_s + 0.25 * static_cast<double>(k) *
                                                       (options.delay_max_s - options.delay_min_s);
        const CausalElement element{options.order, omega, 0.8};
        Vector column = offsets.removed(reflex_column(trials, sample, element, delay, grid.step));
        column -= basis * (basis.transpose() * column);
        Matrix sums(static_cast<Index>(blocks.size()), 1);
        for (std::size_t b = 0; b < blocks.size(); ++b) {
          const Index count = blocks[b].second - blocks[b].first;
          sums(static_cast<Index>(b), 0) =
              column.segment(blocks[b].first, count).dot(residual.segment(blocks[b].first, count));
        }
        if (sums.squaredNorm() > 0.0) candidates.push_back(std::move(sums));
      }
    }
  }
  return score_test(candidates, options.draws, options.seed, token);
}

}  // namespace ulna
