// How arguments of the interface become those of the core, where zero bytes mean defaults.
#pragma once

#include <string>
#include <vector>

#include "base/error.hpp"
#include "guard.hpp"
#include "signal/finite.hpp"

namespace ulna::capi {

inline bool flag(int32_t value, const char* argument) {
  require(value == 0 || value == 1, argument, std::string(argument) + " must be 0 or 1");
  return value == 1;
}

template <class Kind>
Kind kind_of(int32_t value, int32_t count, const char* argument) {
  require(value >= 0 && value < count, argument,
          std::string(argument) + " is " + std::to_string(value) + ", it must be between 0 and " +
              std::to_string(count - 1));
  return static_cast<Kind>(value);
}

// 0: the default; what cannot be is refused later, in words.
inline double or_default(double value, double otherwise) {
  return value == 0.0 ? otherwise : value;
}

// 0: the default; negative: none.
inline double or_none(double value, double otherwise) {
  return value < 0.0 ? 0.0 : or_default(value, otherwise);
}

inline Vector entries_of(const ulna_view* view, const char* argument) {
  const StridedMap map = map_view(view, argument);
  require(map.cols() == 1 || map.rows() == 1, argument,
          std::string(argument) + " must have one row or one column");
  return Matrix(map).reshaped();
}

// rows x columns, finite, with as many rows as `rows` where that is not negative.
inline Matrix rows_of(const ulna_view* view, const char* argument, Index columns, Index rows = -1) {
  const Matrix m = map_view(view, argument);
  require(m.cols() == columns, argument,
          std::string(argument) + " has " + std::to_string(m.cols()) + " columns, " +
              std::to_string(columns) + " are expected");
  require(rows < 0 || m.rows() == rows, argument,
          std::string(argument) + " has " + std::to_string(m.rows()) + " rows, " +
              std::to_string(rows) + " are expected");
  require_finite(m, argument);
  return m;
}

inline const char* text_of(const char* text, const char* argument) {
  return &deref(text, argument);
}

inline std::vector<std::string> name_list(const char* const* names, int64_t count,
                                          const char* argument) {
  require(count >= 0 && (count == 0 || names != nullptr), argument,
          std::string(argument) + " must be a list of names");
  std::vector<std::string> list;
  for (int64_t i = 0; names != nullptr && i < count; ++i) {
    list.emplace_back(text_of(names[i], argument));
  }
  return list;
}

}  // namespace ulna::capi
