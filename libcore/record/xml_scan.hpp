// Markup of XML one piece after the other, from a buffer that may end anywhere: for long parts of
// files whose elements hold numbers. No tree, no entities, no namespaces.
#pragma once

#include <string_view>

namespace ulna {

enum class XmlPiece {
  kStart,       // <name ...>
  kEmpty,       // <name .../>
  kEnd,         // </name>
  kSkipped,     // a comment or a processing instruction
  kIncomplete,  // the buffer ends within the piece, or before the next one
  kBroken,      // no markup that numbers can stand between
};

struct XmlMarkup {
  std::string_view text;        // before the piece
  std::string_view name;        // with its prefix
  std::string_view attributes;  // as written
};

// The next piece at `at`, which moves behind it; it stays where the piece is incomplete or broken.
XmlPiece next_piece(const char*& at, const char* end, XmlMarkup& markup) noexcept;

// The name without the prefix of a namespace.
std::string_view local_name(std::string_view name) noexcept;

// The value of an attribute, "" where there is none; false where the attributes are no list of
// name="value".
bool find_attribute(std::string_view attributes, std::string_view name,
                    std::string_view& value) noexcept;

}  // namespace ulna
