#include "record/units.hpp"

#include <array>
#include <utility>

#include "base/types.hpp"

namespace ulna {
namespace {

struct Entry {
  std::string_view text;
  std::string_view si;
  double factor;
};

// Spelled after normalisation (see normalised()): no blanks, "." for products, "2" for squares.
constexpr Entry kUnits[] = {
    {"m", "m", 1.0},
    {"mm", "m", 1e-3},
    {"cm", "m", 1e-2},
    {"um", "m", 1e-6},
    {"in", "m", 0.0254},
    {"rad", "rad", 1.0},
    {"mrad", "rad", 1e-3},
    {"deg", "rad", kDegree},
    {"°", "rad", kDegree},
    {"degree", "rad", kDegree},
    {"degrees", "rad", kDegree},
    {"N", "N", 1.0},
    {"mN", "N", 1e-3},
    {"kN", "N", 1e3},
    {"Nm", "Nm", 1.0},
    {"N.m", "Nm", 1.0},
    {"mNm", "Nm", 1e-3},
    {"mN.m", "Nm", 1e-3},
    {"kNm", "Nm", 1e3},
    {"Nmm", "Nm", 1e-3},
    {"N.mm", "Nm", 1e-3},
    {"Ncm", "Nm", 1e-2},
    {"N.cm", "Nm", 1e-2},
    {"s", "s", 1.0},
    {"sec", "s", 1.0},
    {"ms", "s", 1e-3},
    {"us", "s", 1e-6},
    {"ns", "s", 1e-9},
    {"min", "s", 60.0},
    {"m/s", "m/s", 1.0},
    {"mm/s", "m/s", 1e-3},
    {"cm/s", "m/s", 1e-2},
    {"rad/s", "rad/s", 1.0},
    {"mrad/s", "rad/s", 1e-3},
    {"deg/s", "rad/s", kDegree},
    {"°/s", "rad/s", kDegree},
    {"m/s2", "m/s^2", 1.0},
    {"mm/s2", "m/s^2", 1e-3},
    {"rad/s2", "rad/s^2", 1.0},
    {"deg/s2", "rad/s^2", kDegree},
    {"°/s2", "rad/s^2", kDegree},
    {"V", "V", 1.0},
    {"mV", "V", 1e-3},
    {"uV", "V", 1e-6},
    {"A", "A", 1.0},
    {"mA", "A", 1e-3},
    {"Hz", "Hz", 1.0},
    {"kHz", "Hz", 1e3},
    {"kg", "kg", 1.0},
    {"W", "W", 1.0},
    {"J", "J", 1.0},
    {"1", "1", 1.0},
    {"-", "1", 1.0},
    {"%", "1", 1e-2},
};

// Endings of names. Only those that are seldom anything else: no V, A, in, min, W, J, 1.
constexpr std::pair<std::string_view, std::string_view> kEndings[] = {
    {"_rad_s2", "rad/s^2"},
    {"_deg_s2", "deg/s^2"},
    {"_m_s2", "m/s^2"},
    {"_mm_s2", "mm/s^2"},
    {"_rad_s", "rad/s"},
    {"_deg_s", "deg/s"},
    {"_m_s", "m/s"},
    {"_mm_s", "mm/s"},
    {"_cm_s", "cm/s"},
    {"_mrad", "mrad"},
    {"_rad", "rad"},
    {"_deg", "deg"},
    {"_mNm", "mNm"},
    {"_Nmm", "Nmm"},
    {"_Nm", "Nm"},
    {"_mN", "mN"},
    {"_kN", "kN"},
    {"_N", "N"},
    {"_mm", "mm"},
    {"_cm", "cm"},
    {"_um", "um"},
    {"_m", "m"},
    {"_ms", "ms"},
    {"_us", "us"},
    {"_s", "s"},
    {"_Hz", "Hz"},
    {"_kg", "kg"},
    // Logs written in lower case throughout.
    {"_nm", "Nm"},
    {"_hz", "Hz"},
    {"_n", "N"},
};

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  std::string out;
  std::size_t at = 0;
  for (std::size_t hit; (hit = text.find(from, at)) != std::string::npos; at = hit + from.size()) {
    out.append(text, at, hit - at);
    out.append(to);
  }
  text = out.append(text, at);
}

std::string normalised(std::string_view text) {
  std::string out;
  for (const char c : trimmed(text)) {
    if (c != ' ' && c != '\t') out += c;
  }
  for (const std::string_view product : {"*", "\xC2\xB7", "\xE2\x8B\x85", "\xC3\x97"}) {
    replace_all(out, product, ".");
  }
  for (const std::string_view square : {"^2", "**2", "..2", "\xC2\xB2"})
    replace_all(out, square, "2");
  for (const std::string_view micro : {"\xC2\xB5", "\xCE\xBC"}) replace_all(out, micro, "u");
  // Latin-1, as older spreadsheets write it.
  if (out == "\xB0") return "°";
  return out;
}

bool closes(char open, char close) {
  return (open == '[' && close == ']') || (open == '(' && close == ')') ||
         (open == '{' && close == '}');
}

}  // namespace

std::string_view trimmed(std::string_view text) noexcept {
  constexpr std::string_view blanks = " \t\r\n\v\f";
  const std::size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

std::optional<Unit> parse_unit(std::string_view text) {
  if (text.size() > 32) return std::nullopt;
  const std::string wanted = normalised(text);
  for (const Entry& entry : kUnits) {
    if (entry.text == wanted) return Unit{std::string(entry.si), entry.factor};
  }
  return std::nullopt;
}

const std::string& known_units() {
  static const std::string text = [] {
    std::string all;
    for (const Entry& entry : kUnits) (all += all.empty() ? "" : " ") += entry.text;
    return all;
  }();
  return text;
}

Heading parse_heading(std::string_view text) {
  const std::string_view whole = trimmed(text);
  if (whole.size() >= 3) {
    const std::size_t open = whole.find_last_of("[({");
    if (open != std::string_view::npos && open > 0 && closes(whole[open], whole.back())) {
      const std::string_view unit = trimmed(whole.substr(open + 1, whole.size() - open - 2));
      // Round brackets often hold a remark; square ones are for units, known or not.
      if (whole[open] == '[' || parse_unit(unit)) {
        return {std::string(trimmed(whole.substr(0, open))), std::string(unit)};
      }
    }
  }
  for (const auto& [ending, unit] : kEndings) {
    if (whole.size() > ending.size() && whole.substr(whole.size() - ending.size()) == ending &&
        parse_unit(unit)) {
      return {std::string(whole.substr(0, whole.size() - ending.size())), std::string(unit)};
    }
  }
  return {std::string(whole), {}};
}

}  // namespace ulna
