#include "record/mvnx_frames.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

#include "base/error.hpp"
#include "record/csv_layout.hpp"

namespace ulna {
namespace {

// A frame of all elements of a suit has some 10 kB. Without a limit one that never ends would be
// read anew with every push.
constexpr std::size_t kLongestFrame = std::size_t{1} << 24;

bool is_blank(char c) noexcept { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; }

// Appends the numbers of a text; false: it holds something else.
bool append_numbers(std::string_view text, std::vector<double>& out) {
  const char* at = text.data();
  const char* const end = at + text.size();
  while (true) {
    while (at < end && is_blank(*at)) ++at;
    if (at == end) return true;
    double value = 0.0;
    const std::from_chars_result result = std::from_chars(at, end, value);
    if (result.ec == std::errc() && (result.ptr == end || is_blank(*result.ptr))) {
      out.push_back(value == value ? value : kNaN);
      at = result.ptr;
      continue;
    }
    const char* const stop = std::find_if(at, end, is_blank);
    const std::string_view word(at, static_cast<std::size_t>(stop - at));
    if (!parse_cell(word, '.', value)) return false;
    out.push_back(value);
    at = stop;
  }
}

std::string_view without_blanks(std::string_view text) noexcept {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

template <class Number>
bool whole_number(std::string_view text, Number& value) noexcept {
  text = without_blanks(text);
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc() && result.ptr == text.data() + text.size();
}

[[noreturn]] void refuse_frame(const std::string& message, const std::string& where) {
  throw Error(Fault::kFormat, "source", message, where);
}

const char* behind(std::string_view text) noexcept { return text.data() + text.size(); }

// As XML has it: blanks in attributes are spaces.
std::string one_line(std::string_view text) {
  std::string out(text);
  std::replace_if(
      out.begin(), out.end(), [](char c) { return c >= 0 && c < ' '; }, ' ');
  return out;
}

// A text of the file in a message.
std::string quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text.substr(0, 32)) out += c < ' ' || c > '~' ? '?' : c;
  return out + "'";
}

}  // namespace

MvnxFrames::MvnxFrames(std::string name, const std::vector<std::string>& elements, Index first_line)
    : name_(std::move(name)), line_(first_line) {
  require(first_line >= 1, "first_line", "lines count from 1");
  for (const std::string& element : elements) {
    const bool twice = std::any_of(tables_.begin(), tables_.end(),
                                   [&](const MvnxTable& t) { return t.element == element; });
    require(!element.empty() && !twice, "elements", "elements must be names, each once");
    tables_.push_back({element, 0, {}});
  }
  for (const MvnxTable& table : tables_) rows_.push_back({table.element, {}});
  pose_rows_ = {{"orientation", {}}, {"position", {}}};
}

std::size_t MvnxFrames::push(const char* data, std::size_t size) {
  require(!refused_, "data", "frames that were refused take no more bytes");
  if (done_) return 0;
  refused_ = true;  // until all is well
  const std::size_t before = pending_.size();
  const char* begin = data;
  if (before > 0) {
    pending_.append(data, size);
    begin = pending_.data();
  }
  const char* const end = begin + before + size;
  begin_ = begin;
  const char* const stop = take(begin, end);
  line_ += std::count(begin, stop, '\n');
  const std::size_t rest = done_ ? 0 : static_cast<std::size_t>(end - stop);
  const std::size_t used = done_ ? static_cast<std::size_t>(stop - begin) - before : size;
  if (rest > kLongestFrame) refuse_markup(end);
  if (before > 0) {
    pending_.erase(0, pending_.size() - rest);
  } else {
    pending_.assign(stop, rest);
  }
  refused_ = false;
  return used;
}

Index MvnxFrames::line() const noexcept {
  return line_ + std::count(pending_.begin(), pending_.end(), '\n');
}

// Whole frames and what stands between them; returns where the first one begins that is not whole.
const char* MvnxFrames::take(const char* at, const char* end) {
  XmlMarkup tag;
  while (!done_) {
    const char* const begin = at;
    switch (next_piece(at, end, tag)) {
      case XmlPiece::kIncomplete:
        return begin;
      case XmlPiece::kBroken:
        refuse_markup(behind(tag.text));
      case XmlPiece::kSkipped:
      case XmlPiece::kEmpty:
        break;
      case XmlPiece::kEnd:
        if (local_name(tag.name) != "frames") refuse_markup(behind(tag.text));
        done_ = true;
        break;
      case XmlPiece::kStart:
        if (!(local_name(tag.name) == "frame" ? take_frame(tag, at, end)
                                              : pass_over(tag.name, at, end))) {
          return begin;
        }
    }
  }
  return at;
}

// False: the frame is not whole yet, as with the functions that it calls.
bool MvnxFrames::take_frame(const XmlMarkup& tag, const char*& at, const char* end) {
  std::string_view kind, number, stamp;
  if (!find_attribute(tag.attributes, "type", kind) ||
      !find_attribute(tag.attributes, "index", number) ||
      !find_attribute(tag.attributes, "time", stamp)) {
    refuse_markup(at);
  }
  if (!kind.empty() && kind != "normal") return take_pose(tag.name, one_line(kind), at, end);
  if (tables_.empty()) return pass_over(tag.name, at, end);
  std::int64_t index = 0;
  double time_ms = kNaN;
  if (!whole_number(number, index) || (!stamp.empty() && !whole_number(stamp, time_ms))) {
    refuse_frame("a frame of " + name_ + " has the index " + quoted(number) + " and the time " +
                     quoted(stamp) + ", one of which is no number",
                 "frame");
  }
  if (!take_rows(tag.name, rows_, "frame " + std::to_string(index), at, end)) return false;
  keep_motion(index, time_ms);
  return true;
}

bool MvnxFrames::take_pose(std::string_view frame, const std::string& kind, const char*& at,
                           const char* end) {
  if (!take_rows(frame, pose_rows_, "the " + kind + " frame", at, end)) return false;
  poses_.push_back({kind, pose_rows_[0].numbers, pose_rows_[1].numbers});
  return true;
}

bool MvnxFrames::take_rows(std::string_view frame, std::vector<Row>& rows, const std::string& where,
                           const char*& at, const char* end) const {
  for (Row& row : rows) row.numbers.clear();
  XmlMarkup tag;
  while (true) {
    switch (next_piece(at, end, tag)) {
      case XmlPiece::kIncomplete:
        return false;
      case XmlPiece::kBroken:
        refuse_markup(behind(tag.text));
      case XmlPiece::kSkipped:
      case XmlPiece::kEmpty:
        break;
      case XmlPiece::kEnd:
        if (tag.name != frame) refuse_markup(behind(tag.text));
        return true;
      case XmlPiece::kStart: {
        const auto row = std::find_if(rows.begin(), rows.end(), [&](const Row& r) {
          return r.element == local_name(tag.name);
        });
        if (!(row == rows.end() ? pass_over(tag.name, at, end)
                                : take_numbers(tag.name, *row, where, at, end))) {
          return false;
        }
      }
    }
  }
}

bool MvnxFrames::take_numbers(std::string_view tag, Row& row, const std::string& where,
                              const char*& at, const char* end) const {
  row.numbers.clear();
  XmlMarkup inner;
  while (true) {
    const XmlPiece piece = next_piece(at, end, inner);
    if (piece == XmlPiece::kIncomplete) return false;
    if (piece == XmlPiece::kBroken) refuse_markup(behind(inner.text));
    if (!append_numbers(inner.text, row.numbers) || piece == XmlPiece::kStart) {
      refuse_frame("<" + std::string(row.element) + "> in " + where + " of " + name_ +
                       " holds text that is no number",
                   where);
    }
    if (piece != XmlPiece::kEnd) continue;
    if (inner.name != tag) refuse_markup(behind(inner.text));
    return true;
  }
}

// Everything up to the end tag of an element whose start tag has been read.
bool MvnxFrames::pass_over(std::string_view tag, const char*& at, const char* end) const {
  std::vector<std::string_view> open{tag};
  XmlMarkup inner;
  while (!open.empty()) {
    const XmlPiece piece = next_piece(at, end, inner);
    if (piece == XmlPiece::kIncomplete) return false;
    if (piece == XmlPiece::kStart) open.push_back(inner.name);
    const bool wrong = piece == XmlPiece::kEnd && inner.name != open.back();
    if (wrong || piece == XmlPiece::kBroken) refuse_markup(behind(inner.text));
    if (piece == XmlPiece::kEnd) open.pop_back();
  }
  return true;
}

void MvnxFrames::keep_motion(std::int64_t index, double time_ms) {
  for (std::size_t k = 0; k < tables_.size(); ++k) {
    MvnxTable& table = tables_[k];
    const std::vector<double>& row = rows_[k].numbers;
    if (row.empty()) {
      table.numbers.insert(table.numbers.end(), static_cast<std::size_t>(table.width), kNaN);
      continue;
    }
    if (table.width == 0) {
      table.width = std::ssize(row);
      table.numbers.assign(index_.size() * row.size(), kNaN);
    }
    if (std::ssize(row) != table.width) {
      const std::string where = "frame " + std::to_string(index);
      refuse_frame(where + " of " + name_ + " has " + std::to_string(row.size()) + " numbers in <" +
                       table.element + ">, the frames before have " + std::to_string(table.width),
                   where);
    }
    table.numbers.insert(table.numbers.end(), row.begin(), row.end());
  }
  index_.push_back(index);
  time_ms_.push_back(time_ms);
}

void MvnxFrames::refuse_markup(const char* at) const {
  const std::string line = "line " + std::to_string(line_ + std::count(begin_, at, '\n'));
  refuse_frame(name_ + " breaks off or is damaged at " + line +
                   " (tags do not fit each other): export it again",
               line);
}

}  // namespace ulna
