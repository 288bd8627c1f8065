#include "record/record.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_set>

#include "base/error.hpp"

namespace ulna {
namespace {

std::string row_text(Index row) { return "row " + std::to_string(row); }

std::string names_of(const std::vector<Channel>& channels) {
  std::string text;
  for (const Channel& channel : channels) text += (text.empty() ? "" : ", ") + channel.name;
  return text.empty() ? "none" : text;
}

void check_channels(const std::vector<Channel>& channels, Index columns) {
  if (static_cast<Index>(channels.size()) != columns) {
    throw Error(Fault::kArgument, "channels",
                "the record has " + std::to_string(columns) + " columns of values but " +
                    std::to_string(channels.size()) + " channel descriptions: give one a column");
  }
  std::unordered_set<std::string> seen;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const Channel& channel = channels[i];
    const std::string where = "channel " + std::to_string(i);
    if (channel.name.empty()) {
      throw Error(Fault::kArgument, "channels", where + " has no name: give it one", where);
    }
    if (std::any_of(channel.name.begin(), channel.name.end(),
                    [](char c) { return static_cast<unsigned char>(c) < 0x20u || c == 0x7f; })) {
      throw Error(Fault::kArgument, "channels",
                  "the name of " + where + " holds a control character: use printable text", where);
    }
    if (channel.name.size() > 127) {
      throw Error(Fault::kArgument, "channels",
                  "the name of " + where + " is longer than 127 bytes: shorten it", where);
    }
    if (!seen.insert(channel.name).second) {
      throw Error(Fault::kArgument, "channels",
                  "two channels are named \"" + channel.name + "\": give each its own name",
                  "channel " + channel.name);
    }
    if (channel.sign != 1 && channel.sign != -1) {
      throw Error(Fault::kArgument, "channels",
                  "the sign of channel \"" + channel.name + "\" must be +1 or -1",
                  "channel " + channel.name);
    }
    if (channel.axis < 0) {
      throw Error(Fault::kArgument, "channels",
                  "the axis of channel \"" + channel.name + "\" must be 0 or more",
                  "channel " + channel.name);
    }
  }
}

void check_trials(const std::vector<Trial>& trials, Index rows) {
  Index end = 0;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const Trial& trial = trials[i];
    if (trial.begin < end || trial.end <= trial.begin || trial.end > rows) {
      throw Error(Fault::kArgument, "trials",
                  "trial " + std::to_string(i) + " has rows " + std::to_string(trial.begin) +
                      " to " + std::to_string(trial.end) + " of " + std::to_string(rows) +
                      ": trials must be in order, not empty and apart from each other",
                  "trial " + std::to_string(i));
    }
    end = trial.end;
  }
}

void check_segments(const std::vector<Segment>& segments, const std::vector<Trial>& trials) {
  Index begin = 0;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& segment = segments[i];
    const std::string where = "segment " + std::to_string(i);
    if (segment.trial < 0 || segment.trial >= static_cast<int>(trials.size())) {
      throw Error(Fault::kArgument, "segments",
                  where + " belongs to trial " + std::to_string(segment.trial) +
                      ", but there are " + std::to_string(trials.size()) + " trials",
                  where);
    }
    const Trial& trial = trials[static_cast<std::size_t>(segment.trial)];
    if (segment.begin < trial.begin || segment.end > trial.end || segment.end <= segment.begin ||
        segment.begin < begin) {
      throw Error(Fault::kArgument, "segments",
                  where + " has rows " + std::to_string(segment.begin) + " to " +
                      std::to_string(segment.end) +
                      ": segments must be in order, apart, not empty and inside their trial",
                  where);
    }
    begin = segment.end;
  }
}

void check_time(const std::vector<double>& time, const std::vector<Trial>& trials) {
  for (const Trial& trial : trials) {
    for (Index i = trial.begin; i < trial.end; ++i) {
      const double now = time[static_cast<std::size_t>(i)];
      if (!std::isfinite(now)) {
        throw Error(Fault::kData, "time",
                    "the time at " + row_text(i) + " is not a finite number: remove that row",
                    row_text(i));
      }
      if (i == trial.begin) continue;
      const double before = time[static_cast<std::size_t>(i - 1)];
      if (now > before) continue;
      const std::string how =
          now == before ? "repeats the time stamp before it" : "is earlier than the row before it";
      throw Error(Fault::kData, "time",
                  row_text(i) + " " + how + " (" + std::to_string(now) + " s after " +
                      std::to_string(before) +
                      " s): remove the row, or split the log into trials where its clock restarts",
                  row_text(i));
    }
  }
}

// The mean of the steps that are no gap: unlike the median it does not carry the rounding of the
// time stamps, and unlike the overall mean it does not count the pauses.
double rate_of(const std::vector<double>& time, const std::vector<Trial>& trials) {
  std::vector<double> steps;
  steps.reserve(time.size());
  for (const Trial& trial : trials) {
    for (Index i = trial.begin + 1; i < trial.end; ++i) {
      steps.push_back(time[static_cast<std::size_t>(i)] - time[static_cast<std::size_t>(i - 1)]);
    }
  }
  if (steps.empty()) {
    throw Error(Fault::kData, "rate_hz",
                "a single row has no sample rate: give more rows, or the rate");
  }
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double median = *middle;
  double sum = 0.0;
  double count = 0.0;
  // Over the runs between gaps, so that each run contributes its ends only and rounding cancels.
  for (const Trial& trial : trials) {
    Index start = trial.begin;
    for (Index i = trial.begin + 1; i <= trial.end; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (i < trial.end && time[at] - time[at - 1] <= 1.5 * median) continue;
      sum += time[at - 1] - time[static_cast<std::size_t>(start)];
      count += static_cast<double>(i - 1 - start);
      start = i;
    }
  }
  const double rate = count / sum;
  // A nominal rate is a round number; the difference of 1e-9 is the rounding of the stamps.
  const double nominal = std::round(rate);
  return nominal > 0.0 && std::abs(rate - nominal) <= 1e-9 * rate ? nominal : rate;
}

// The place of an axis letter or number among its kind; nothing when the text is no axis.
std::optional<int> axis_rank(std::string_view text) {
  if (text == "x" || text == "X") return 0;
  if (text == "y" || text == "Y") return 1;
  if (text == "z" || text == "Z") return 2;
  if (text.empty() || text.size() > 3) return std::nullopt;
  int number = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') return std::nullopt;
    number = 10 * number + (c - '0');
  }
  return 10 + number;  // numbers never mix with letters; the offset keeps them apart
}

// Rank of `name` as a component of the vector `word`, if it is one.
std::optional<int> component_rank(std::string_view name, std::string_view word) {
  if (name.size() > word.size() && name.substr(0, word.size()) == word) {
    std::string_view rest = name.substr(word.size());
    if (rest.front() == '_') rest.remove_prefix(1);
    return axis_rank(rest);
  }
  // "x" and "x_ref" are also the field's names of the vectors (x, y, z) and (x_ref, y_ref, z_ref).
  const bool vector_word = word == "x" || (word.size() > 2 && word.substr(0, 2) == "x_");
  if (vector_word && name.size() == word.size() && name.substr(1) == word.substr(1)) {
    return axis_rank(name.substr(0, 1));
  }
  return std::nullopt;
}

}  // namespace

Record Record::make(Parts parts) {
  const Index rows = parts.values.rows();
  if (rows < 1) throw Error(Fault::kData, "values", "the record has no rows: give at least two");
  if (!(std::isfinite(parts.rate_hz) && parts.rate_hz >= 0.0)) {
    throw Error(Fault::kArgument, "rate_hz", "the sample rate must be positive, or 0 to derive it");
  }
  check_channels(parts.channels, parts.values.cols());
  if (parts.time.empty() && parts.rate_hz > 0.0) {
    parts.time.resize(static_cast<std::size_t>(rows));
    for (Index i = 0; i < rows; ++i) {
      parts.time[static_cast<std::size_t>(i)] = static_cast<double>(i) / parts.rate_hz;
    }
  }
  if (static_cast<Index>(parts.time.size()) != rows) {
    throw Error(Fault::kArgument, "time",
                "the clock has " + std::to_string(parts.time.size()) +
                    " stamps but the values have " + std::to_string(rows) +
                    " rows: give one a row");
  }
  if (parts.trials.empty()) parts.trials.push_back({0, rows});
  check_trials(parts.trials, rows);
  if (parts.segments.empty()) {
    for (std::size_t i = 0; i < parts.trials.size(); ++i) {
      parts.segments.push_back({parts.trials[i].begin, parts.trials[i].end, static_cast<int>(i)});
    }
  }
  check_segments(parts.segments, parts.trials);
  check_time(parts.time, parts.trials);
  if (parts.rate_hz == 0.0) parts.rate_hz = rate_of(parts.time, parts.trials);
  return Record(std::make_shared<const Parts>(std::move(parts)));
}

Index Record::find(std::string_view name) const {
  const std::vector<Channel>& all = channels();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == name) return static_cast<Index>(i);
  }
  const std::string text(name);
  throw Error(Fault::kArgument, "channel",
              "there is no channel \"" + text + "\"; the channels are " + names_of(all),
              "channel " + text);
}

std::vector<Index> Record::with_role(Role role) const {
  std::vector<Index> found;
  for (std::size_t i = 0; i < channels().size(); ++i) {
    if (channels()[i].role == role) found.push_back(static_cast<Index>(i));
  }
  std::stable_sort(found.begin(), found.end(), [&](Index a, Index b) {
    return channels()[static_cast<std::size_t>(a)].axis <
           channels()[static_cast<std::size_t>(b)].axis;
  });
  return found;
}

std::vector<Index> Record::resolve(std::string_view word) const {
  std::vector<std::pair<int, Index>> components;
  std::optional<Index> exact;
  for (std::size_t i = 0; i < channels().size() && !word.empty(); ++i) {
    const std::string& name = channels()[i].name;
    if (name == word) exact = static_cast<Index>(i);
    const std::optional<int> rank = component_rank(name, word);
    if (rank) components.emplace_back(*rank, static_cast<Index>(i));
  }
  // An exact name wins, unless it is the first component of the vector of that name and the log
  // holds the other components in the same role.
  if (exact) {
    const Channel& first = channels()[static_cast<std::size_t>(*exact)];
    const bool is_component = component_rank(first.name, word).has_value();
    if (!is_component || first.role == Role::kOther) return {*exact};
    std::erase_if(components, [&](const auto& item) {
      return channels()[static_cast<std::size_t>(item.second)].role != first.role ||
             channels()[static_cast<std::size_t>(item.second)].name.size() != word.size();
    });
  }
  std::sort(components.begin(), components.end());
  std::vector<Index> found;
  for (const auto& [rank, index] : components) found.push_back(index);
  if (found.empty()) {
    if (word == "position") found = with_role(Role::kPosition);
    if (word == "force") found = with_role(Role::kForce);
    if (word == "reference") found = with_role(Role::kReference);
  }
  if (found.empty()) {
    const std::string text(word);
    throw Error(Fault::kArgument, "channel",
                "no channel is called or begins with \"" + text + "\"; the channels are " +
                    names_of(channels()),
                "channel " + text);
  }
  return found;
}

}  // namespace ulna
