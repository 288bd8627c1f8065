// Sentences from parts, for errors, warnings and verdicts.
#pragma once

#include <sstream>
#include <string>
#include <vector>

namespace ulna {

// The parts in a row, numbers with `precision` significant figures.
template <class... Parts>
std::string sentence(int precision, const Parts&... parts) {
  std::ostringstream text;
  text.precision(precision);
  (text << ... << parts);
  return text.str();
}

inline std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

}  // namespace ulna
