// Helpers of the tests of the record module.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "base/error.hpp"
#include "record/csv.hpp"

inline ulna::ReadResult read_text(const std::string& text, const ulna::CsvOptions& options = {}) {
  return ulna::read_csv_memory(text.data(), text.size(), options);
}

// The one sentence with which a text is refused; "" when it is read.
inline std::string refusal(const std::string& text, const ulna::CsvOptions& options = {},
                           ulna::Fault* fault = nullptr, std::string* detail = nullptr) {
  try {
    read_text(text, options);
  } catch (const ulna::Error& error) {
    if (fault != nullptr) *fault = error.fault();
    if (detail != nullptr) *detail = error.detail();
    return error.what();
  }
  return {};
}

inline bool has(const std::vector<ulna::Finding>& findings, const std::string& code,
                const std::string& channel = "") {
  for (const ulna::Finding& f : findings) {
    if (f.code == code && (channel.empty() || f.channel == channel)) return true;
  }
  return false;
}
