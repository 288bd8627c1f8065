#include "record/csv_layout.hpp"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>

#include "base/error.hpp"
#include "record/units.hpp"

namespace ulna {
namespace {

constexpr std::size_t kSampleLines = 500;
constexpr std::size_t kMostColumns = 10000;

[[noreturn]] void refuse(const std::string& message, const std::string& detail = {}) {
  throw Error(Fault::kFormat, "path", message, detail);
}

bool starts_with(std::string_view text, std::string_view with) {
  return text.substr(0, with.size()) == with;
}

// Binary kinds that people hand to a text reader, by their first bytes.
void refuse_binary(std::string_view head) {
  if (starts_with(head, "MATLAB 5.0") || starts_with(head, "MATLAB 7.3")) {
    refuse("this is a MATLAB file, not a text table: name it *.mat or give its format");
  }
  if (starts_with(head, "\x89HDF")) {
    refuse("this is an HDF5 file, not a text table: name it *.h5 or give its format");
  }
  if (starts_with(head, "PK\x03\x04")) {
    refuse("this is a zip archive (a spreadsheet or .npz), not a text table: export it as CSV");
  }
  if (starts_with(head, "\xFF\xFE") || starts_with(head, "\xFE\xFF")) {
    refuse("the text is UTF-16: save it as UTF-8");
  }
  std::size_t odd = 0;
  for (std::size_t i = 0; i < head.size(); ++i) {
    const auto c = static_cast<unsigned char>(head[i]);
    if (c == 0)
      refuse("the file is binary (a zero byte at offset " + std::to_string(i) +
             "), not a text table");
    odd += c < 0x20u && (c < 0x09u || c > 0x0du) ? 1u : 0u;
  }
  if (odd * 50 > head.size()) refuse("the file is binary, not a text table");
}

struct TextLine {
  std::string_view text;
  Index number = 0;  // 0-based in the file
};

bool numeric(std::string_view cell, char decimal) {
  double ignored = 0.0;
  return parse_cell(cell, decimal, ignored);
}

bool has_number(const std::vector<std::string>& cells, char decimal) {
  return std::any_of(cells.begin(), cells.end(), [&](const std::string& cell) {
    double value = 0.0;
    return parse_cell(cell, decimal, value) && value == value;
  });
}

// A line of data: numbers and blanks only, at least one number.
bool is_data(const std::vector<std::string>& cells, char decimal) {
  return has_number(cells, decimal) &&
         std::all_of(cells.begin(), cells.end(),
                     [&](const std::string& c) { return numeric(c, decimal); });
}

struct Dialect {
  char delimiter = ',';
  char decimal = '.';
  double score = -1.0;
};

// The share of cells that are numbers in lines of the commonest width; wider tables win a tie only
// by the order of the candidates.
Dialect find_dialect(const std::vector<TextLine>& lines, const CsvOptions& options) {
  const std::size_t begin = lines.size() > 3 ? 1 : 0;
  Dialect best;
  for (const char delimiter : {'\t', ';', ',', '|', ' '}) {
    if (options.delimiter != 0 && options.delimiter != delimiter) continue;
    for (const char decimal : {'.', ','}) {
      if (options.decimal != 0 && options.decimal != decimal) continue;
      if (decimal == ',' && delimiter == ',') continue;
      std::map<std::size_t, std::pair<std::size_t, std::size_t>> widths;  // width: lines, numbers
      for (std::size_t i = begin; i < lines.size(); ++i) {
        const std::vector<std::string> cells = split_cells(lines[i].text, delimiter);
        auto& [count, numbers] = widths[cells.size()];
        ++count;
        for (const std::string& cell : cells) numbers += numeric(cell, decimal) ? 1u : 0u;
      }
      Dialect here{delimiter, decimal, 0.0};
      for (const auto& [width, tally] : widths) {
        if (width < 2) continue;
        here.score = std::max(here.score, static_cast<double>(tally.second) /
                                              static_cast<double>(width * (lines.size() - begin)));
      }
      if (here.score > best.score + 1e-12) best = here;
    }
  }
  if (best.score > 0.0) return best;
  // One column, or no numbers at all.
  best.delimiter = options.delimiter != 0 ? options.delimiter : ',';
  if (best.delimiter == ',' && options.delimiter == 0 && !lines.empty()) {
    for (const char delimiter : {'\t', ';', ',', '|'}) {
      if (lines[0].text.find(delimiter) != std::string_view::npos) {
        best.delimiter = delimiter;
        break;
      }
    }
  }
  best.decimal = options.decimal != 0 ? options.decimal : '.';
  if (options.decimal == 0 && best.delimiter != ',') {
    std::size_t points = 0, commas = 0;
    for (const TextLine& line : lines) {
      points += numeric(line.text, '.') ? 1u : 0u;
      commas += numeric(line.text, ',') ? 1u : 0u;
    }
    if (commas > points) best.decimal = ',';
  }
  return best;
}

std::string in_quotes(std::string_view text) {
  std::string out = "\"";
  for (const char c : text.substr(0, 40)) {
    const auto u = static_cast<unsigned char>(c);
    out += u < 0x20u || u == 0x7fu ? '?' : c;
  }
  return out + (text.size() > 40 ? "...\"" : "\"");
}

// A word for what separates the columns when none of the known signs does.
void refuse_foreign_delimiter(std::string_view header, char delimiter) {
  const char* names[] = {"a tab", "a semicolon", "a comma", "a vertical bar"};
  const char signs[] = {'\t', ';', ',', '|'};
  for (std::size_t i = 0; i < 4; ++i) {
    if (signs[i] == delimiter || header.find(signs[i]) == std::string_view::npos) continue;
    refuse("only one column was found, but the heading " + in_quotes(header) + " holds " +
           names[i] + ": set the delimiter to it");
  }
  for (const char sign : {':', '/', '&', '!', '~', '^', '*', ' '}) {
    if (header.find(sign) == std::string_view::npos) continue;
    refuse("only one column of text was found in " + in_quotes(header) +
           ": separate columns by a comma, semicolon, tab, vertical bar or blanks");
  }
}

bool is_units_row(const std::vector<std::string>& cells) {
  bool some = false;
  for (std::string cell : cells) {
    if (cell.size() >= 2 && (cell.front() == '[' || cell.front() == '(') &&
        (cell.back() == ']' || cell.back() == ')')) {
      cell = cell.substr(1, cell.size() - 2);
      some = true;
    }
    if (cell.empty()) continue;
    if (!parse_unit(cell)) return false;
    some = some || (cell != "1" && cell != "-");
  }
  return some;
}

std::string unbracketed(const std::string& cell) {
  if (cell.size() >= 2 && (cell.front() == '[' || cell.front() == '(')) {
    return cell.substr(1, cell.size() - 2);
  }
  return cell;
}

void name_columns(Layout& layout, const std::vector<std::string>* names, std::size_t width) {
  for (std::size_t i = 0; i < width; ++i) {
    const std::string number = std::string("c").append(std::to_string(i + 1));
    if (names == nullptr || (*names)[i].empty()) {
      layout.columns.push_back({number, number, {}});
      continue;
    }
    Column column{(*names)[i], {}, {}};
    for (char& c : column.heading) {
      const auto u = static_cast<unsigned char>(c);
      if (u < 0x20u || u == 0x7fu) c = '?';
    }
    Heading heading = parse_heading(column.heading);
    column.stem = heading.stem;
    column.unit = heading.unit;
    layout.columns.push_back(std::move(column));
  }
  std::map<std::string, std::size_t> seen;
  for (std::size_t i = 0; i < width; ++i) {
    const auto [at, fresh] = seen.insert({layout.columns[i].heading, i});
    if (fresh) continue;
    refuse("columns " + std::to_string(at->second + 1) + " and " + std::to_string(i + 1) +
               " are both named " + in_quotes(layout.columns[i].heading) + ": rename one",
           "column " + layout.columns[i].heading);
  }
}

void refuse_no_data(bool any_text, const std::string_view first) {
  if (!any_text) refuse("the file holds no table: it is empty but for blanks and comments");
  refuse("the file has a heading (" + in_quotes(first) + ") but no rows of data");
}

}  // namespace

bool is_comment(std::string_view line) noexcept {
  const std::string_view text = trimmed(line);
  return !text.empty() && (text[0] == '#' || text[0] == '%' || text.substr(0, 2) == "//");
}

std::vector<std::string> split_cells(std::string_view line, char delimiter) {
  std::vector<std::string> cells;
  std::size_t at = 0;
  if (delimiter == ' ') line = trimmed(line);
  while (true) {
    while (at < line.size() && (line[at] == ' ' || (line[at] == '\t' && delimiter != '\t'))) ++at;
    std::string cell;
    if (at < line.size() && line[at] == '"') {
      ++at;
      while (at < line.size()) {
        if (line[at] == '"') {
          if (at + 1 < line.size() && line[at + 1] == '"') {
            cell += '"';
            at += 2;
            continue;
          }
          ++at;
          break;
        }
        cell += line[at++];
      }
    }
    const std::size_t begin = at;
    while (at < line.size() && line[at] != delimiter && !(delimiter == ' ' && line[at] == '\t'))
      ++at;
    cell += trimmed(line.substr(begin, at - begin));
    cells.push_back(std::move(cell));
    if (at >= line.size()) return cells;
    ++at;
  }
}

bool parse_cell(std::string_view cell, char decimal, double& value) noexcept {
  cell = trimmed(cell);
  if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') {
    cell = trimmed(cell.substr(1, cell.size() - 2));
  }
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (cell.empty()) {
    value = kNan;
    return true;
  }
  const char* begin = cell.data();
  const char* end = begin + cell.size();
  if (*begin == '+' && cell.size() > 1 && begin[1] != '-') ++begin;
  char copy[64];
  if (decimal == ',') {
    const std::size_t comma = cell.find(',');
    if (comma != std::string_view::npos) {
      const std::size_t size = static_cast<std::size_t>(end - begin);
      const bool digit =
          comma + 1 < cell.size() && cell[comma + 1] >= '0' && cell[comma + 1] <= '9';
      if (size > sizeof copy || !digit) return false;
      std::copy(begin, end, copy);
      copy[static_cast<std::size_t>(cell.data() + comma - begin)] = '.';
      begin = copy;
      end = copy + size;
    }
  }
  const std::from_chars_result result = std::from_chars(begin, end, value);
  if (result.ec == std::errc() && result.ptr == end) {
    if (value != value) value = kNan;  // "-nan" and "nan(...)": one NaN for all
    return true;
  }
  if (result.ec == std::errc::result_out_of_range && result.ptr == end) {
    // Too small for a double is zero; too large is no measurement.
    const std::string_view text(begin, static_cast<std::size_t>(end - begin));
    const std::size_t exponent = text.find_first_of("eE");
    const bool small = exponent == std::string_view::npos
                           ? text.substr(0, 3) == "0.0" || text.substr(0, 4) == "-0.0"
                           : text.substr(exponent + 1, 1) == "-";
    value = 0.0;
    return small;
  }
  for (const std::string_view nothing : {"-", "--", "NA", "N/A", "n/a", "#N/A", "null", "NULL",
                                         "None", "1.#QNAN", "-1.#IND", "NaN.0"}) {
    if (cell == nothing) {
      value = kNan;
      return true;
    }
  }
  return false;
}

Layout find_layout(std::string_view head, bool all, const CsvOptions& options) {
  if (head.empty()) refuse("the file is empty");
  refuse_binary(head);
  Layout layout;
  if (starts_with(head, "\xEF\xBB\xBF")) {
    layout.byte_order_mark = true;
    head.remove_prefix(3);
  }
  if (head.find('\n') == std::string_view::npos && head.find('\r') != std::string_view::npos) {
    layout.end_of_line = '\r';
  }

  std::vector<TextLine> lines;
  TextLine comment;
  Index number = 0;
  for (std::size_t at = 0; at < head.size() && lines.size() < kSampleLines; ++number) {
    std::size_t stop = head.find(layout.end_of_line, at);
    if (stop == std::string_view::npos) {
      // A line cut by the end of the head is judged only when there is no other.
      if (!all && !lines.empty()) break;
      stop = head.size();
    }
    std::string_view text = head.substr(at, stop - at);
    at = stop + 1;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    if (number < options.skip_rows || trimmed(text).empty()) continue;
    if (is_comment(text)) {
      if (starts_with(text, "#ulna ")) {
        layout.notes.emplace_back(text.substr(6));
      } else if (lines.empty()) {
        comment = {text, number};
      }
      continue;
    }
    lines.push_back({text, number});
  }
  if (lines.empty()) refuse_no_data(false, {});

  const Dialect dialect = find_dialect(lines, options);
  layout.delimiter = dialect.delimiter;
  layout.decimal = dialect.decimal;

  std::vector<std::vector<std::string>> rows;
  for (const TextLine& line : lines) rows.push_back(split_cells(line.text, layout.delimiter));
  std::size_t first = 0;
  while (first < rows.size() && !is_data(rows[first], layout.decimal)) ++first;
  // A heading with half of its cells numbers is a row of data with text in it.
  if (options.header == Header::kAbsent && first > 0) {
    refuse("line " + std::to_string(lines[0].number + 1) +
               " holds text, but the file is said to have no heading: skip that line or allow a "
               "heading",
           "line " + std::to_string(lines[0].number + 1));
  }
  if (first == rows.size()) {
    if (rows[0].size() == 1 && rows.size() > 1)
      refuse_foreign_delimiter(lines[0].text, layout.delimiter);
    if (rows.size() > 1 && !is_units_row(rows[1])) {
      const std::size_t last = rows.size() - 1;
      refuse("no row of numbers was found: line " + std::to_string(lines[last].number + 1) +
                 " is " + in_quotes(lines[last].text) + "; check delimiter and decimal sign",
             "line " + std::to_string(lines[last].number + 1));
    }
    refuse_no_data(true, lines[0].text);
  }
  const bool header_in_data = options.header == Header::kPresent && first == 0;
  if (header_in_data) first = 1;
  if (first == rows.size()) refuse_no_data(true, lines[0].text);

  std::size_t width = rows[first].size();
  // A delimiter at the end of every line makes no column.
  const bool trailing =
      width > 1 && rows[first].back().empty() && layout.delimiter != ' ' &&
      std::all_of(rows.begin() + static_cast<std::ptrdiff_t>(first), rows.end(),
                  [&](const auto& row) { return row.size() != width || row.back().empty(); });
  layout.first_data_line = lines[first].number;

  const std::vector<std::string>* names = nullptr;
  const std::vector<std::string>* units = nullptr;
  std::vector<std::string> from_comment;
  std::size_t heading = first;
  if (first > 0) {
    heading = first - 1;
    if (heading > 0 && is_units_row(rows[heading]) && rows[heading].size() >= width - 1) {
      units = &rows[heading];
      --heading;
    }
    names = &rows[heading];
    layout.skipped = static_cast<Index>(heading);
  } else if (comment.text.data() != nullptr && options.header != Header::kAbsent) {
    // numpy.savetxt and others put the heading into a comment.
    std::string_view text = trimmed(comment.text);
    text.remove_prefix(std::min(text.find_first_not_of("#%/"), text.size()));
    from_comment = split_cells(text, layout.delimiter);
    if (from_comment.size() == width && width > 1 && !has_number(from_comment, layout.decimal)) {
      names = &from_comment;
    }
  }
  if (trailing && (names == nullptr || names->size() < width || names->back().empty())) --width;
  if (width > kMostColumns) {
    refuse("the table has " + std::to_string(width) + " columns, more than " +
           std::to_string(kMostColumns) + ": check the delimiter");
  }
  if (names != nullptr) {
    const std::string where =
        "line " + std::to_string(lines[std::min(heading, lines.size() - 1)].number + 1);
    std::size_t count = names->size();
    while (count > width && (*names)[count - 1].empty()) --count;
    if (count != width) {
      if (count == 1 && lines[heading].text.find_first_of(",;\t|") != std::string_view::npos) {
        refuse("the heading " + in_quotes(lines[heading].text) +
                   " is separated by another sign than the rows below it: use one delimiter "
                   "throughout",
               where);
      }
      refuse("the heading (" + where + ") has " + std::to_string(count) +
                 " names, but the rows have " + std::to_string(width) +
                 " cells: name every column, or set the delimiter",
             where);
    }
    std::size_t numbers = 0;
    for (std::size_t i = 0; i < width; ++i) {
      numbers += !(*names)[i].empty() && numeric((*names)[i], layout.decimal) ? 1u : 0u;
    }
    if (2 * numbers > width && !header_in_data) {
      std::size_t at = 0;
      while (numeric((*names)[at], layout.decimal)) ++at;
      refuse("column " + std::to_string(at + 1) + " of " + where + " holds the text " +
                 in_quotes((*names)[at]) + " where a number is expected",
             where);
    }
  }
  layout.header = names != nullptr;
  name_columns(layout, names, width);
  if (units != nullptr) {
    for (std::size_t i = 0; i < width && i < units->size(); ++i) {
      const std::string unit = unbracketed((*units)[i]);
      if (unit.empty()) continue;
      // A row of units beats an ending of the name, which may be chance.
      layout.columns[i].unit = unit;
    }
  }
  return layout;
}

}  // namespace ulna
