#include "impedance/split.hpp"

#include <algorithm>
#include <cmath>

namespace ulna {
namespace {

constexpr double kDefaultTrainS = 40.0;
constexpr double kDefaultTrainShare = 0.8;

}  // namespace

Split split_rows(const Record& record, const Prepared& prepared, double train_s) {
  Split split;
  const double rate = record.rate_hz();
  for (std::size_t t = 0; t < prepared.trials.size(); ++t) {
    const PreparedTrial& trial = prepared.trials[t];
    const Trial& rows = record.trials()[t];
    std::vector<Segment> segments;
    for (const Segment& segment : record.segments()) {
      if (segment.trial == static_cast<int>(t)) segments.push_back(segment);
    }
    const auto add = [&](std::vector<Span>& list, Index begin, Index end) {
      begin = std::max<Index>(begin - trial.begin(), 0);
      end = std::min(end - trial.begin(), trial.rows());
      if (begin < end) list.push_back({static_cast<int>(t), begin, end});
    };
    if (segments.size() > 1 && train_s == 0.0) {
      split.segmented = true;
      const std::size_t first = (segments.size() + 1) / 2;
      for (std::size_t s = 0; s < segments.size(); ++s) {
        add(s < first ? split.train : split.held_out, segments[s].begin, segments[s].end);
      }
    } else {
      // Time counts from the first row in use.
      const Index first = segments.empty() ? rows.begin : segments.front().begin;
      const Index last = segments.empty() ? rows.end : segments.back().end;
      const double duration = static_cast<double>(last - first) / rate;
      const double wanted = train_s > 0.0 ? std::min(train_s, duration)
                                          : std::min(kDefaultTrainS, kDefaultTrainShare * duration);
      const Index border = first + static_cast<Index>(std::lround(wanted * rate));
      for (const Segment& segment : segments) {
        add(split.train, segment.begin, std::min(segment.end, border));
        add(split.held_out, std::max(segment.begin, border), segment.end);
      }
      split.train_s = std::max(split.train_s, wanted);
    }
  }
  split.all = split.train;
  split.all.insert(split.all.end(), split.held_out.begin(), split.held_out.end());
  std::stable_sort(split.all.begin(), split.all.end(), [](const Span& a, const Span& b) {
    return a.trial != b.trial ? a.trial < b.trial : a.begin < b.begin;
  });
  return split;
}

std::vector<Span> cut(const std::vector<Span>& spans, Index rows) {
  std::vector<Span> pieces;
  for (const Span& span : spans) {
    const Index length = span.end - span.begin;
    const Index count = std::max<Index>(1, length / std::max<Index>(1, rows));
    for (Index i = 0; i < count; ++i) {
      pieces.push_back(
          {span.trial, span.begin + length * i / count, span.begin + length * (i + 1) / count});
    }
  }
  return pieces;
}

}  // namespace ulna
