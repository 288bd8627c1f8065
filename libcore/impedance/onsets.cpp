#include "impedance/onsets.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

constexpr double kShare = 1e-3;      // of the signal's range
constexpr double kDeviations = 6.0;  // of its rest

// Distance from the rest before, over all axes.
double distance(const Record& record, const std::vector<Index>& channels, Index row,
                const Vector& rest) {
  double sum = 0.0;
  for (std::size_t k = 0; k < channels.size(); ++k) {
    const double d = record.values()(row, channels[k]) - rest[static_cast<Index>(k)];
    sum += d * d;
  }
  return std::sqrt(sum);
}

struct Rest {
  Vector mean;
  double deviation = 0.0;
};

Rest rest_of(const Record& record, const std::vector<Index>& channels, Index first, Index count) {
  Rest out;
  out.mean.resize(static_cast<Index>(channels.size()));
  for (std::size_t k = 0; k < channels.size(); ++k) {
    out.mean[static_cast<Index>(k)] = record.column(channels[k]).segment(first, count).mean();
  }
  double squares = 0.0;
  for (Index row = first; row < first + count; ++row) {
    const double d = distance(record, channels, row, out.mean);
    squares += d * d;
  }
  out.deviation = std::sqrt(squares / static_cast<double>(count));
  return out;
}

double range_of(const Record& record, const std::vector<Index>& channels, Index first, Index last) {
  double widest = 0.0;
  for (const Index c : channels) {
    const auto values = record.column(c).segment(first, last - first);
    widest = std::max(widest, values.maxCoeff() - values.minCoeff());
  }
  return widest;
}

// First row that left the rest for good before `row`, which has left it for certain: a motion
// begins slowly, and a thousandth of its range is milliseconds after its start.
Index start_of(const Record& record, const std::vector<Index>& channels, Index row, Index rest,
               Index begin, double range) {
  const Index first = std::max(begin, row - rest);
  const Index half = std::max<Index>(1, (row - first) / 2);
  const Rest still = rest_of(record, channels, first, half);
  const double near = std::max(1e-6 * range, 3.0 * still.deviation);
  Index start = row;
  while (start > first + half && distance(record, channels, start - 1, still.mean) > near) --start;
  return start;
}

Index rows_for(double seconds, double rate) {
  return std::max<Index>(2, static_cast<Index>(std::lround(seconds * rate)));
}

}  // namespace

std::vector<Onset> given_onsets(const Record& record, const std::vector<double>& times_s,
                                double rest_s, double longest_s) {
  std::vector<Onset> out;
  const double rate = record.rate_hz();
  const Index rest = rows_for(rest_s, rate);
  const Index longest = rows_for(longest_s, rate);
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const double time = times_s[i];
    const std::string which = "onset " + std::to_string(i);
    require(std::isfinite(time), "onsets_s", which + " is no number");
    require(i == 0 || time > times_s[i - 1], "onsets_s",
            which + " does not lie after the one before: give onsets in order");
    bool found = false;
    for (std::size_t t = 0; t < record.trials().size() && !found; ++t) {
      const Trial& trial = record.trials()[t];
      const double* clock = record.time().data();
      const double slack = 0.5 / rate;
      if (time < clock[trial.begin] - slack || time > clock[trial.end - 1] + slack) continue;
      const double* place = std::lower_bound(clock + trial.begin, clock + trial.end, time - slack);
      const Index row = std::min<Index>(place - clock, trial.end - 1);
      out.push_back({static_cast<int>(t), row, std::min(trial.end, row + longest)});
      found = true;
    }
    if (!found) {
      throw Error(Fault::kArgument, "onsets_s",
                  sentence(6, which, " at ", time, " s lies outside of the record"));
    }
    if (i > 0 && out[i - 1].trial == out[i].trial) {
      out[i - 1].end = std::min(out[i - 1].end, out[i].row - rest);
    }
  }
  return out;
}

std::vector<Onset> find_onsets(const Record& record, const Roles& roles, double rest_s,
                               double longest_s) {
  const double rate = record.rate_hz();
  const Index rest = rows_for(rest_s, rate);
  const Index longest = rows_for(longest_s, rate);
  const std::vector<Index>& channels = roles.reference.empty() ? roles.position : roles.reference;
  std::vector<Onset> out;
  const bool segmented = record.segments().size() > record.trials().size();
  if (segmented) {
    for (const Segment& segment : record.segments()) {
      // The segment itself begins before the onset, or at it: then the rest is what is before.
      const Index trial_begin = record.trials()[static_cast<std::size_t>(segment.trial)].begin;
      const Index first = std::max(trial_begin, segment.begin - rest);
      if (segment.end - first < 2 * rest) continue;
      const Rest still = rest_of(record, channels, first, rest);
      const double range = range_of(record, channels, first, segment.end);
      const double away = std::max(kShare * range, kDeviations * still.deviation);
      for (Index row = first + rest; row < segment.end; ++row) {
        if (distance(record, channels, row, still.mean) <= away) continue;
        const Index start = start_of(record, channels, row, rest, first, range);
        out.push_back({segment.trial, start, std::min(segment.end, start + longest)});
        break;
      }
    }
  } else {
    if (roles.reference.empty()) {
      throw Error(Fault::kData, "onsets_s",
                  "the record has neither segments nor a reference to find the perturbations from: "
                  "give their onsets");
    }
    for (std::size_t t = 0; t < record.trials().size(); ++t) {
      const Trial& trial = record.trials()[t];
      const double range = range_of(record, channels, trial.begin, trial.end);
      if (!(range > 0.0)) continue;
      Index still = trial.begin;  // first row of the present rest
      Vector level(static_cast<Index>(channels.size()));
      const auto settle = [&](Index row) {
        still = row;
        for (std::size_t k = 0; k < channels.size(); ++k) {
          level[static_cast<Index>(k)] = record.values()(row, channels[k]);
        }
      };
      settle(trial.begin);
      for (Index row = trial.begin + 1; row < trial.end; ++row) {
        if (distance(record, channels, row, level) <= kShare * range) continue;
        if (row - still >= rest) {
          if (!out.empty() && out.back().trial == static_cast<int>(t)) {
            out.back().end = std::min(out.back().end, row - rest);
          }
          const Index start = start_of(record, channels, row, rest, trial.begin, range);
          out.push_back({static_cast<int>(t), start, std::min(trial.end, start + longest)});
        }
        settle(row);
      }
    }
  }
  if (out.empty()) {
    throw Error(Fault::kData, "onsets_s",
                "no perturbation leaves a rest of " + std::to_string(rest) +
                    " samples: give the onsets, or a shorter baseline_s");
  }
  return out;
}

}  // namespace ulna
