// Unit texts as laboratories write them, to SI. Values are multiplied by the factor once, on
// reading.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace ulna {

struct Unit {
  std::string si;       // "m", "rad", "N", "Nm", "s", "m/s", "rad/s", "m/s^2", "rad/s^2", "1", ...
  double factor = 1.0;  // value in SI = factor * value in the file
};

// Nothing when the text is not a known unit. Blanks around it and the signs of multiplication and
// power in their usual spellings (N.m, N*m, N·m, m/s2, m/s², m/s^2) do not matter; case does.
std::optional<Unit> parse_unit(std::string_view text);

// The known units in one line, for messages.
const std::string& known_units();

// A column's heading taken apart: "x [mm]", "x (mm)", "x_mm" and "x" give the stem "x".
struct Heading {
  std::string stem;
  std::string unit;  // as written; "" when there is none
};
Heading parse_heading(std::string_view text);

std::string_view trimmed(std::string_view text) noexcept;

}  // namespace ulna
