#include "record/csv.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <sstream>

#include "base/error.hpp"
#include "record/csv_layout.hpp"
#include "record/csv_lines.hpp"
#include "record/csv_notes.hpp"
#include "record/look.hpp"
#include "record/units.hpp"

namespace ulna {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Rows as they are read, in blocks: nothing is ever copied to grow, and a block is given back as
// soon as it has been turned into columns, so the peak is one copy of the numbers.
class Rows {
 public:
  explicit Rows(std::size_t width)
      : width_(width), per_block_(std::max<std::size_t>(64, (std::size_t{1} << 19) / width)) {}

  double* next() {
    if (blocks_.empty() || filled_ == per_block_) {
      // Not zeroed: every cell is written before the row counts.
      blocks_.emplace_back(new double[per_block_ * width_]);
      filled_ = 0;
    }
    return blocks_.back().get() + filled_ * width_;
  }
  void keep() noexcept { ++filled_; }
  Index count() const noexcept {
    if (blocks_.empty()) return 0;
    return static_cast<Index>((blocks_.size() - 1) * per_block_ + filled_);
  }

  // From the last block to the first, so that the allocator can return each.
  void move_to(const Mapping& mapping, std::vector<double>& time, Matrix& values, Token* token) {
    const auto rows = static_cast<std::size_t>(count());
    time.resize(mapping.time >= 0 ? rows : 0);
    values.resize(count(), static_cast<Index>(mapping.columns.size()));
    while (!blocks_.empty()) {
      const std::size_t begin = (blocks_.size() - 1) * per_block_;
      const std::size_t size = rows - begin < per_block_ ? rows - begin : per_block_;
      const double* block = blocks_.back().get();
      if (mapping.time >= 0) {
        copy(block + mapping.time, size, mapping.time_factor, time.data() + begin);
      }
      for (std::size_t c = 0; c < mapping.columns.size(); ++c) {
        copy(block + mapping.columns[c], size, mapping.factors[c],
             values.data() + static_cast<Index>(c) * values.rows() + static_cast<Index>(begin));
      }
      blocks_.pop_back();
      step(token, 0.9);
    }
  }

 private:
  void copy(const double* from, std::size_t size, double factor, double* to) const noexcept {
    // A factor of one multiplies nothing, so that a value written by us keeps its bits.
    if (factor == 1.0) {
      for (std::size_t i = 0; i < size; ++i) to[i] = from[i * width_];
    } else {
      for (std::size_t i = 0; i < size; ++i) to[i] = factor * from[i * width_];
    }
  }

  std::size_t width_;
  std::size_t per_block_;
  std::size_t filled_ = 0;
  std::vector<std::unique_ptr<double[]>> blocks_;
};

// Where rows stand in the file: lines that hold no row shift everything after them.
class LineNumbers {
 public:
  void note(Index row, Index line) {
    if (shifts_.empty() || line - row != shifts_.back().second - shifts_.back().first) {
      shifts_.emplace_back(row, line);
    }
  }
  Index line_of(Index row) const {
    const auto after = std::upper_bound(shifts_.begin(), shifts_.end(), row,
                                        [](Index r, const auto& shift) { return r < shift.first; });
    if (after == shifts_.begin()) return row;
    return std::prev(after)->second + row - std::prev(after)->first;
  }

 private:
  std::vector<std::pair<Index, Index>> shifts_;
};

enum class Parse { kRow, kFewer, kMore, kText };

struct Outcome {
  Parse parse = Parse::kRow;
  std::size_t cells = 0;
  std::size_t bad = 0;  // first cell that is no number
  bool last_empty = false;
};

bool blank(char c) noexcept { return c == ' ' || c == '\t' || c == '\r'; }

// Plain numbers without quotes; false hands the line to the careful parser.
bool parse_fast(std::string_view line, char delimiter, std::size_t width, double* out,
                bool& last_empty) noexcept {
  const char* at = line.data();
  const char* end = at + line.size();
  const auto is_blank = [delimiter](char c) {
    return c == ' ' || (c == '\t' && delimiter != '\t');
  };
  for (std::size_t i = 0; i < width; ++i) {
    while (at < end && is_blank(*at)) ++at;
    last_empty = at == end || *at == delimiter;
    if (last_empty) {
      if (delimiter == ' ') return false;
      out[i] = kNan;
    } else {
      const std::from_chars_result result = std::from_chars(at, end, out[i]);
      if (result.ec != std::errc()) return false;
      if (out[i] != out[i]) out[i] = kNan;
      at = result.ptr;
      if (delimiter == ' ') {
        if (at < end && !blank(*at)) return false;
        continue;
      }
      while (at < end && is_blank(*at)) ++at;
    }
    if (i + 1 < width) {
      if (at == end || *at != delimiter) return false;
      ++at;
    }
  }
  while (at < end && blank(*at)) ++at;
  return at == end;
}

Outcome parse_careful(std::string_view line, const Layout& layout, std::size_t width, double* out) {
  const std::vector<std::string> cells = split_cells(line, layout.delimiter);
  Outcome outcome;
  outcome.cells = cells.size();
  // A lone minus may stand for nothing, or be the beginning of a number that was cut off.
  outcome.last_empty = cells.back().empty() || cells.back() == "-";
  for (std::size_t i = 0; i < std::min(width, cells.size()); ++i) {
    if (parse_cell(cells[i], layout.decimal, out[i])) continue;
    outcome.parse = Parse::kText;
    outcome.bad = i;
    return outcome;
  }
  if (cells.size() < width) outcome.parse = Parse::kFewer;
  // One empty cell more is a delimiter at the end of the line.
  if (cells.size() > width + 1 || (cells.size() == width + 1 && !cells.back().empty())) {
    outcome.parse = Parse::kMore;
  }
  return outcome;
}

std::string shown(const std::string& cell) {
  std::string out = "\"";
  for (const char c : cell.substr(0, 32)) {
    const auto u = static_cast<unsigned char>(c);
    out += u < 0x20u || u == 0x7fu ? '?' : c;
  }
  return out + (cell.size() > 32 ? "...\"" : "\"");
}

class CsvReader {
 public:
  CsvReader(LineReader& lines, const CsvOptions& options, const std::string& name, Token* token)
      : lines_(lines),
        options_(options),
        name_(name),
        token_(token),
        layout_(find_layout(lines.head(), lines.head_is_all(), options)),
        width_(layout_.columns.size()),
        rows_(width_) {}

  ReadResult run() {
    // Rules are checked before a long file is read.
    const Notes notes = options_.map.channels.empty() ? parse_notes(layout_.notes) : Notes{};
    Mapping mapping = map_columns(layout_.columns, options_.map);
    if (notes.present) apply_notes(notes, layout_.columns, mapping);
    require_clock(mapping);
    read_rows();
    return finish(std::move(mapping), notes);
  }

 private:
  void require_clock(const Mapping& mapping) const {
    if (mapping.time >= 0 || options_.map.rate_hz > 0.0) return;
    throw Error(Fault::kArgument, "time",
                "no column is called time (the columns are " + list_of(layout_.columns) +
                    "): name the time column in a map, or give rate_hz");
  }

  void read_rows() {
    lines_.use_end(layout_.end_of_line);
    FileLine line;
    Index number = 0;
    std::uint64_t stepped = 0;
    std::string scratch;
    for (; lines_.next(line); ++number) {
      if (number < layout_.first_data_line) continue;
      if (lines_.consumed() - stepped > 65536) {
        stepped = lines_.consumed();
        step(token_, 0.85 * lines_.progress());
      }
      std::string_view text = line.text;
      if (number == 0 && layout_.byte_order_mark) text.remove_prefix(3);
      if (trimmed(text).empty() || is_comment(text)) continue;
      read_row(text, line.terminated, number, scratch);
    }
    if (rows_.count() == 0) {
      throw Error(Fault::kFormat, "path", "the file has a heading but no complete row of data");
    }
  }

  void read_row(std::string_view text, bool terminated, Index number, std::string& scratch) {
    double* out = rows_.next();
    std::string_view plain = text;
    if (layout_.decimal == ',') {
      scratch.assign(text);
      std::replace(scratch.begin(), scratch.end(), ',', '.');
      plain = scratch;
    }
    Outcome outcome;
    if (!parse_fast(plain, layout_.delimiter, width_, out, outcome.last_empty)) {
      outcome = parse_careful(text, layout_, width_, out);
    }
    // A file cut off in the middle of a line ends without an end of line; a cell cut to nothing or
    // to "1.2e" is the same thing.
    const bool cut = !terminated && width_ > 1 &&
                     (outcome.parse == Parse::kFewer || outcome.parse == Parse::kText ||
                      (outcome.parse == Parse::kRow && outcome.last_empty && !ends_often_empty_));
    if (cut) {
      findings_.push_back({Severity::kWarning, "truncated", "", rows_.count(), 1,
                           "the file ends in the middle of line " + std::to_string(number + 1) +
                               ": that line is left out; check that the recording is complete"});
      return;
    }
    if (outcome.parse != Parse::kRow) refuse_row(text, outcome, number);
    ends_often_empty_ = outcome.last_empty;
    line_numbers_.note(rows_.count(), number);
    rows_.keep();
  }

  [[noreturn]] void refuse_row(std::string_view text, const Outcome& outcome, Index number) const {
    const std::string where = "line " + std::to_string(number + 1);
    const std::string detail = "row " + std::to_string(rows_.count());
    if (outcome.parse == Parse::kText) {
      const std::string cell = split_cells(text, layout_.delimiter)[outcome.bad];
      throw Error(Fault::kFormat, "path",
                  where + ", column \"" + layout_.columns[outcome.bad].heading +
                      "\" holds the text " + shown(cell) +
                      " where a number is expected: correct it or leave the cell empty",
                  detail + ", column " + layout_.columns[outcome.bad].heading);
    }
    throw Error(Fault::kFormat, "path",
                where + " has " + std::to_string(outcome.cells) + " cells where " +
                    std::to_string(width_) + " are expected: correct or remove that line",
                detail);
  }

  void check_time(const std::vector<double>& time, const std::string& column) const {
    for (std::size_t i = 0; i < time.size(); ++i) {
      const bool bad = !std::isfinite(time[i]);
      if (!bad && (i == 0 || time[i] > time[i - 1])) continue;
      const auto row = static_cast<Index>(i);
      std::ostringstream text;
      text << "line " << line_numbers_.line_of(row) + 1 << ": the time (column \"" << column
           << "\") ";
      text.precision(15);
      if (bad) {
        text << "is no number: remove that line";
      } else {
        text << (time[i] == time[i - 1] ? "repeats" : "goes back from ")
             << (time[i] == time[i - 1] ? " " : "");
        text << time[i - 1] << " s";
        if (time[i] != time[i - 1]) text << " to " << time[i] << " s";
        text << ": put every trial into its own file, or give rate_hz when the clock is even";
      }
      throw Error(Fault::kData, "time", text.str(), "row " + std::to_string(i));
    }
  }

  std::string provenance(const Mapping& mapping, const Record::Parts& parts) const {
    const auto word = [](char c) -> std::string {
      switch (c) {
        case '\t':
          return "tab";
        case ' ':
          return "blanks";
        case ';':
          return "semicolon";
        case '|':
          return "bar";
        default:
          return "comma";
      }
    };
    std::string text = "read " + name_ + ": " + std::to_string(parts.values.rows()) + " rows, " +
                       std::to_string(parts.values.cols()) + " channels, " +
                       word(layout_.delimiter) + " separated";
    if (layout_.decimal == ',') text += ", decimal comma";
    if (mapping.time >= 0) {
      text += ", time from " + layout_.columns[static_cast<std::size_t>(mapping.time)].heading;
    } else {
      text += ", rate given";
    }
    for (std::size_t c = 0; c < mapping.columns.size() && c < 32; ++c) {
      const Channel& channel = mapping.channels[c];
      if (channel.sign == 1 && std::abs(mapping.factors[c]) == 1.0) continue;
      std::ostringstream factor;
      factor << mapping.factors[c];
      text += ", " + channel.name + " = " + factor.str() + " " + channel.source_name;
    }
    return text;
  }

  ReadResult finish(Mapping mapping, const Notes& notes) {
    Record::Parts parts;
    rows_.move_to(mapping, parts.time, parts.values, token_);
    Source source;
    source.delimiter = layout_.delimiter;
    source.decimal = layout_.decimal;
    source.header = layout_.header;
    source.skip_rows = options_.skip_rows;
    if (mapping.time >= 0) {
      const Column& clock = layout_.columns[static_cast<std::size_t>(mapping.time)];
      source.time_column = clock.heading;
      source.time_unit = !options_.map.time_unit.empty() ? options_.map.time_unit
                         : clock.unit.empty()            ? "s"
                                                         : clock.unit;
      if (notes.trials.empty()) check_time(parts.time, clock.heading);
    }
    parts.rate_hz = options_.map.rate_hz;
    parts.provenance = notes.provenance;
    parts.provenance.push_back(provenance(mapping, parts));
    parts.channels = std::move(mapping.channels);
    if (notes.present) {
      parts.trials = notes.trials;
      parts.segments = notes.segments;
      if (parts.rate_hz == 0.0) parts.rate_hz = notes.rate_hz;
    }
    if (layout_.skipped > 0) {
      findings_.push_back(
          {Severity::kNote, "skipped", "", 0, layout_.skipped,
           std::to_string(layout_.skipped) +
               " lines before the heading are no part of the table and were passed over"});
    }
    Record record = Record::make(std::move(parts));
    findings_.insert(findings_.end(), mapping.findings.begin(), mapping.findings.end());
    const std::vector<Finding> seen = look(record, token_);
    findings_.insert(findings_.end(), seen.begin(), seen.end());
    step(token_, 1.0);
    return {std::move(record), std::move(findings_), std::move(source)};
  }

  LineReader& lines_;
  const CsvOptions& options_;
  const std::string& name_;
  Token* token_;
  Layout layout_;
  std::size_t width_;
  Rows rows_;
  LineNumbers line_numbers_;
  bool ends_often_empty_ = false;
  std::vector<Finding> findings_;
};

void check_options(const CsvOptions& options) {
  const char d = options.delimiter;
  require(d == 0 || d == ',' || d == ';' || d == '\t' || d == '|' || d == ' ', "delimiter",
          "the delimiter must be a comma, semicolon, tab, vertical bar or blank");
  require(options.decimal == 0 || options.decimal == '.' || options.decimal == ',', "decimal",
          "the decimal sign must be a point or a comma");
  require(d == 0 || d != options.decimal, "decimal", "delimiter and decimal sign must differ");
  require(options.skip_rows >= 0, "skip_rows", "skip_rows must be 0 or more");
  require(std::isfinite(options.map.rate_hz) && options.map.rate_hz >= 0.0, "rate_hz",
          "rate_hz must be positive, or 0 for a time column");
}

ReadResult read(LineReader& lines, const CsvOptions& options, const std::string& name,
                Token* token) {
  step(token, 0.0);
  return CsvReader(lines, options, name, token).run();
}

}  // namespace

ReadResult read_csv(const std::string& path, const CsvOptions& options, Token* token) {
  check_options(options);
  LineReader lines(path);
  const std::string name =
      options.name.empty() ? std::filesystem::path(path).filename().string() : options.name;
  return read(lines, options, name, token);
}

ReadResult read_csv_memory(const char* data, std::size_t size, const CsvOptions& options,
                           Token* token) {
  check_options(options);
  LineReader lines(data, size);
  return read(lines, options, options.name.empty() ? "a text in memory" : options.name, token);
}

}  // namespace ulna
