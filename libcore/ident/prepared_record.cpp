#include "ident/prepared_record.hpp"

#include <algorithm>
#include <sstream>

namespace ulna {
namespace {

struct Column {
  Channel channel;
  Matrix PreparedTrial::*signals;
  Index k;
};

}  // namespace

Record prepared_record(const Record& source, const Prepared& prepared) {
  std::vector<Column> columns;
  const auto add = [&](const std::vector<Index>& channels, Matrix PreparedTrial::*signals,
                       const std::string& suffix, const std::string& unit_suffix, bool keep_role) {
    for (std::size_t k = 0; k < channels.size(); ++k) {
      Channel channel = source.channels()[static_cast<std::size_t>(channels[k])];
      channel.name += suffix;
      channel.unit += unit_suffix;
      channel.source_name += suffix;
      channel.source_unit = channel.unit;
      channel.sign = 1;
      if (!keep_role) channel.role = Role::kOther;
      columns.push_back({std::move(channel), signals, static_cast<Index>(k)});
    }
  };
  const Roles& roles = prepared.roles;
  add(roles.position, &PreparedTrial::position, "", "", true);
  add(roles.position, &PreparedTrial::velocity, "_rate", "/s", false);
  add(roles.position, &PreparedTrial::acceleration, "_acceleration", "/s^2", false);
  add(roles.force, &PreparedTrial::force, "", "", true);
  add(roles.reference, &PreparedTrial::reference, "", "", true);
  add(roles.reference, &PreparedTrial::reference_rate, "_rate", "/s", false);
  add(roles.reference, &PreparedTrial::reference_acceleration, "_acceleration", "/s^2", false);

  Record::Parts parts;
  Index rows = 0;
  for (const PreparedTrial& trial : prepared.trials) rows += trial.rows();
  parts.values.resize(rows, static_cast<Index>(columns.size()));
  parts.time.reserve(static_cast<std::size_t>(rows));
  Index at = 0;
  for (std::size_t t = 0; t < prepared.trials.size(); ++t) {
    const PreparedTrial& trial = prepared.trials[t];
    for (std::size_t c = 0; c < columns.size(); ++c) {
      parts.values.col(static_cast<Index>(c)).segment(at, trial.rows()) =
          (trial.*columns[c].signals).col(columns[c].k);
    }
    const auto first = source.time().begin() + trial.begin;
    parts.time.insert(parts.time.end(), first, first + trial.rows());
    parts.trials.push_back({at, at + trial.rows()});
    for (const Segment& segment : source.segments()) {
      if (segment.trial != static_cast<int>(t)) continue;
      const Index begin = std::max<Index>(segment.begin - trial.begin, 0);
      const Index end = std::min(segment.end - trial.begin, trial.rows());
      if (begin < end) parts.segments.push_back({at + begin, at + end, static_cast<int>(t)});
    }
    at += trial.rows();
  }
  for (const Column& column : columns) parts.channels.push_back(column.channel);
  parts.rate_hz = source.rate_hz();
  parts.provenance = source.provenance();
  std::ostringstream step;
  step << "prepared: Savitzky-Golay order " << prepared.report.order << ", window "
       << prepared.report.window;
  if (prepared.report.lowpass_order > 0) {
    step << ", zero-phase Butterworth order " << prepared.report.lowpass_order << " at "
         << prepared.report.lowpass_hz << " Hz";
  }
  step << ", " << prepared.report.dropped_rows << " rows dropped at either end of a trial";
  parts.provenance.push_back(step.str());
  return Record::make(std::move(parts));
}

}  // namespace ulna
