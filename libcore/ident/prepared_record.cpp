#include "ident/prepared_record.hpp"

#include <algorithm>
#include <sstream>

namespace ulna {
Record prepared_record(const Record& source, const Prepared& prepared) {
  // In the order of the prepared table's columns.
  std::vector<Channel> columns;
  const auto add = [&](const std::vector<Index>& channels, const std::string& suffix,
                       const std::string& unit_suffix, bool keep_role) {
    for (const Index c : channels) {
      Channel channel = source.channels()[static_cast<std::size_t>(c)];
      channel.name += suffix;
      channel.unit += unit_suffix;
      channel.source_name += suffix;
      channel.source_unit = channel.unit;
      channel.sign = 1;
      if (!keep_role) channel.role = Role::kOther;
      columns.push_back(std::move(channel));
    }
  };
  const Roles& roles = prepared.roles;
  add(roles.position, "", "", true);
  add(roles.position, "_rate", "/s", false);
  add(roles.position, "_acceleration", "/s^2", false);
  add(roles.force, "", "", true);
  add(roles.reference, "", "", true);
  add(roles.reference, "_rate", "/s", false);
  add(roles.reference, "_acceleration", "/s^2", false);

  Record::Parts parts;
  Index rows = 0;
  for (const PreparedTrial& trial : prepared.trials) rows += trial.rows();
  parts.values.resize(rows, static_cast<Index>(columns.size()));
  parts.time.reserve(static_cast<std::size_t>(rows));
  Index at = 0;
  for (std::size_t t = 0; t < prepared.trials.size(); ++t) {
    const PreparedTrial& trial = prepared.trials[t];
    parts.values.middleRows(at, trial.rows()) = trial.table();
    const auto first = source.time().begin() + trial.begin();
    parts.time.insert(parts.time.end(), first, first + trial.rows());
    parts.trials.push_back({at, at + trial.rows()});
    for (const Segment& segment : source.segments()) {
      if (segment.trial != static_cast<int>(t)) continue;
      const Index begin = std::max<Index>(segment.begin - trial.begin(), 0);
      const Index end = std::min(segment.end - trial.begin(), trial.rows());
      if (begin < end) parts.segments.push_back({at + begin, at + end, static_cast<int>(t)});
    }
    at += trial.rows();
  }
  parts.channels = std::move(columns);
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
