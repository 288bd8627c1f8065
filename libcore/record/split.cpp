#include "record/split.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace ulna {
namespace {

bool row_is_complete(const Record& record, const std::vector<Index>& used, Index row) {
  return std::all_of(used.begin(), used.end(),
                     [&](Index c) { return std::isfinite(record.values()(row, c)); });
}

// Segments cut to rows [begin, end) and moved to where these rows go.
void add_segments(const Record& record, int trial, Index begin, Index end, Index offset,
                  int new_trial, std::vector<Segment>& out) {
  for (const Segment& s : record.segments()) {
    if (s.trial != trial) continue;
    const Index b = std::max(s.begin, begin), e = std::min(s.end, end);
    if (e > b) out.push_back({b + offset, e + offset, new_trial});
  }
}

// The rows of some pieces of trials, one after another.
struct Piece {
  Index begin = 0;
  Index end = 0;
  int trial = 0;
};

Record gather(const Record& record, const std::vector<Piece>& pieces, const std::string& line) {
  Record::Parts parts;
  Index rows = 0;
  for (const Piece& p : pieces) rows += p.end - p.begin;
  parts.values.resize(rows, record.channel_count());
  parts.time.reserve(static_cast<std::size_t>(rows));
  Index at = 0;
  for (const Piece& p : pieces) {
    const Index size = p.end - p.begin;
    parts.values.middleRows(at, size) = record.values().middleRows(p.begin, size);
    parts.time.insert(parts.time.end(), record.time().begin() + p.begin,
                      record.time().begin() + p.end);
    const int number = static_cast<int>(parts.trials.size());
    parts.trials.push_back({at, at + size});
    add_segments(record, p.trial, p.begin, p.end, at - p.begin, number, parts.segments);
    at += size;
  }
  parts.channels = record.channels();
  parts.rate_hz = record.rate_hz();
  parts.provenance = record.provenance();
  parts.provenance.push_back(line);
  return Record::make(std::move(parts));
}

}  // namespace

Record split(const Record& record, const SplitOptions& options) {
  require(options.gap_steps > 1.0, "gap_steps", "gap_steps must be above 1");
  require(options.min_rows >= 1, "min_rows", "min_rows must be at least 1");
  std::vector<Index> used;
  for (const Role role : {Role::kPosition, Role::kForce, Role::kReference}) {
    const std::vector<Index> some = record.with_role(role);
    used.insert(used.end(), some.begin(), some.end());
  }
  // The record's rate is derived from the steps that are no gaps.
  const double longest = options.gap_steps / record.rate_hz();
  Record::Parts parts;
  Index left_out = 0;
  const auto close = [&](Index begin, Index end) {
    if (end - begin >= options.min_rows)
      parts.trials.push_back({begin, end});
    else
      left_out += end - begin;
  };
  for (const Trial& trial : record.trials()) {
    Index begin = trial.begin;
    for (Index i = trial.begin; i < trial.end; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (i > begin && record.time()[at] - record.time()[at - 1] > longest) {
        close(begin, i);
        begin = i;
      }
      if (options.at_nan && !row_is_complete(record, used, i)) {
        close(begin, i);
        begin = i + 1;
        ++left_out;
      }
    }
    close(begin, trial.end);
  }
  if (parts.trials.empty()) {
    throw Error(Fault::kData, "min_rows",
                "no piece between gaps and missing values has " + std::to_string(options.min_rows) +
                    " rows: lower min_rows or record longer");
  }
  parts.time = record.time();
  parts.values = record.values();
  parts.channels = record.channels();
  parts.rate_hz = record.rate_hz();
  parts.provenance = record.provenance();
  parts.provenance.push_back("split at gaps and missing values into " +
                             std::to_string(parts.trials.size()) + " trials, " +
                             std::to_string(left_out) + " rows left out");
  return Record::make(std::move(parts));
}

Record select_rows(const Record& record, Index begin, Index end) {
  if (begin < 0 || end > record.rows() || begin >= end) {
    throw Error(Fault::kArgument, "rows",
                "rows " + std::to_string(begin) + " to " + std::to_string(end) +
                    " are not within the " + std::to_string(record.rows()) + " rows of the record");
  }
  std::vector<Piece> pieces;
  for (std::size_t i = 0; i < record.trials().size(); ++i) {
    const Trial& t = record.trials()[i];
    const Index b = std::max(begin, t.begin), e = std::min(end, t.end);
    if (e > b) pieces.push_back({b, e, static_cast<int>(i)});
  }
  if (pieces.empty()) {
    throw Error(Fault::kArgument, "rows",
                "rows " + std::to_string(begin) + " to " + std::to_string(end) +
                    " belong to no trial of the record");
  }
  return gather(record, pieces, "rows " + std::to_string(begin) + " to " + std::to_string(end));
}

Record select_trials(const Record& record, const std::vector<Index>& trials) {
  std::vector<Index> sorted = trials;
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  require(!sorted.empty(), "trials", "no trial is selected: name at least one");
  std::vector<Piece> pieces;
  std::string text;
  for (const Index i : sorted) {
    if (i < 0 || i >= static_cast<Index>(record.trials().size())) {
      throw Error(Fault::kArgument, "trials",
                  "there is no trial " + std::to_string(i) + ": the record has " +
                      std::to_string(record.trials().size()) + ", counted from 0");
    }
    const Trial& t = record.trials()[static_cast<std::size_t>(i)];
    pieces.push_back({t.begin, t.end, static_cast<int>(i)});
    text += (text.empty() ? "" : ", ") + std::to_string(i);
  }
  return gather(record, pieces, "trials " + text);
}

Record with_segments(const Record& record, const std::vector<double>& onsets_s, double before_s,
                     double after_s) {
  require(std::isfinite(before_s) && before_s >= 0.0, "before_s", "before_s must be 0 or more");
  require(std::isfinite(after_s) && after_s > 0.0, "after_s", "after_s must be positive");
  require(!onsets_s.empty(), "onsets_s", "there are no onsets: give at least one");
  const double longest = static_cast<double>(record.rows()) / record.rate_hz();
  require(before_s <= longest && after_s <= longest, before_s > longest ? "before_s" : "after_s",
          "a segment cannot be longer than the record");
  for (std::size_t k = 0; k < onsets_s.size(); ++k) {
    require(std::isfinite(onsets_s[k]), "onsets_s",
            "onset " + std::to_string(k) + " is not a number: leave it out");
  }
  Record::Parts parts = record.parts();
  parts.segments.clear();
  const Index before = static_cast<Index>(std::llround(before_s * record.rate_hz()));
  const Index after = static_cast<Index>(std::llround(after_s * record.rate_hz()));
  for (std::size_t k = 0; k < onsets_s.size(); ++k) {
    bool placed = false;
    for (std::size_t t = 0; t < parts.trials.size() && !placed; ++t) {
      const Trial& trial = parts.trials[t];
      const auto first = parts.time.begin() + trial.begin;
      const auto last = parts.time.begin() + trial.end;
      const auto row = std::lower_bound(first, last, onsets_s[k] - 1e-9 / record.rate_hz());
      if (row == last || onsets_s[k] < *first - 1.0 / record.rate_hz()) continue;
      const Index at = row - parts.time.begin();
      const Segment segment{at - before, at + after, static_cast<int>(t)};
      if (segment.begin < trial.begin || segment.end > trial.end) break;
      parts.segments.push_back(segment);
      placed = true;
    }
    if (!placed) {
      throw Error(Fault::kArgument, "onsets_s",
                  "the segment of onset " + std::to_string(k) + " (" + std::to_string(onsets_s[k]) +
                      " s) does not lie within a trial: correct the onset or shorten the segment",
                  "onset " + std::to_string(k));
    }
  }
  std::sort(parts.segments.begin(), parts.segments.end(),
            [](const Segment& a, const Segment& b) { return a.begin < b.begin; });
  parts.provenance.push_back(std::to_string(parts.segments.size()) + " segments from " +
                             std::to_string(before_s) + " s before to " + std::to_string(after_s) +
                             " s after the onsets");
  return Record::make(std::move(parts));
}

Record join(const std::vector<Record>& records) {
  require(!records.empty(), "records", "there are no records to join");
  const Record& first = records.front();
  Record::Parts parts;
  parts.channels = first.channels();
  parts.rate_hz = first.rate_hz();
  Index rows = 0;
  for (std::size_t k = 0; k < records.size(); ++k) {
    const Record& record = records[k];
    rows += record.rows();
    const std::string where = "record " + std::to_string(k);
    if (std::abs(record.rate_hz() - first.rate_hz()) > 1e-3 * first.rate_hz()) {
      throw Error(Fault::kData, "records",
                  where + " has a rate of " + std::to_string(record.rate_hz()) + " Hz, the first " +
                      std::to_string(first.rate_hz()) + " Hz: resample them to one rate",
                  where);
    }
    bool same = record.channels().size() == first.channels().size();
    std::string differing;
    for (std::size_t c = 0; same && c < first.channels().size(); ++c) {
      const Channel& a = first.channels()[c];
      const Channel& b = record.channels()[c];
      same = a.name == b.name && a.unit == b.unit && a.frame == b.frame && a.role == b.role &&
             a.axis == b.axis;
      if (!same) differing = " (\"" + b.name + "\" against \"" + a.name + "\")";
    }
    if (!same) {
      throw Error(Fault::kData, "records",
                  where + " has other channels than the first" + differing +
                      ": give all the same names, units and roles with a map",
                  where);
    }
  }
  parts.values.resize(rows, first.channel_count());
  parts.time.reserve(static_cast<std::size_t>(rows));
  Index at = 0;
  for (const Record& record : records) {
    const int trial = static_cast<int>(parts.trials.size());
    parts.values.middleRows(at, record.rows()) = record.values();
    parts.time.insert(parts.time.end(), record.time().begin(), record.time().end());
    for (const Trial& t : record.trials()) parts.trials.push_back({t.begin + at, t.end + at});
    for (const Segment& s : record.segments()) {
      parts.segments.push_back({s.begin + at, s.end + at, s.trial + trial});
    }
    parts.provenance.insert(parts.provenance.end(), record.provenance().begin(),
                            record.provenance().end());
    at += record.rows();
  }
  if (records.size() > 1) {
    parts.provenance.push_back("joined " + std::to_string(records.size()) + " records, " +
                               std::to_string(parts.trials.size()) + " trials");
  }
  return Record::make(std::move(parts));
}

}  // namespace ulna
