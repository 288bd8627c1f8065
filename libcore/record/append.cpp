#include "record/append.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

#include "base/error.hpp"

namespace ulna {

Record append_channels(const Record& record, const Matrix& values,
                       const std::vector<Channel>& channels, const std::string& step) {
  require(values.rows() == record.rows() && values.cols() == static_cast<Index>(channels.size()),
          "values", "new channels need one value for every row of the record");
  Record::Parts parts = record.parts();
  const bool forces = std::any_of(channels.begin(), channels.end(),
                                  [](const Channel& c) { return c.role == Role::kForce; });
  for (Channel& old : parts.channels) {
    if (forces && old.role == Role::kForce) old.role = Role::kOther;
    for (const Channel& added : channels) {
      if (added.name != old.name) continue;
      throw Error(Fault::kArgument, "name",
                  "the record already has a channel " + old.name + ": give another name",
                  "channel " + old.name);
    }
  }
  const Index before = parts.values.cols();
  parts.values.conservativeResize(Eigen::NoChange, before + values.cols());
  parts.values.rightCols(values.cols()) = values;
  parts.channels.insert(parts.channels.end(), channels.begin(), channels.end());
  parts.provenance.push_back(step);
  return Record::make(std::move(parts));
}

std::vector<Index> channels_of(const Record& record, const std::string& word,
                               const char* argument) {
  try {
    if (word.find(',') == std::string::npos) return record.resolve(word);
    std::vector<Index> exact;
    std::istringstream names(word);
    for (std::string name; std::getline(names, name, ',');) exact.push_back(record.find(name));
    return exact;
  } catch (const Error& error) {
    throw Error(error.fault(), argument, error.what(), error.detail());
  }
}

std::string first_word(const Record& record, const std::string& word,
                       const std::vector<std::string>& usual) {
  if (!word.empty()) return word;
  for (const std::string& candidate : usual) {
    for (const Channel& channel : record.channels()) {
      if (channel.name == candidate || channel.name.starts_with(candidate + "_")) return candidate;
    }
  }
  return usual.front();
}

void require_unit(const Record& record, const std::vector<Index>& channels, const std::string& unit,
                  const std::string& advice) {
  for (const Index c : channels) {
    const Channel& channel = record.channels()[static_cast<std::size_t>(c)];
    if (channel.unit == unit) continue;
    throw Error(Fault::kData, channel.name,
                "channel " + channel.name + " is in " +
                    (channel.unit.empty() ? "no known unit" : channel.unit) + ", not in " + unit +
                    ": " + advice,
                "channel " + channel.name);
  }
}

}  // namespace ulna
