#include <cmath>

#include "base/error.hpp"
#include "study/indices.hpp"
#include "study/output_blocks.hpp"

namespace ulna {
namespace {

// Features of a block, in this order:
//   A, B, A^2, B^2                                      4
//   default, a group:  B (C - A), C - A, (C - A)^2 / 2  3
//   others, a group:   C, C^2, A C, B C                 4
//   second order:      BA - B a group, BA_i AB_j - A B a pair
// Statistics: mean, variance, first, total, dummy first and total, second.
class VarianceFeatures {
 public:
  VarianceFeatures(const OutputBlocks& blocks, Index groups, bool second, IndexEstimator estimator)
      : blocks_(blocks), groups_(groups), second_(second), estimator_(estimator) {}

  bool differences() const { return estimator_ == IndexEstimator::kDefault; }
  Index each() const { return differences() ? 3 : 4; }
  Index pairs() const { return second_ ? groups_ * (groups_ - 1) / 2 : 0; }
  Index features() const { return 4 + each() * groups_ + (second_ ? groups_ + pairs() : 0); }
  Index statistics() const { return 4 + 2 * groups_ + pairs(); }

  void fill(Index first, Eigen::Ref<Matrix> out) const {
    const Index last = blocks_.block_rows - 1;
    std::vector<double> c(static_cast<std::size_t>(groups_));
    for (Index i = 0; i < out.rows(); ++i) {
      const Index block = first + i;
      const double a = blocks_.at(block, 0);
      const double b = blocks_.at(block, last);
      out(i, 0) = a;
      out(i, 1) = b;
      out(i, 2) = a * a;
      out(i, 3) = b * b;
      Index at = 4;
      for (Index g = 0; g < groups_; ++g) {
        const double value = blocks_.at(block, 1 + g);
        c[static_cast<std::size_t>(g)] = value;
        if (differences()) {
          const double d = value - a;
          out(i, at++) = b * d;
          out(i, at++) = d;
          out(i, at++) = 0.5 * d * d;
        } else {
          out(i, at++) = value;
          out(i, at++) = value * value;
          out(i, at++) = a * value;
          out(i, at++) = b * value;
        }
      }
      if (!second_) continue;
      for (Index g = 0; g < groups_; ++g) out(i, at++) = blocks_.at(block, 1 + groups_ + g) - b;
      for (Index g = 0; g < groups_; ++g) {
        const double ba = blocks_.at(block, 1 + groups_ + g);
        for (Index h = g + 1; h < groups_; ++h) {
          out(i, at++) = ba * c[static_cast<std::size_t>(h)] - a * b;
        }
      }
    }
  }

  void evaluate(const double* m, double* out) const {
    const double mean = 0.5 * (m[0] + m[1]);
    const double variance = 0.5 * (m[2] + m[3]) - mean * mean;
    out[0] = mean;
    out[1] = variance;
    double* first = out + 2;
    double* total = first + groups_;
    double* dummy = total + groups_;
    double* pair = dummy + 2;
    for (Index g = 0; g < groups_; ++g) {
      const double* f = m + 4 + each() * g;
      if (differences()) {
        first[g] = over(f[0] - mean * f[1], variance);
        total[g] = over(f[2], variance);
      } else {
        product_indices(m, f, first[g], total[g]);
      }
    }
    if (differences()) {
      // A dummy changes nothing, so C is A and both differences vanish.
      dummy[0] = over(0.0, variance);
      dummy[1] = over(0.0, variance);
    } else {
      const double cross = second_or_cross(m);
      const double f[] = {m[0], m[2], m[2], cross};
      product_indices(m, f, dummy[0], dummy[1]);
    }
    if (!second_) return;
    const double* lift = m + 4 + each() * groups_;  // mean of BA_g - B
    const double* product = lift + groups_;
    for (Index g = 0; g < groups_; ++g) {
      for (Index h = g + 1; h < groups_; ++h) {
        const double* f = m + 4 + each() * h;
        const double moved = differences() ? f[1] : f[0] - m[0];
        // mean(BA_g AB_h) - mean(A B), both centred on the common mean
        const double closed = *product++ - mean * (lift[g] + moved);
        *pair++ = over(closed, variance) - first[g] - first[h];
      }
    }
  }

  void set_cross(bool kept) { cross_ = kept; }

 private:
  static double over(double part, double whole) { return whole > 0.0 ? part / whole : kNaN; }

  // mean(A B) is needed for the dummy of the product estimators; it is the last feature.
  double second_or_cross(const double* m) const { return cross_ ? m[features()] : kNaN; }

  void product_indices(const double* m, const double* f, double& first, double& total) const {
    switch (estimator_) {
      case IndexEstimator::kJanon: {
        const auto janon = [](double x, double y, double xx, double yy, double xy) {
          const double mean = 0.5 * (x + y);
          return over(xy - mean * mean, 0.5 * (xx + yy) - mean * mean);
        };
        first = janon(m[1], f[0], m[3], f[1], f[3]);
        total = 1.0 - janon(m[0], f[0], m[2], f[1], f[2]);
        return;
      }
      case IndexEstimator::kMartinez: {
        const auto correlation = [](double x, double y, double xx, double yy, double xy) {
          const double vx = xx - x * x;
          const double vy = yy - y * y;
          return vx > 0.0 && vy > 0.0 ? (xy - x * y) / std::sqrt(vx * vy) : kNaN;
        };
        first = correlation(m[1], f[0], m[3], f[1], f[3]);
        total = 1.0 - correlation(m[0], f[0], m[2], f[1], f[2]);
        return;
      }
      case IndexEstimator::kParity: {
        const double square = m[1] * m[1];
        const double variance = m[3] - square;
        first = over(f[3] - square, variance);
        total = 1.0 - over(f[2] - square, variance);
        return;
      }
      case IndexEstimator::kDefault:
        break;
    }
  }

  const OutputBlocks& blocks_;
  Index groups_;
  bool second_;
  IndexEstimator estimator_;
  bool cross_ = false;
};

Estimates variance_estimates(const OutputBlocks& blocks, const Sampling& sampling,
                             IndexEstimator estimator, const IntervalSpec& interval, Token* token) {
  VarianceFeatures features(blocks, sampling.groups(), sampling.spec().second_order, estimator);
  BlockFeatures of;
  of.blocks = static_cast<Index>(blocks.chosen.size());
  of.statistics = features.statistics();
  const bool cross = !features.differences();
  features.set_cross(cross);
  of.features = features.features() + (cross ? 1 : 0);
  of.fill = [&](Index first, Eigen::Ref<Matrix> out) {
    features.fill(first, out);
    if (cross) out.rightCols(1) = out.col(0).cwiseProduct(out.col(1));
  };
  of.evaluate = [&](const double* means, Index, double* out) { features.evaluate(means, out); };
  stratify(sampling, blocks, of);
  return estimate_of_blocks(of, interval, token);
}

}  // namespace

Indices variance_indices(const Sampling& sampling, const VectorRef& y,
                         const std::vector<std::int32_t>& status, const IndexSpec& spec,
                         Token* token) {
  require(sampling.spec().scheme == Scheme::kSaltelli, "sampling",
          "variance-based indices need a saltelli design");
  OutputBlocks blocks = output_blocks(sampling, y, status, spec, token);
  Indices out;
  out.groups = sampling.groups();
  out.blocks = static_cast<Index>(blocks.chosen.size());
  out.failures = blocks.outputs.report;
  if (blocks.constant) out.outcome = IndexOutcome::kConstant;
  // What SAFE computes is not centred, and shows it when the mean is large.
  if (spec.estimator == IndexEstimator::kParity) {
    blocks.centre = 0.0;
    blocks.scale = 1.0;
  }
  IntervalSpec interval = spec.interval;
  interval.replicates = sampling.spec().replicates;
  const Estimates all = variance_estimates(blocks, sampling, spec.estimator, interval, token);
  const Index groups = out.groups;
  out.mean = rescaled(part_of(all, 0, 1), blocks.scale, blocks.centre);
  out.variance = rescaled(part_of(all, 1, 1), blocks.scale * blocks.scale);
  out.first = part_of(all, 2, groups);
  out.total = part_of(all, 2 + groups, groups);
  out.dummy_first = part_of(all, 2 + 2 * groups, 1);
  out.dummy_total = part_of(all, 3 + 2 * groups, 1);
  if (sampling.spec().second_order) {
    out.second = part_of(all, 4 + 2 * groups, groups * (groups - 1) / 2);
  }
  if (blocks.constant) {
    // A ratio of rounding errors is no index.
    const auto undefine = [](Estimates& e) {
      for (Vector* v : {&e.value, &e.error, &e.low, &e.high}) v->setConstant(kNaN);
    };
    for (Estimates* e : {&out.first, &out.total, &out.second, &out.dummy_first, &out.dummy_total}) {
      undefine(*e);
    }
  }
  if (out.failures.rows > 0) {
    IndexSpec plain = spec;
    plain.on_failure = OnFailure::kError;
    const Outputs looked = look_at_outputs(sampling, y, status);
    const OutputBlocks indicator =
        output_blocks(sampling, failure_indicator(looked), {}, plain, token);
    if (!indicator.constant) {
      const Estimates of =
          variance_estimates(indicator, sampling, IndexEstimator::kDefault, interval, token);
      out.failure_first = part_of(of, 2, groups);
      out.failure_total = part_of(of, 2 + groups, groups);
    }
  }
  return out;
}

}  // namespace ulna
