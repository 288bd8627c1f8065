// A recorded log and a simulated experiment are the same thing here: channels with name, unit,
// frame and sign on one clock, in one or more trials, immutable, with a line of provenance for
// every step.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/types.hpp"

namespace ulna {

enum class Role : std::int32_t { kOther = 0, kPosition = 1, kForce = 2, kReference = 3 };

// Values of a channel are SI and already multiplied by sign; `source_*` says what the file held.
struct Channel {
  std::string name;   // "x", "F_x", "x_ref"
  std::string unit;   // SI: "m", "rad", "N", "Nm", "1", ...
  std::string frame;  // "" when the log does not say
  int sign = 1;       // +1 or -1, as applied to the source
  Role role = Role::kOther;
  int axis = 0;             // 0-based index within the role
  std::string source_name;  // column of the file
  std::string source_unit;  // unit in the file
};

// Rows [begin, end) recorded without interruption. Filters never reach across a trial's ends.
struct Trial {
  Index begin = 0;
  Index end = 0;
};

// Rows [begin, end) of one trial that an analysis uses (one perturbation, say).
struct Segment {
  Index begin = 0;
  Index end = 0;
  int trial = 0;
};

enum class Severity : std::int32_t { kNote = 0, kWarning = 1, kError = 2 };

// What a look at the data found. kError: an analysis of this channel will refuse.
struct Finding {
  Severity severity = Severity::kNote;
  std::string code;     // stable word: "gap", "nan", "jitter", "saturated", "constant", "unit", ...
  std::string channel;  // "" for the clock
  Index row = 0;        // first row concerned, 0-based
  Index count = 0;      // rows concerned
  std::string message;  // one sentence: what, where, what to do
};

class Record {
 public:
  struct Parts {
    std::vector<double> time;  // s, one a row, as recorded (never resampled silently); empty with a
                               // rate_hz: row / rate_hz
    Matrix values;             // rows x channels
    std::vector<Channel> channels;
    std::vector<Trial> trials;      // empty: one trial of all rows
    std::vector<Segment> segments;  // empty: one segment a trial
    std::vector<std::string> provenance;
    double rate_hz = 0.0;  // 0: from the mean time step, steps above 1.5 medians (gaps) left out
  };

  // Checks shapes, names (unique, not empty), order of trials and segments, finite and increasing
  // time within each trial; throws Error with the row or channel. NaN in values is kept.
  static Record make(Parts parts);

  Index rows() const noexcept { return parts_->values.rows(); }
  Index channel_count() const noexcept { return parts_->values.cols(); }
  double rate_hz() const noexcept { return parts_->rate_hz; }
  const std::vector<double>& time() const noexcept { return parts_->time; }
  const Matrix& values() const noexcept { return parts_->values; }
  auto column(Index channel) const { return parts_->values.col(channel); }
  const std::vector<Channel>& channels() const noexcept { return parts_->channels; }
  const std::vector<Trial>& trials() const noexcept { return parts_->trials; }
  const std::vector<Segment>& segments() const noexcept { return parts_->segments; }
  const std::vector<std::string>& provenance() const noexcept { return parts_->provenance; }
  const Parts& parts() const noexcept { return *parts_; }

  // Index of a channel by name; throws Error naming the channels there are.
  Index find(std::string_view name) const;

  // Channels of a role in order of axis; empty when there is none.
  std::vector<Index> with_role(Role role) const;

  // Channels that a user's word stands for, in order of axis: an exact name, else "<word>_<axis>"
  // or
  // "<word><axis>" ("F" for F_x and F_y), else "position", "force", "reference" for the role. "x"
  // and "x_<more>" name the whole vector ("x" for x and y, "x_ref" for x_ref and y_ref) when the
  // others have the same role; find() gives the single channel. Throws Error naming the channels
  // there are.
  std::vector<Index> resolve(std::string_view word) const;

 private:
  explicit Record(std::shared_ptr<const Parts> parts) : parts_(std::move(parts)) {}
  std::shared_ptr<const Parts> parts_;
};

}  // namespace ulna
