#include "record/mapping.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "base/error.hpp"
#include "record/units.hpp"

namespace ulna {
namespace {

// What a name says. rank orders the axes of a role: x y z are 0 1 2, numbers follow, names last.
struct Guess {
  Role role = Role::kOther;
  bool time = false;
  bool rotation = false;
  int rank = 0;
  std::string label;  // canonical name
};

using Words = std::vector<std::string>;

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

bool among(const std::string& word, std::initializer_list<std::string_view> list) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

bool digits(std::string_view text) {
  return !text.empty() && text.size() <= 3 &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

int axis_of_letter(const std::string& word) {
  return word.size() == 1 && word[0] >= 'x' && word[0] <= 'z' ? word[0] - 'x' : -1;
}

// What a commanded motion is called; a longer word comes before its own beginning.
constexpr std::string_view kCommands[] = {"commanded", "command", "cmd",      "desired", "des",
                                          "reference", "ref",     "setpoint", "target",  "goal"};

bool is_command(std::string_view word) {
  return std::find(std::begin(kCommands), std::end(kCommands), word) != std::end(kCommands);
}

// "cmdx" and "xgoal" are two words. What remains must still be an axis or a position's name, so
// that "nodes" or "prefer" become no reference.
void push_without_command(Words& words, const std::string& word) {
  for (const std::string_view command : kCommands) {
    if (is_command(word)) break;
    if (word.size() <= command.size()) continue;
    const std::size_t rest = word.size() - command.size();
    if (std::string_view(word).substr(0, command.size()) == command) {
      words.emplace_back(command);
      words.push_back(word.substr(command.size()));
      return;
    }
    if (std::string_view(word).substr(rest) == command) {
      words.push_back(word.substr(0, rest));
      words.emplace_back(command);
      return;
    }
  }
  words.push_back(word);
}

// Lower-case words; an axis or a command stuck to a known word comes off ("posx", "fy", "q2",
// "xref", "CmdX").
Words words_of(std::string_view stem) {
  Words words;
  std::string word;
  for (const char c : std::string(stem) + "_") {
    if (std::isalnum(static_cast<unsigned char>(c)) || (static_cast<unsigned char>(c) & 0x80u)) {
      word += c;
    } else if (!word.empty()) {
      push_without_command(words, lower(word));
      word.clear();
    }
  }
  Words out;
  for (const std::string& w : words) {
    static constexpr std::string_view kHeads[] = {"position", "pos",    "force", "torque",
                                                  "tau",      "moment", "angle", "theta",
                                                  "hand",     "f",      "m",     "q"};
    bool done = false;
    for (const std::string_view head : kHeads) {
      if (w.size() <= head.size() || w.substr(0, head.size()) != head) continue;
      const std::string rest = w.substr(head.size());
      if (axis_of_letter(rest) < 0 && !digits(rest)) continue;
      out.emplace_back(head);
      out.push_back(rest);
      done = true;
      break;
    }
    if (done) continue;
    if (w.size() > 1 && axis_of_letter(w.substr(0, 1)) >= 0 &&
        among(w.substr(1), {"pos", "position", "force"})) {
      out.push_back(w.substr(0, 1));
      out.push_back(w.substr(1));
      continue;
    }
    out.push_back(w);
  }
  return out;
}

std::string axis_label(int rank, const std::string& word) {
  if (rank >= 0 && rank <= 2) return std::string(1, static_cast<char>('x' + rank));
  return word;
}

// The last word that is an axis is taken out; -1 when there is none.
int take_axis(Words& words, std::string& text) {
  for (std::size_t i = words.size(); i-- > 0;) {
    const int letter = axis_of_letter(words[i]);
    if (letter < 0 && !digits(words[i])) continue;
    text = words[i];
    words.erase(words.begin() + static_cast<std::ptrdiff_t>(i));
    return letter >= 0 ? letter : 10 + std::stoi(text);
  }
  return -1;
}

bool take_any(Words& words, std::initializer_list<std::string_view> list) {
  const auto at = std::find_if(words.begin(), words.end(),
                               [&](const std::string& w) { return among(w, list); });
  if (at == words.end()) return false;
  words.erase(at);
  return true;
}

bool is_unit_of(const std::string& unit, std::initializer_list<std::string_view> si) {
  const std::optional<Unit> parsed = parse_unit(unit);
  return parsed && among(parsed->si, si);
}

Guess guess_position(Words words, const std::string& unit, std::string_view stem, bool reference) {
  Guess guess;
  std::string axis;
  const bool angle = take_any(words, {"q", "angle", "theta", "phi", "joint"});
  take_any(words, {"angle"});
  int rank = take_axis(words, axis);
  const bool named = take_any(words, {"pos", "position", "positions", "displacement"});
  take_any(words, {"hand", "endpoint", "ee", "tcp", "tip", "handle", "cursor", "human", "arm"});
  take_any(words, {"meas", "measured", "actual", "act", "raw"});
  const bool bare_hand = !named && !angle && rank >= 0 && rank <= 2;
  // A joint's own name is its axis: q_ankle, angle_hip.
  const bool joint = angle && rank < 0 && words.size() == 1;
  if (joint) {
    axis = words[0];
    rank = 1000;
    words.clear();
  }
  if (!words.empty() || !(angle || named || bare_hand || reference)) return guess;
  if (!unit.empty() && !is_unit_of(unit, {"m", "rad", "1"})) return guess;
  guess.role = reference ? Role::kReference : Role::kPosition;
  guess.rotation = angle || is_unit_of(unit, {"rad"});
  guess.rank = rank < 0 ? 0 : rank;
  if (guess.rotation) {
    guess.label = rank < 0 ? (angle && !reference ? std::string(stem) : "position")
                           : (angle ? "q_" : "position_") + axis_label(rank, axis);
  } else {
    guess.label = rank < 0 ? (named ? "position" : "x") : axis_label(rank, axis);
    if (rank >= 10) guess.label = "position_" + axis;
  }
  if (reference) guess.label += "_ref";
  return guess;
}

Guess guess_force(Words words, const std::string& unit, std::string_view stem) {
  Guess guess;
  std::string axis;
  const bool torque_word =
      take_any(words, {"torque", "tau", "moment", "trq"}) ||
      ((stem.front() == 'M' || is_unit_of(unit, {"Nm"})) && take_any(words, {"m"}));
  const bool force_word = !torque_word && take_any(words, {"f", "force", "forces"});
  if (!torque_word && !force_word) return guess;
  const int rank = take_axis(words, axis);
  take_any(words,
           {"hand", "endpoint", "ee", "tcp", "handle", "sensor", "interaction", "arm", "human"});
  take_any(words, {"h", "ext", "meas", "measured", "raw", "ft", "int", "actual"});
  if (words.size() == 1 && torque_word && rank < 0) {  // torque_ankle
    axis = words[0];
    words.clear();
  }
  if (!words.empty()) return guess;
  if (!unit.empty() && !is_unit_of(unit, {"N", "Nm"})) return guess;
  guess.role = Role::kForce;
  guess.rotation = is_unit_of(unit, {"Nm"}) || (torque_word && unit.empty());
  guess.rank = rank >= 0 ? rank : axis.empty() ? 0 : 1000;
  if (guess.rotation) {
    guess.label = axis.empty() ? "torque" : "torque_" + axis_label(rank, axis);
  } else {
    guess.label = "F_" + (rank < 0 ? "x" : axis_label(rank, axis));
  }
  return guess;
}

Guess guess_of(const std::string& stem, const std::string& unit) {
  Words words = words_of(stem);
  Guess guess;
  if (words.empty()) return guess;
  if (words.size() <= 2 &&
      among(words[0], {"t", "time", "timestamp", "timestamps", "zeit", "clock"}) &&
      (words.size() == 1 || among(words[1], {"stamp", "sec", "seconds", "axis"})) &&
      (unit.empty() || is_unit_of(unit, {"s"}))) {
    guess.time = true;
    return guess;
  }
  for (const std::string& word : words) {
    if (among(word, {"v",     "vel", "velocity", "velocities", "speed", "dq",           "ddq",
                     "qd",    "qdd", "dx",       "dy",         "dz",    "ddx",          "ddy",
                     "ddz",   "vx",  "vy",       "vz",         "acc",   "acceleration", "dot",
                     "error", "err", "current",  "emg",        "std"})) {
      return guess;
    }
  }
  const auto command = std::find_if(words.begin(), words.end(), is_command);
  if (command != words.end()) {
    words.erase(command);
    // A commanded force is no reference of the motion; it stays what it is.
    if (guess_force(words, unit, stem).role == Role::kForce) return guess;
    return guess_position(words, unit, stem, true);
  }
  guess = guess_force(words, unit, stem);
  return guess.role == Role::kForce ? guess : guess_position(words, unit, stem, false);
}

std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0u : 1u)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string nearest(const std::vector<Column>& columns, const std::string& wanted) {
  std::string best;
  std::size_t least = std::max<std::size_t>(3, wanted.size() / 2);
  for (const Column& column : columns) {
    if (wanted.size() > 200 || column.stem.size() > 200) continue;
    const std::size_t d = std::min(distance(lower(column.stem), lower(wanted)),
                                   distance(lower(column.heading), lower(wanted)));
    if (d < least) {
      least = d;
      best = column.heading;
    }
  }
  return best;
}

Index column_named(const std::vector<Column>& columns, const std::string& wanted,
                   const char* argument) {
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].heading == wanted) return static_cast<Index>(i);
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].stem == wanted) return static_cast<Index>(i);
  }
  const std::string near = nearest(columns, wanted);
  throw Error(Fault::kArgument, argument,
              "there is no column \"" + wanted + "\"" +
                  (near.empty() ? std::string() : " (did you mean \"" + near + "\"?)") +
                  "; the columns are " + list_of(columns),
              "column " + wanted);
}

Finding finding(Severity severity, const char* code, const std::string& channel,
                const std::string& message) {
  return {severity, code, channel, 0, 0, message};
}

struct Draft {
  Index column = 0;
  Channel channel;
  std::string unit_text;
  bool by_rule = false;
  bool axis_fixed = false;
  bool unit_given = false;
  bool rotation = false;
  int rank = 0;
};

class Mapper {
 public:
  Mapper(const std::vector<Column>& columns, const MappingRules& rules)
      : columns_(columns), rules_(rules), used_(columns.size(), false) {}

  Mapping run() {
    choose_time();
    if (rules_.channels.empty()) {
      guess_channels();
      keep_matching_axes();
    } else {
      apply_rules();
    }
    number_axes();
    name_channels();
    convert_units();
    return std::move(out_);
  }

 private:
  void choose_time() {
    std::string unit = rules_.time_unit;
    if (!rules_.time_column.empty()) {
      out_.time = column_named(columns_, rules_.time_column, "time");
    } else if (!(rules_.rate_hz > 0.0)) {
      for (std::size_t i = 0; i < columns_.size() && out_.time < 0; ++i) {
        const bool ruled = std::any_of(
            rules_.channels.begin(), rules_.channels.end(), [&](const ChannelRule& rule) {
              return rule.source == columns_[i].heading || rule.source == columns_[i].stem;
            });
        if (!ruled && guess_of(columns_[i].stem, columns_[i].unit).time) {
          out_.time = static_cast<Index>(i);
        }
      }
    }
    if (out_.time < 0) return;
    const auto at = static_cast<std::size_t>(out_.time);
    used_[at] = true;
    if (unit.empty()) unit = columns_[at].unit;
    if (unit.empty()) unit = "s";
    const std::optional<Unit> parsed = parse_unit(unit);
    if (!parsed || parsed->si != "s") {
      throw Error(Fault::kArgument, "time",
                  "the time column \"" + columns_[at].heading + "\" has the unit \"" + unit +
                      "\": use s, ms, us or min",
                  "column " + columns_[at].heading);
    }
    out_.time_factor = parsed->factor;
  }

  Channel channel_of(std::size_t column) const {
    Channel channel;
    channel.name = columns_[column].stem.empty() ? columns_[column].heading : columns_[column].stem;
    channel.source_name = columns_[column].heading;
    channel.source_unit = columns_[column].unit;
    return channel;
  }

  void add(std::size_t column, Draft draft) {
    draft.column = static_cast<Index>(column);
    used_[column] = true;
    drafts_.push_back(std::move(draft));
  }

  void guess_channels() {
    std::set<std::pair<int, std::string>> taken;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (used_[i]) continue;
      Draft draft;
      draft.channel = channel_of(i);
      draft.unit_text = columns_[i].unit;
      const Guess guess = guess_of(columns_[i].stem, columns_[i].unit);
      if (guess.role != Role::kOther) {
        if (taken.insert({static_cast<int>(guess.role), guess.label}).second) {
          draft.channel.role = guess.role;
          draft.channel.name = guess.label;
          draft.rotation = guess.rotation;
          draft.rank = guess.rank;
        } else {
          out_.findings.push_back(finding(
              Severity::kNote, "role", draft.channel.name,
              "column \"" + columns_[i].heading + "\" looks like \"" + guess.label +
                  "\", which another column already is: it is kept aside; choose with a map"));
        }
      }
      add(i, std::move(draft));
    }
  }

  bool any(Role role, bool rotation) const {
    return std::any_of(drafts_.begin(), drafts_.end(), [&](const Draft& d) {
      return d.channel.role == role && d.rotation == rotation;
    });
  }

  void set_aside(Draft& draft, const std::string& why) {
    draft.channel.role = Role::kOther;
    draft.channel.axis = 0;
    out_.findings.push_back(finding(Severity::kNote, "role", draft.channel.name,
                                    "channel \"" + draft.channel.name + "\" is kept aside: " + why +
                                        "; choose otherwise with a map"));
  }

  // Positions and forces of one analysis share their axes: a six-axis sensor on a planar robot
  // offers more than the motion has, and a robot's joints stand beside its endpoint.
  void keep_matching_axes() {
    const bool linear = any(Role::kPosition, false);
    const bool angular = any(Role::kPosition, true);
    const bool force = any(Role::kForce, false);
    const bool torque = any(Role::kForce, true);
    if (!(linear || angular)) return;
    // "position" without a unit beside a torque is an angle.
    if (linear && !angular && torque && !force) {
      for (Draft& d : drafts_) {
        if ((d.channel.role == Role::kPosition || d.channel.role == Role::kReference) &&
            d.unit_text.empty()) {
          d.rotation = true;
        }
      }
    }
    bool rotation = !any(Role::kPosition, false);
    if (any(Role::kPosition, false) && any(Role::kPosition, true)) rotation = torque && !force;
    for (Draft& d : drafts_) {
      if (d.channel.role == Role::kOther || d.rotation == rotation) continue;
      if (d.channel.role == Role::kReference && d.unit_text.empty()) {
        d.rotation = rotation;
        continue;
      }
      if (d.channel.role == Role::kPosition) {
        set_aside(
            d, rotation ? "the torques belong to the angles" : "the forces belong to the endpoint");
      } else if (d.channel.role == Role::kForce && rotation != d.rotation &&
                 (rotation ? torque : force)) {
        set_aside(d, rotation ? "the motion is a rotation" : "the motion is a translation");
      } else if (d.channel.role == Role::kReference) {
        set_aside(d, "its unit is not that of the motion");
      }
    }
    std::set<int> axes;
    for (const Draft& d : drafts_) {
      if (d.channel.role == Role::kPosition) axes.insert(d.rank);
    }
    for (Draft& d : drafts_) {
      const bool dependent = d.channel.role == Role::kForce || d.channel.role == Role::kReference;
      // Letters and numbers are compared among themselves; a single axis needs no label.
      const bool comparable = axes.size() > 1 || *axes.begin() < 1000;
      if (dependent && comparable && d.rank != 0 && d.rank < 1000 && axes.count(d.rank) == 0 &&
          (*axes.begin() < 10) == (d.rank < 10) &&
          !(axes.size() == 1 && *axes.begin() == 0 && count(d.channel.role) == 1)) {
        set_aside(d, "the motion has no such axis");
      }
    }
  }

  std::size_t count(Role role) const {
    return static_cast<std::size_t>(std::count_if(
        drafts_.begin(), drafts_.end(), [&](const Draft& d) { return d.channel.role == role; }));
  }

  void apply_rules() {
    std::set<std::string> names;
    for (const ChannelRule& rule : rules_.channels) {
      const auto at = static_cast<std::size_t>(column_named(columns_, rule.source, "map"));
      if (static_cast<Index>(at) == out_.time) {
        throw Error(Fault::kArgument, "map",
                    "column \"" + rule.source + "\" is the time: remove its [[channel]] table",
                    "column " + rule.source);
      }
      if (used_[at]) {
        throw Error(Fault::kArgument, "map",
                    "column \"" + rule.source + "\" is used twice: give it one rule",
                    "column " + rule.source);
      }
      if (rule.sign != 1 && rule.sign != -1) {
        throw Error(Fault::kArgument, "map",
                    "the sign of column \"" + rule.source + "\" must be 1 or -1",
                    "column " + rule.source);
      }
      Draft draft;
      draft.by_rule = true;
      draft.unit_given = !rule.unit.empty();
      draft.channel = channel_of(at);
      draft.unit_text = rule.unit.empty() ? columns_[at].unit : rule.unit;
      draft.channel.source_unit = draft.unit_text;
      const Guess guess =
          guess_of(rule.name.empty() ? columns_[at].stem : rule.name, draft.unit_text);
      draft.channel.role = rule.role.value_or(guess.role);
      draft.rotation =
          guess.role != Role::kOther ? guess.rotation : is_unit_of(draft.unit_text, {"rad", "Nm"});
      draft.rank = guess.role != Role::kOther ? guess.rank : 0;
      draft.axis_fixed = rule.axis.has_value();
      draft.channel.axis = rule.axis.value_or(0);
      draft.channel.sign = rule.sign;
      draft.channel.frame = rule.frame;
      if (!rule.name.empty()) {
        draft.channel.name = rule.name;
      } else if (guess.role != Role::kOther && guess.role == draft.channel.role) {
        draft.channel.name = guess.label;
      }
      if (!names.insert(draft.channel.name).second) {
        throw Error(Fault::kArgument, "map",
                    "two rules give the name \"" + draft.channel.name + "\": rename one",
                    "channel " + draft.channel.name);
      }
      add(at, std::move(draft));
    }
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (used_[i]) continue;
      Draft draft;
      draft.channel = channel_of(i);
      draft.unit_text = columns_[i].unit;
      add(i, std::move(draft));
    }
  }

  // Axes count from 0 within a role, in the order of the positions' axes, so that the n-th force
  // belongs to the n-th position.
  void number_axes() {
    std::vector<int> ranks;
    for (const Draft& d : drafts_) {
      if (d.channel.role == Role::kPosition && !d.axis_fixed) ranks.push_back(d.rank);
    }
    std::sort(ranks.begin(), ranks.end());
    for (const Role role : {Role::kPosition, Role::kForce, Role::kReference}) {
      std::vector<Draft*> members;
      for (Draft& d : drafts_) {
        if (d.channel.role == role && !d.axis_fixed) members.push_back(&d);
      }
      std::stable_sort(members.begin(), members.end(),
                       [](const Draft* a, const Draft* b) { return a->rank < b->rank; });
      for (std::size_t i = 0; i < members.size(); ++i) {
        const auto at = std::find(ranks.begin(), ranks.end(), members[i]->rank);
        const bool unique = std::count(ranks.begin(), ranks.end(), members[i]->rank) == 1;
        const auto index =
            at != ranks.end() && unique ? at - ranks.begin() : static_cast<std::ptrdiff_t>(i);
        members[i]->channel.axis = static_cast<int>(index);
      }
    }
  }

  void name_channels() {
    std::set<std::string> names;
    for (const Draft& d : drafts_) {
      if (d.by_rule || d.channel.role != Role::kOther) names.insert(d.channel.name);
    }
    for (Draft& d : drafts_) {
      if (d.by_rule || d.channel.role != Role::kOther) continue;
      // "x [m]" beside "x [V]", or a rule's name that is also a column: the column keeps its
      // heading.
      if (names.count(d.channel.name) > 0) d.channel.name = d.channel.source_name;
      while (names.count(d.channel.name) > 0) d.channel.name += "_other";
      names.insert(d.channel.name);
    }
  }

  static std::string assumed_unit(const Draft& draft) {
    switch (draft.channel.role) {
      case Role::kPosition:
      case Role::kReference:
        return draft.rotation ? "rad" : "m";
      case Role::kForce:
        return draft.rotation ? "Nm" : "N";
      case Role::kOther:
        break;
    }
    return {};
  }

  void convert_units() {
    for (Draft& d : drafts_) {
      Channel& channel = d.channel;
      const std::string name = "\"" + channel.name + "\"";
      std::string text = d.unit_text;
      if (text.empty() && channel.role != Role::kOther) {
        text = assumed_unit(d);
        out_.findings.push_back(finding(
            Severity::kNote, "unit_missing", channel.name,
            "channel " + name + " has no unit: " + text + " is assumed; say otherwise with a map"));
      }
      std::optional<Unit> unit = parse_unit(text);
      if (!unit && !text.empty() && (channel.role != Role::kOther || d.unit_given)) {
        throw Error(Fault::kArgument, "unit",
                    "column \"" + channel.source_name + "\" has the unknown unit \"" + text +
                        "\"; known are " + known_units() + ": set the unit in a map",
                    "column " + channel.source_name);
      }
      if (!unit && !text.empty()) {
        out_.findings.push_back(finding(Severity::kNote, "unit_unknown", channel.name,
                                        "channel " + name + " has the unknown unit \"" + text +
                                            "\": its values are kept as they are"));
      }
      channel.unit = unit ? unit->si : text;
      const double factor = unit ? unit->factor : 1.0;
      const bool motion = channel.role == Role::kPosition || channel.role == Role::kReference;
      const bool odd = (motion && !among(channel.unit, {"m", "rad", "1"})) ||
                       (channel.role == Role::kForce && !among(channel.unit, {"N", "Nm"}));
      if (odd) {
        out_.findings.push_back(finding(
            Severity::kWarning, "unit", channel.name,
            "channel " + name + " is a " + (motion ? "position" : "force") + " in \"" +
                channel.unit + "\": check that the columns are not swapped, or calibrate it"));
      }
      out_.columns.push_back(d.column);
      out_.factors.push_back(channel.sign < 0 ? -factor : factor);
      out_.channels.push_back(std::move(channel));
    }
  }

  const std::vector<Column>& columns_;
  const MappingRules& rules_;
  std::vector<bool> used_;
  std::vector<Draft> drafts_;
  Mapping out_;
};

}  // namespace

std::string list_of(const std::vector<Column>& columns) {
  std::string text;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (text.size() + columns[i].heading.size() > 380) {
      return text + " and " + std::to_string(columns.size() - i) + " more";
    }
    (text += text.empty() ? "" : ", ") += columns[i].heading;
  }
  return text;
}

Mapping map_columns(const std::vector<Column>& columns, const MappingRules& rules) {
  return Mapper(columns, rules).run();
}

}  // namespace ulna
