#include "record/xml_scan.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace ulna {
namespace {

constexpr std::string_view kXmlBlanks = " \t\r\n";

const char* find_char(const char* at, const char* end, char c) noexcept {
  const void* found = std::memchr(at, c, static_cast<std::size_t>(end - at));
  return found == nullptr ? end : static_cast<const char*>(found);
}

// Behind a piece that ends with `stop`.
XmlPiece skip_to(std::string_view rest, std::size_t from, std::string_view stop,
                 const char*& at) noexcept {
  const std::size_t found = rest.find(stop, from);
  if (found == std::string_view::npos) return XmlPiece::kIncomplete;
  at = rest.data() + found + stop.size();
  return XmlPiece::kSkipped;
}

// The '>' of a tag; a value in quotes may hold one. `end` where there is none yet.
const char* end_of_tag(const char* at, const char* end, bool& broken) noexcept {
  char quote = 0;
  for (; at < end; ++at) {
    if (*at == '<') {
      broken = true;
      return at;
    }
    if (quote != 0) {
      if (*at == quote) quote = 0;
    } else if (*at == '"' || *at == '\'') {
      quote = *at;
    } else if (*at == '>') {
      return at;
    }
  }
  return end;
}

XmlPiece read_tag(const char* open, const char* end, const char*& at, XmlMarkup& markup) noexcept {
  bool broken = false;
  const char* stop = end_of_tag(open + 1, end, broken);
  if (broken) return XmlPiece::kBroken;
  if (stop == end) return XmlPiece::kIncomplete;
  std::string_view inside(open + 1, static_cast<std::size_t>(stop - open - 1));
  XmlPiece piece = XmlPiece::kStart;
  if (!inside.empty() && inside.front() == '/') {
    piece = XmlPiece::kEnd;
    inside.remove_prefix(1);
  } else if (!inside.empty() && inside.back() == '/') {
    piece = XmlPiece::kEmpty;
    inside.remove_suffix(1);
  }
  const std::size_t size = std::min(inside.find_first_of(kXmlBlanks), inside.size());
  markup.name = inside.substr(0, size);
  markup.attributes = inside.substr(size);
  if (markup.name.empty() || markup.name.find_first_of("\"'=&/") != std::string_view::npos) {
    return XmlPiece::kBroken;
  }
  at = stop + 1;
  return piece;
}

}  // namespace

XmlPiece next_piece(const char*& at, const char* end, XmlMarkup& markup) noexcept {
  const char* open = find_char(at, end, '<');
  markup.text = std::string_view(at, static_cast<std::size_t>(open - at));
  const std::string_view rest(open, static_cast<std::size_t>(end - open));
  // The longest beginning that tells what follows is that of a comment.
  if (rest.size() < 2) return XmlPiece::kIncomplete;
  if (rest[1] == '?') return skip_to(rest, 2, "?>", at);
  if (rest[1] != '!') return read_tag(open, end, at, markup);
  if (rest.size() < 4) return XmlPiece::kIncomplete;
  return rest.substr(0, 4) == "<!--" ? skip_to(rest, 4, "-->", at) : XmlPiece::kBroken;
}

std::string_view local_name(std::string_view name) noexcept {
  const std::size_t colon = name.rfind(':');
  return colon == std::string_view::npos ? name : name.substr(colon + 1);
}

bool find_attribute(std::string_view attributes, std::string_view name,
                    std::string_view& value) noexcept {
  value = {};
  const auto skip_blanks = [&] {
    attributes.remove_prefix(std::min(attributes.find_first_not_of(kXmlBlanks), attributes.size()));
  };
  for (skip_blanks(); !attributes.empty(); skip_blanks()) {
    const std::size_t size = attributes.find_first_of("= \t\r\n");
    if (size == 0 || size == std::string_view::npos) return false;
    const std::string_view found = attributes.substr(0, size);
    attributes.remove_prefix(size);
    skip_blanks();
    if (attributes.empty() || attributes.front() != '=') return false;
    attributes.remove_prefix(1);
    skip_blanks();
    if (attributes.empty() || (attributes.front() != '"' && attributes.front() != '\'')) {
      return false;
    }
    const std::size_t close = attributes.find(attributes.front(), 1);
    if (close == std::string_view::npos) return false;
    if (found == name) value = attributes.substr(1, close - 1);
    attributes.remove_prefix(close + 1);
  }
  return true;
}

}  // namespace ulna
