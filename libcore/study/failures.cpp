#include "study/failures.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "base/error.hpp"
#include "base/words.hpp"
#include "study/surface.hpp"

namespace ulna {
namespace {

// Points of all rows, for distances: only made when something failed.
PointRows all_points(const Sampling& sampling, const char* what) {
  require(sampling.has_points(), "on_failure",
          std::string("on_failure ") + what +
              " needs the points of the runs, and only their outputs were given: use drop_block");
  PointRows points(sampling.rows(), sampling.spec().factors);
  sampling.fill(0, points);
  return points;
}

void take_nearest(const Sampling& sampling, Outputs& outputs, Token* token) {
  const PointRows points = all_points(sampling, "nearest");
  // In the order of the first coordinate: the search widens from a failure's own place and stops
  // where that coordinate alone is farther than the best so far.
  std::vector<Index> good;
  for (Index i = 0; i < points.rows(); ++i) {
    if (!outputs.failed[static_cast<std::size_t>(i)]) good.push_back(i);
  }
  std::sort(good.begin(), good.end(), [&](Index a, Index b) {
    return points(a, 0) != points(b, 0) ? points(a, 0) < points(b, 0) : a < b;
  });
  Vector filled = outputs.y;
  Index done = 0;
  for (Index i = 0; i < points.rows(); ++i) {
    if (!outputs.failed[static_cast<std::size_t>(i)]) continue;
    step(token, static_cast<double>(done++) / static_cast<double>(outputs.report.rows));
    double best = std::numeric_limits<double>::infinity();
    Index nearest = -1;
    const auto look = [&](Index at) {
      const double along = points(at, 0) - points(i, 0);
      if (along * along > best) return false;
      const double distance = (points.row(at) - points.row(i)).squaredNorm();
      if (distance < best || (distance == best && at < nearest)) {
        best = distance;
        nearest = at;
      }
      return true;
    };
    const auto middle =
        std::lower_bound(good.begin(), good.end(), points(i, 0),
                         [&](Index at, double value) { return points(at, 0) < value; });
    auto up = middle;
    auto down = middle;
    bool more_up = true;
    bool more_down = true;
    while (more_up || more_down) {
      more_up = more_up && up != good.end() && look(*up++);
      more_down = more_down && down != good.begin() && look(*--down);
    }
    filled[i] = outputs.y[nearest];
  }
  outputs.y = std::move(filled);
}

void take_surface(const Sampling& sampling, std::uint64_t seed, Outputs& outputs, Token* token) {
  const PointRows points = all_points(sampling, "surface");
  const Surface surface = fit_surface(points, outputs.y, outputs.failed, seed, token);
  for (Index i = 0; i < points.rows(); ++i) {
    if (outputs.failed[static_cast<std::size_t>(i)]) {
      const Vector point = points.row(i).transpose();
      outputs.y[i] = surface.value(point);
    }
  }
  outputs.report.surface_r2 = surface.validation_r2;
  outputs.report.surface_terms = surface.coefficients.size();
}

}  // namespace

std::vector<Index> compared_rows(const Sampling& sampling) {
  std::vector<Index> out(static_cast<std::size_t>(sampling.block_rows()), 0);
  out[0] = -1;
  const Index groups = sampling.groups();
  const Index last = sampling.block_rows() - 1;
  switch (sampling.spec().scheme) {
    case Scheme::kSample:
    case Scheme::kRadial:
      break;
    case Scheme::kSaltelli:
      for (Index row = groups + 1; row < last; ++row) out[static_cast<std::size_t>(row)] = last;
      out[static_cast<std::size_t>(last)] = -1;
      break;
    case Scheme::kTrajectories:
      for (Index row = 1; row <= last; ++row) out[static_cast<std::size_t>(row)] = row - 1;
      break;
  }
  return out;
}

std::vector<Index> moved_groups(const Sampling& sampling, Index block) {
  const Index groups = sampling.groups();
  std::vector<Index> out(static_cast<std::size_t>(sampling.block_rows()), -1);
  const Scheme scheme = sampling.spec().scheme;
  if (scheme == Scheme::kSaltelli) {
    for (Index row = 1; row + 1 < sampling.block_rows(); ++row) {
      out[static_cast<std::size_t>(row)] = (row - 1) % groups;
    }
  } else if (scheme != Scheme::kSample) {
    PointRows points(sampling.block_rows(), sampling.spec().factors);
    sampling.fill(block * sampling.block_rows(), points);
    const std::vector<Index>& own = sampling.spec().group_of;
    for (Index row = 1; row < points.rows(); ++row) {
      const Index before = scheme == Scheme::kRadial ? 0 : row - 1;
      for (Index k = 0; k < points.cols(); ++k) {
        if (points(row, k) != points(before, k)) {
          out[static_cast<std::size_t>(row)] = own.empty() ? k : own[static_cast<std::size_t>(k)];
        }
      }
    }
  }
  return out;
}

Outputs look_at_outputs(const Sampling& sampling, const VectorRef& y,
                        const std::vector<std::int32_t>& status) {
  require(y.size() == sampling.rows(), "y",
          sentence(17, "y must hold one output for each of the ", sampling.rows(),
                   " runs of the design (", sampling.blocks(), " blocks of ", sampling.block_rows(),
                   "), got ", y.size()));
  require(status.empty() || static_cast<Index>(status.size()) == y.size(), "status",
          "status must hold one number a run");
  Outputs out;
  out.y = y;
  out.failed.assign(static_cast<std::size_t>(y.size()), false);
  FailureReport& report = out.report;
  for (Index i = 0; i < y.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const std::int32_t code = status.empty() ? 0 : status[at];
    require(code >= 0 && code < 1024, "status",
            sentence(17, "status must be from 0 to 1023; that of run ", i, " is ", code));
    if (code == 0 && std::isfinite(y[i])) continue;
    out.failed[at] = true;
    ++report.rows;
    if (report.by_status.size() <= static_cast<std::size_t>(code)) {
      report.by_status.resize(static_cast<std::size_t>(code) + 1, 0);
    }
    ++report.by_status[static_cast<std::size_t>(code)];
  }
  report.by_group.assign(static_cast<std::size_t>(sampling.groups()), 0);
  report.flip_share = Vector::Zero(sampling.groups());
  if (report.rows == 0) return out;
  const Index block_rows = sampling.block_rows();
  const std::vector<Index> compared = compared_rows(sampling);
  std::vector<Index> steps(static_cast<std::size_t>(sampling.groups()), 0);
  // Without points, which group a row of a radial design or trajectory moves is not known.
  const bool known = sampling.has_points() || sampling.spec().scheme == Scheme::kSaltelli;
  for (Index block = 0; block < sampling.blocks(); ++block) {
    bool any = false;
    for (Index row = 0; row < block_rows; ++row) {
      any = any || out.failed[static_cast<std::size_t>(block * block_rows + row)];
    }
    if (any) ++report.blocks;
    if (!known) continue;
    const std::vector<Index> moved = moved_groups(sampling, block);
    for (Index row = 0; row < block_rows; ++row) {
      const bool failed = out.failed[static_cast<std::size_t>(block * block_rows + row)];
      const Index group = moved[static_cast<std::size_t>(row)];
      if (group < 0) {
        if (failed) ++report.base;
        continue;
      }
      if (failed) ++report.by_group[static_cast<std::size_t>(group)];
      ++steps[static_cast<std::size_t>(group)];
      const Index before = block * block_rows + compared[static_cast<std::size_t>(row)];
      if (failed != out.failed[static_cast<std::size_t>(before)]) report.flip_share[group] += 1.0;
    }
  }
  for (Index g = 0; g < sampling.groups(); ++g) {
    const Index count = steps[static_cast<std::size_t>(g)];
    if (count > 0) report.flip_share[g] /= static_cast<double>(count);
  }
  return out;
}

void treat_failures(const Sampling& sampling, OnFailure on_failure, std::uint64_t seed,
                    Outputs& outputs, Token* token) {
  const FailureReport& report = outputs.report;
  if (report.rows == 0) return;
  const auto first = std::find(outputs.failed.begin(), outputs.failed.end(), true);
  const Index row = static_cast<Index>(first - outputs.failed.begin());
  if (report.rows == sampling.rows()) {
    throw Error(Fault::kData, "y", "every run failed: there is nothing to analyse");
  }
  switch (on_failure) {
    case OnFailure::kError:
      throw Error(
          Fault::kData, "y",
          sentence(17, report.rows, " of ", sampling.rows(), " runs failed, the first is ", "run ",
                   row, ": repair them, or choose on_failure drop_block, nearest ", "or surface"),
          sentence(17, "row ", row));
    case OnFailure::kDropBlock:
      if (sampling.blocks() - report.blocks < 2) {
        throw Error(Fault::kData, "on_failure",
                    sentence(17, "dropping the ", report.blocks,
                             " blocks that hold a failed run leaves fewer than two of ",
                             sampling.blocks(), ": use nearest or surface"));
      }
      return;
    case OnFailure::kNearest:
      take_nearest(sampling, outputs, token);
      break;
    case OnFailure::kSurface:
      take_surface(sampling, seed, outputs, token);
      break;
  }
  outputs.failed.assign(outputs.failed.size(), false);
}

}  // namespace ulna
