#include "ident/excitation_record.hpp"

#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {

Record record_of(const Excitation& excitation, const std::vector<std::string>& names,
                 bool rotational, bool derivatives) {
  const Index n = excitation.axes();
  require(static_cast<Index>(names.size()) == n, "axes",
          "the design has " + std::to_string(n) + " axes and " + std::to_string(names.size()) +
              " names were given");
  const bool force = excitation.drive == Drive::kForce;
  const std::string unit = force ? (rotational ? "Nm" : "N") : (rotational ? "rad" : "m");
  Record::Parts parts;
  parts.rate_hz = excitation.rate_hz;
  parts.values.resize(excitation.rows(), derivatives ? 3 * n : n);
  const auto add = [&](const Matrix& values, const char* suffix, const std::string& per, Role role,
                       Index first) {
    parts.values.middleCols(first, n) = values;
    for (Index a = 0; a < n; ++a) {
      Channel channel;
      channel.name = (force ? "F_" : "") + names[static_cast<std::size_t>(a)] + "_ref" + suffix;
      channel.unit = unit + per;
      channel.role = role;
      channel.axis = static_cast<int>(a);
      parts.channels.push_back(std::move(channel));
    }
  };
  add(excitation.value, "", "", Role::kReference, 0);
  if (derivatives) {
    add(excitation.rate, "_rate", "/s", Role::kOther, n);
    add(excitation.acceleration, "_acceleration", "/s^2", Role::kOther, 2 * n);
  }
  for (const RowRange& range : excitation.segments) {
    parts.segments.push_back({range.begin, range.end, 0});
  }
  parts.provenance.push_back(excitation.provenance);
  return Record::make(std::move(parts));
}

Record with_segments_of(const Record& record, const Excitation& excitation, double start_s) {
  require(std::isfinite(start_s) && start_s >= 0.0, "start_s",
          "the design starts 0 s or later after the first row of a trial");
  const double rate = record.rate_hz();
  Record::Parts parts = record.parts();
  parts.segments.clear();
  const auto row_of = [&](Index row) {
    return static_cast<Index>(
        std::llround((start_s + static_cast<double>(row) / excitation.rate_hz) * rate));
  };
  for (std::size_t t = 0; t < parts.trials.size(); ++t) {
    const Trial& trial = parts.trials[t];
    for (std::size_t s = 0; s < excitation.segments.size(); ++s) {
      const RowRange& range = excitation.segments[s];
      const Segment segment{trial.begin + row_of(range.begin), trial.begin + row_of(range.end),
                            static_cast<int>(t)};
      if (segment.end > trial.end) {
        throw Error(
            Fault::kData, "record",
            sentence(6, "trial ", t, " lasts ", static_cast<double>(trial.end - trial.begin) / rate,
                     " s, but perturbation ", s, " of the design ends ",
                     static_cast<double>(segment.end - trial.begin) / rate,
                     " s after its start: record longer, or check start_s"),
            "segment " + std::to_string(s));
      }
      parts.segments.push_back(segment);
    }
  }
  parts.provenance.push_back(sentence(6, "segments of the ", excitation.provenance,
                                      ", which starts ", start_s, " s after a trial does"));
  return Record::make(std::move(parts));
}

}  // namespace ulna
