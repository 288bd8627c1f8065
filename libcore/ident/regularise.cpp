#include "ident/regularise.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/error.hpp"
#include "signal/resample.hpp"

namespace ulna {
namespace {

// The new row of an old row, for segments.
Index nearest_row(const std::vector<double>& time, Index begin, Index end, double t) {
  const auto first = time.begin() + begin;
  const auto last = time.begin() + end;
  auto after = std::lower_bound(first, last, t);
  if (after == last) return end - 1;
  if (after != first && t - *(after - 1) < *after - t) --after;
  return after - time.begin();
}

void check_complete(const Record& record, Index channel, const Trial& trial) {
  for (Index i = trial.begin; i < trial.end; ++i) {
    if (std::isfinite(record.values()(i, channel))) continue;
    const std::string& name = record.channels()[static_cast<std::size_t>(channel)].name;
    throw Error(Fault::kData, "record",
                "channel \"" + name + "\" has a missing value at row " + std::to_string(i) +
                    ": split the record there before its clock is made even",
                "row " + std::to_string(i));
  }
}

}  // namespace

Record regularise(const Record& record, double rate_hz, Token* token) {
  require(std::isfinite(rate_hz) && rate_hz >= 0.0, "rate_hz",
          "rate_hz must be positive, or 0 for the record's own rate");
  const double rate = rate_hz > 0.0 ? rate_hz : record.rate_hz();
  std::vector<Index> smooth;
  for (Index c = 0; c < record.channel_count(); ++c) {
    if (record.channels()[static_cast<std::size_t>(c)].role != Role::kOther) smooth.push_back(c);
  }
  require(rate <= 100.0 * record.rate_hz(), "rate_hz",
          "the new rate may be at most a hundred times the record's");
  Record::Parts parts;
  std::vector<Index> rows;
  Index total = 0;
  for (const Trial& trial : record.trials()) {
    const double span = record.time()[static_cast<std::size_t>(trial.end - 1)] -
                        record.time()[static_cast<std::size_t>(trial.begin)];
    // The small excess keeps the last stamp when only its rounding falls short of the grid.
    rows.push_back(static_cast<Index>(std::floor(span * rate + 1e-6)) + 1);
    parts.trials.push_back({total, total + rows.back()});
    total += rows.back();
  }
  parts.values.resize(total, record.channel_count());
  parts.time.resize(static_cast<std::size_t>(total));
  for (std::size_t t = 0; t < rows.size(); ++t) {
    step(token, static_cast<double>(t) / static_cast<double>(rows.size()));
    const Trial& from = record.trials()[t];
    const Index at = parts.trials[t].begin;
    const Index size = from.end - from.begin;
    const Eigen::Map<const Vector> times(record.time().data() + from.begin, size);
    for (Index k = 0; k < rows[t]; ++k) {
      parts.time[static_cast<std::size_t>(at + k)] = times[0] + static_cast<double>(k) / rate;
      const Index near = nearest_row(record.time(), from.begin, from.end,
                                     parts.time[static_cast<std::size_t>(at + k)]);
      parts.values.row(at + k) = record.values().row(near);
    }
    for (const Index c : smooth) check_complete(record, c, from);
    if (smooth.empty() || size < 2) continue;
    Matrix columns(size, static_cast<Index>(smooth.size()));
    for (std::size_t k = 0; k < smooth.size(); ++k) {
      columns.col(static_cast<Index>(k)) = record.values().col(smooth[k]).segment(from.begin, size);
    }
    // The grid must end within the stamps; its last point may lie beyond by rounding only.
    const double reach = (times[size - 1] - times[0]) * rate;
    const Index inside = static_cast<Index>(std::floor(reach)) + 1;
    const Index n = std::min(rows[t], inside);
    const Matrix even = resample_columns(times, columns, times[0], rate, n);
    for (std::size_t k = 0; k < smooth.size(); ++k) {
      parts.values.col(smooth[k]).segment(at, n) = even.col(static_cast<Index>(k));
    }
  }
  for (const Segment& s : record.segments()) {
    const Trial& from = record.trials()[static_cast<std::size_t>(s.trial)];
    const Trial& to = parts.trials[static_cast<std::size_t>(s.trial)];
    const double t0 = record.time()[static_cast<std::size_t>(from.begin)];
    const auto moved = [&](Index row) {
      const double seconds = record.time()[static_cast<std::size_t>(row)] - t0;
      return std::clamp(to.begin + static_cast<Index>(std::llround(seconds * rate)), to.begin,
                        to.end);
    };
    const Index begin = std::min(moved(s.begin), to.end - 1);
    const Index end = s.end == from.end ? to.end : moved(s.end);
    parts.segments.push_back({begin, std::max(end, begin + 1), s.trial});
  }
  parts.channels = record.channels();
  parts.rate_hz = rate;
  parts.provenance = record.provenance();
  std::ostringstream line;
  line << "resampled band-limited to an even clock of " << rate << " Hz";
  parts.provenance.push_back(line.str());
  return Record::make(std::move(parts));
}

}  // namespace ulna
