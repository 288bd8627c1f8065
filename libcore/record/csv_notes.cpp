#include "record/csv_notes.hpp"

#include <charconv>

#include "base/error.hpp"
#include "record/units.hpp"

namespace ulna {
namespace {

std::string escaped(const std::string& text) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const auto u = static_cast<unsigned char>(c);
    if (c == ';' || c == '%' || u < 0x20u || u == 0x7fu) {
      out += '%';
      out += kHex[u >> 4];
      out += kHex[u & 15u];
    } else {
      out += c;
    }
  }
  return out;
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

std::string unescaped(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && hex_value(text[i + 1]) >= 0 &&
        hex_value(text[i + 2]) >= 0) {
      out += static_cast<char>(16 * hex_value(text[i + 1]) + hex_value(text[i + 2]));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

[[noreturn]] void refuse_note(const std::string& line) {
  throw Error(Fault::kFormat, "path",
              "the comment \"#ulna " + line.substr(0, 60) +
                  "\" is damaged: remove the #ulna lines to read the table without them");
}

// Takes blank-separated words off the front of a line.
class NoteWords {
 public:
  explicit NoteWords(const std::string& line) : line_(line), rest_(line) {}

  std::string_view word() {
    const std::size_t stop = std::min(rest_.find(' '), rest_.size());
    const std::string_view out = rest_.substr(0, stop);
    rest_.remove_prefix(std::min(stop + 1, rest_.size()));
    return out;
  }
  template <class Number>
  Number number() {
    const std::string_view text = word();
    Number value{};
    const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
    if (result.ec != std::errc() || result.ptr != text.data() + text.size()) refuse_note(line_);
    return value;
  }
  std::string until(char end) {
    const std::size_t stop = std::min(rest_.find(end), rest_.size());
    const std::string out = unescaped(rest_.substr(0, stop));
    rest_.remove_prefix(std::min(stop + 1, rest_.size()));
    return out;
  }

 private:
  const std::string& line_;
  std::string_view rest_;
};

}  // namespace

Notes parse_notes(const std::vector<std::string>& lines) {
  Notes notes;
  notes.present = !lines.empty();
  for (const std::string& line : lines) {
    NoteWords words(line);
    const std::string_view kind = words.word();
    if (kind == "rate_hz") {
      notes.rate_hz = words.number<double>();
    } else if (kind == "channel") {
      Notes::ChannelNote note;
      note.column = words.number<std::size_t>();
      const int role = words.number<int>();
      if (role < 0 || role > 3) refuse_note(line);
      note.channel.role = static_cast<Role>(role);
      note.channel.axis = words.number<int>();
      note.channel.sign = words.number<int>();
      note.channel.frame = words.until(';');
      note.channel.source_name = words.until(';');
      note.channel.source_unit = words.until(';');
      notes.channels.push_back(std::move(note));
    } else if (kind == "trial") {
      const Index begin = words.number<Index>();
      notes.trials.push_back({begin, words.number<Index>()});
    } else if (kind == "segment") {
      const Index begin = words.number<Index>();
      const Index end = words.number<Index>();
      notes.segments.push_back({begin, end, words.number<int>()});
    } else if (kind == "provenance") {
      notes.provenance.push_back(words.until('\n'));
    } else {
      refuse_note(line);
    }
  }
  return notes;
}

std::string format_notes(const Record& record) {
  char number[40];
  const auto result = std::to_chars(number, number + sizeof number, record.rate_hz());
  std::string out = "#ulna rate_hz " + std::string(number, result.ptr) + "\n";
  for (std::size_t i = 0; i < record.channels().size(); ++i) {
    const Channel& c = record.channels()[i];
    out += "#ulna channel " + std::to_string(i + 1) + " " +
           std::to_string(static_cast<int>(c.role)) + " " + std::to_string(c.axis) + " " +
           std::to_string(c.sign) + " " + escaped(c.frame) + ";" + escaped(c.source_name) + ";" +
           escaped(c.source_unit) + "\n";
  }
  for (const Trial& t : record.trials()) {
    out += "#ulna trial " + std::to_string(t.begin) + " " + std::to_string(t.end) + "\n";
  }
  for (const Segment& s : record.segments()) {
    out += "#ulna segment " + std::to_string(s.begin) + " " + std::to_string(s.end) + " " +
           std::to_string(s.trial) + "\n";
  }
  for (const std::string& line : record.provenance())
    out += "#ulna provenance " + escaped(line) + "\n";
  return out;
}

void apply_notes(const Notes& notes, const std::vector<Column>& columns, Mapping& mapping) {
  if (columns.size() != notes.channels.size() + 1) {
    throw Error(Fault::kFormat, "path",
                "the #ulna comments describe " + std::to_string(notes.channels.size()) +
                    " channels, but the table has " + std::to_string(columns.size()) +
                    " columns: remove the #ulna lines to read the table without them");
  }
  Mapping own;
  own.time = 0;
  for (std::size_t i = 0; i < notes.channels.size(); ++i) {
    const Notes::ChannelNote& note = notes.channels[i];
    if (note.column != i + 1) {
      throw Error(
          Fault::kFormat, "path",
          "the #ulna comments number the columns wrongly: remove the #ulna lines to read the "
          "table without them");
    }
    Channel channel = note.channel;
    channel.name = columns[note.column].stem;
    channel.unit = columns[note.column].unit;
    own.columns.push_back(static_cast<Index>(note.column));
    own.factors.push_back(1.0);
    own.channels.push_back(std::move(channel));
  }
  mapping = std::move(own);
}

}  // namespace ulna
