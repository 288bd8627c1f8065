#include "study/sampling.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "base/error.hpp"
#include "base/words.hpp"
#include "study/streams.hpp"

namespace ulna {
namespace {

constexpr Index kMaximinRows = 1 << 14;  // distances are of all pairs
constexpr Index kMaxSampledRows = Index{1} << 40;
constexpr Index kNumbersAtOnce = 1 << 20;

void check_power_of_two(Index n) {
  const auto value = static_cast<std::uint64_t>(n);
  if (std::has_single_bit(value)) return;
  throw Error(
      Fault::kArgument, "n",
      sentence(17, "n is ", n, "; a Sobol' sequence is balanced for powers of two only: take ",
               std::bit_floor(value), " or ", std::bit_ceil(value), ", or another sampler"));
}

// Where b may fall so that it is at least `guard` away from a: v in (0, 1) over what is left.
double guarded_step(double a, double v, double guard) {
  const double below = std::max(0.0, a - guard);
  const double above = std::max(0.0, 1.0 - guard - a);
  const double at = v * (below + above);
  return at < below ? at : std::min(a + guard + (at - below), 1.0 - 0x1.0p-53);
}

}  // namespace

Sampling::Sampling(const SamplingSpec& spec, Empty) : spec_(spec) {
  require(spec.factors >= 1, "factors", "a study needs at least one factor");
  require(spec.n >= 1, "n", "n must be at least 1");
  require(spec.replicates >= 1 && spec.replicates < 65536, "replicates",
          "replicates must be from 1 to 65535");
  require(spec.guard >= 0.0 && spec.guard < 0.5, "guard",
          "guard must be at least 0 and below 0.5, a share of a factor's probability");
  group_of_ = spec.group_of;
  if (group_of_.empty()) {
    group_of_.resize(static_cast<std::size_t>(spec.factors));
    std::iota(group_of_.begin(), group_of_.end(), Index{0});
  }
  require(static_cast<Index>(group_of_.size()) == spec.factors, "groups",
          "groups must name one group for each factor");
  groups_ = *std::max_element(group_of_.begin(), group_of_.end()) + 1;
  for (Index g = 0; g < groups_; ++g) {
    require(std::find(group_of_.begin(), group_of_.end(), g) != group_of_.end(), "groups",
            "group " + std::to_string(g) + " has no factor");
  }
  require(*std::min_element(group_of_.begin(), group_of_.end()) >= 0, "groups",
          "groups are numbered from 0");
  require(!spec.second_order || (spec.scheme == Scheme::kSaltelli && groups_ >= 2), "second_order",
          "second-order indices need a saltelli design of at least two factors or groups");
  switch (spec.scheme) {
    case Scheme::kSample:
      dimensions_ = spec.factors;
      break;
    case Scheme::kSaltelli:
      block_rows_ = (spec.second_order ? 2 * groups_ : groups_) + 2;
      dimensions_ = 2 * spec.factors;
      break;
    case Scheme::kRadial:
      block_rows_ = groups_ + 1;
      dimensions_ = 2 * spec.factors;
      break;
    case Scheme::kTrajectories:
      block_rows_ = groups_ + 1;
      require(spec.levels >= 2 && spec.levels % 2 == 0 && spec.levels <= 1000, "levels",
              "levels must be an even number from 2 to 1000");
      break;
  }
  require(spec.n <= kMaxSampledRows / block_rows_ / spec.replicates, "n",
          "a design has at most 2^40 rows");
}

Sampling Sampling::layout(const SamplingSpec& spec) {
  Sampling out(spec, Empty{});
  out.has_points_ = false;
  return out;
}

Sampling::Sampling(const SamplingSpec& spec, PointRows points) : Sampling(spec, Empty{}) {
  require(points.cols() == spec.factors, "points",
          sentence(17, "points must have a column for each of the ", spec.factors, " factors, got ",
                   points.cols()));
  require(points.rows() == rows(), "points",
          sentence(17, "points must have ", rows(), " rows, ", block_rows_, " a block, got ",
                   points.rows()));
  require((points.array() >= 0.0).all() && (points.array() <= 1.0).all(), "points",
          "points must lie in the unit cube");
  points_ = std::make_shared<const PointRows>(std::move(points));
  check_points();
}

Sampling::Sampling(const SamplingSpec& spec, Token* token) : Sampling(spec, Empty{}) {
  if (spec.sampler == Sampler::kSobol && spec.scheme != Scheme::kTrajectories) {
    check_power_of_two(spec.n);
  }
  require(spec.sampler != Sampler::kPooledLatin || spec.scheme == Scheme::kSaltelli ||
              spec.scheme == Scheme::kRadial,
          "sampler", "a pooled latin hypercube makes saltelli and radial designs only");
  require(
      spec.sampler != Sampler::kPooledLatin || spec.scheme != Scheme::kRadial || spec.guard == 0.0,
      "guard",
      "consecutive rows of a pooled latin hypercube have no smallest step: leave out guard, or "
      "take another sampler");
  require(spec.candidates >= 1, "candidates", "candidates must be at least 1");
  require(spec.candidates == 1 || (spec.sampler == Sampler::kLatin && spec.n <= kMaximinRows),
          "candidates",
          sentence(17, "maximin designs are latin hypercubes of at most ", kMaximinRows, " rows"));
  candidate_.assign(static_cast<std::size_t>(spec.replicates), 0);
  if (spec.scheme == Scheme::kTrajectories) return;
  if (spec.candidates > 1) choose_candidate(token);
  for (Index r = 0; r < spec.replicates; ++r) make_base(r);
}

bool Sampling::independent_steps() const noexcept {
  if (spec_.scheme == Scheme::kSaltelli) return true;
  return spec_.scheme == Scheme::kRadial && spec_.guard == 0.0;
}

Index Sampling::stratified_coordinates() const noexcept {
  const bool latin = spec_.sampler == Sampler::kLatin || spec_.sampler == Sampler::kPooledLatin;
  const bool made = has_points_ && !points_ && spec_.scheme != Scheme::kTrajectories;
  return latin && made ? dimensions_ : 0;
}

void Sampling::fill_strata(Index first, Eigen::Ref<PointRows> out) const {
  for (Index done = 0; done < out.rows();) {
    const Index block = first + done;
    const Index begin = block % spec_.n;
    const Index count = std::min(out.rows() - done, spec_.n - begin);
    fill_base(block / spec_.n, begin, out.middleRows(done, count));
    done += count;
  }
}

void Sampling::make_base(Index replicate) {
  const auto r = static_cast<std::uint64_t>(replicate);
  if (spec_.sampler == Sampler::kSobol) {
    sequences_.emplace_back(dimensions_, spec_.seed, r);
  } else if (spec_.sampler != Sampler::kMonteCarlo) {
    const bool pooled = spec_.sampler == Sampler::kPooledLatin;
    const Index columns = pooled ? spec_.factors : dimensions_;
    const Index strata = pooled ? 2 * spec_.n : spec_.n;
    const Index candidate = candidate_[static_cast<std::size_t>(replicate)];
    std::vector<Permutation> orders;
    orders.reserve(static_cast<std::size_t>(columns));
    for (Index d = 0; d < columns; ++d) {
      orders.emplace_back(strata, random_of(spec_.seed, Use::kOrder, r,
                                            static_cast<std::uint64_t>(candidate << 16 | d)));
    }
    if (static_cast<Index>(orders_.size()) <= replicate) orders_.emplace_back();
    orders_[static_cast<std::size_t>(replicate)] = std::move(orders);
  }
}

// Morris and Mitchell 1995: the Latin hypercube, of those drawn, whose two closest points are the
// farthest apart.
void Sampling::choose_candidate(Token* token) {
  PointRows points(spec_.n, dimensions_);
  const double work = static_cast<double>(spec_.replicates * spec_.candidates);
  for (Index r = 0; r < spec_.replicates; ++r) {
    Index& chosen = candidate_[static_cast<std::size_t>(r)];
    double best = -1.0;
    Index best_candidate = 0;
    for (Index c = 0; c < spec_.candidates; ++c) {
      chosen = c;
      make_base(r);
      fill_latin(r, 0, spec_.n, points);
      double closest = std::numeric_limits<double>::infinity();
      for (Index i = 1; i < spec_.n; ++i) {
        if (i % 256 == 0) {
          step(token, static_cast<double>(r * spec_.candidates + c) / work);
        }
        for (Index j = 0; j < i; ++j) {
          closest = std::min(closest, (points.row(i) - points.row(j)).squaredNorm());
        }
      }
      if (closest > best) {
        best = closest;
        best_candidate = c;
      }
    }
    chosen = best_candidate;
  }
  orders_.clear();
}

void Sampling::fill_latin(Index replicate, Index first, Index strata,
                          Eigen::Ref<PointRows> out) const {
  const auto& orders = orders_[static_cast<std::size_t>(replicate)];
  const double width = 1.0 / static_cast<double>(strata);
  const auto candidate =
      static_cast<std::uint64_t>(candidate_[static_cast<std::size_t>(replicate)]);
  for (Index i = 0; i < out.rows(); ++i) {
    Random random = random_of(spec_.seed, Use::kPoint, static_cast<std::uint64_t>(replicate),
                              candidate << 28 ^ static_cast<std::uint64_t>(first + i));
    for (Index d = 0; d < out.cols(); ++d) {
      const auto stratum = static_cast<double>(orders[static_cast<std::size_t>(d)](first + i));
      out(i, d) = std::min((stratum + random.uniform()) * width, 1.0 - 0x1.0p-53);
    }
  }
}

void Sampling::fill_base(Index replicate, Index first, Eigen::Ref<PointRows> out) const {
  const Index factors = spec_.factors;
  switch (spec_.sampler) {
    case Sampler::kSobol:
      sequences_[static_cast<std::size_t>(replicate)].fill(first, out);
      return;
    case Sampler::kLatin:
      fill_latin(replicate, first, spec_.n, out);
      return;
    case Sampler::kMonteCarlo:
      for (Index i = 0; i < out.rows(); ++i) {
        Random random = random_of(spec_.seed, Use::kPoint, static_cast<std::uint64_t>(replicate),
                                  static_cast<std::uint64_t>(first + i));
        for (Index d = 0; d < out.cols(); ++d) {
          out(i, d) = std::min(random.uniform(), 1.0 - 0x1.0p-53);
        }
      }
      return;
    case Sampler::kPooledLatin:
      if (spec_.scheme == Scheme::kRadial) {
        PointRows pairs(2 * out.rows(), factors);
        fill_latin(replicate, 2 * first, 2 * spec_.n, pairs);
        for (Index i = 0; i < out.rows(); ++i) {
          out.row(i).head(factors) = pairs.row(2 * i);
          out.row(i).tail(factors) = pairs.row(2 * i + 1);
        }
      } else {
        PointRows half(out.rows(), factors);
        fill_latin(replicate, first, 2 * spec_.n, half);
        out.leftCols(factors) = half;
        fill_latin(replicate, spec_.n + first, 2 * spec_.n, half);
        out.rightCols(factors) = half;
      }
      return;
  }
}

void Sampling::fill_trajectories(Index replicate, Index first, Index count, double* out) const {
  const Index factors = spec_.factors;
  const double top = static_cast<double>(spec_.levels - 1);
  std::vector<Index> level(static_cast<std::size_t>(factors));
  std::vector<Index> order(static_cast<std::size_t>(groups_));
  for (Index b = 0; b < count; ++b) {
    Random random = random_of(spec_.seed, Use::kTrajectory, static_cast<std::uint64_t>(replicate),
                              static_cast<std::uint64_t>(first + b));
    for (Index& l : level) l = random.below(spec_.levels);
    std::iota(order.begin(), order.end(), Index{0});
    for (Index i = groups_ - 1; i > 0; --i) {
      std::swap(order[static_cast<std::size_t>(i)],
                order[static_cast<std::size_t>(random.below(i + 1))]);
    }
    for (Index row = 0; row <= groups_; ++row) {
      if (row > 0) {
        for (Index k = 0; k < factors; ++k) {
          const auto at = static_cast<std::size_t>(k);
          if (group_of_[at] != order[static_cast<std::size_t>(row - 1)]) continue;
          // Half of the levels away there is one level only, up or down.
          level[at] += level[at] < spec_.levels / 2 ? spec_.levels / 2 : -spec_.levels / 2;
        }
      }
      for (Index k = 0; k < factors; ++k) {
        *out++ = static_cast<double>(level[static_cast<std::size_t>(k)]) / top;
      }
    }
  }
}

void Sampling::fill_blocks(Index replicate, Index first, Index count, double* out) const {
  if (spec_.scheme == Scheme::kTrajectories) {
    fill_trajectories(replicate, first, count, out);
    return;
  }
  const Index factors = spec_.factors;
  PointRows base(count, dimensions_);
  fill_base(replicate, first, base);
  if (spec_.scheme == Scheme::kRadial && spec_.guard > 0.0) {
    for (Index b = 0; b < count; ++b) {
      for (Index k = 0; k < factors; ++k) {
        base(b, factors + k) = guarded_step(base(b, k), base(b, factors + k), spec_.guard);
      }
    }
  }
  const auto put = [&](const double* from, const double* other, Index group) {
    for (Index k = 0; k < factors; ++k) {
      *out++ = group_of_[static_cast<std::size_t>(k)] == group ? other[k] : from[k];
    }
  };
  for (Index b = 0; b < count; ++b) {
    const double* one = base.data() + b * dimensions_;
    const double* two = one + factors;
    put(one, one, -1);
    if (spec_.scheme == Scheme::kSample) continue;
    for (Index g = 0; g < groups_; ++g) put(one, two, g);
    if (spec_.scheme != Scheme::kSaltelli) continue;
    if (spec_.second_order) {
      for (Index g = 0; g < groups_; ++g) put(two, one, g);
    }
    put(two, two, -1);
  }
}

void Sampling::fill(Index first, Eigen::Ref<PointRows> out) const {
  require(has_points_, "sampling", "the points of these outputs were not given");
  require(first >= 0 && first + out.rows() <= rows(), "rows",
          sentence(17, "rows must be from 0 to ", rows() - 1));
  require(out.cols() == spec_.factors, "out", "out must have a column for each factor");
  if (points_) {
    out = points_->middleRows(first, out.rows());
    return;
  }
  // Whole blocks, as many as cover the rows, never more at once than keep the memory bounded.
  const Index at_once = std::max<Index>(1, kNumbersAtOnce / (block_rows_ * spec_.factors));
  PointRows blocks;
  Index done = 0;
  while (done < out.rows()) {
    const Index row = first + done;
    const Index block = row / block_rows_;
    const Index replicate = block / spec_.n;
    const Index begin = block % spec_.n;
    const Index skip = row % block_rows_;
    const Index wanted = (skip + out.rows() - done + block_rows_ - 1) / block_rows_;
    const Index count = std::min({wanted, spec_.n - begin, at_once});
    blocks.resize(count * block_rows_, spec_.factors);
    fill_blocks(replicate, begin, count, blocks.data());
    const Index take = std::min(count * block_rows_ - skip, out.rows() - done);
    out.middleRows(done, take) = blocks.middleRows(skip, take);
    done += take;
  }
}

void Sampling::check_points() const {
  if (spec_.scheme != Scheme::kRadial && spec_.scheme != Scheme::kTrajectories) return;
  std::vector<bool> moved(static_cast<std::size_t>(groups_));
  for (Index block = 0; block < blocks(); ++block) {
    std::fill(moved.begin(), moved.end(), false);
    for (Index row = 1; row < block_rows_; ++row) {
      const Index now = block * block_rows_ + row;
      const Index before = spec_.scheme == Scheme::kRadial ? block * block_rows_ : now - 1;
      Index group = -1;
      bool several = false;
      for (Index k = 0; k < spec_.factors; ++k) {
        if ((*points_)(now, k) == (*points_)(before, k)) continue;
        const Index own = group_of_[static_cast<std::size_t>(k)];
        several = several || (group >= 0 && group != own);
        group = own;
      }
      if (group < 0 || several || moved[static_cast<std::size_t>(group)]) {
        throw Error(Fault::kData, "points",
                    sentence(17, "row ", now, " of the points must move one factor or group that ",
                             "its block has not moved yet"),
                    sentence(17, "row ", now));
      }
      moved[static_cast<std::size_t>(group)] = true;
    }
  }
}

}  // namespace ulna
