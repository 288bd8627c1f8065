// Findings and short texts as the structs of the interface hold them.
#pragma once

#include <ulna/record.h>

#include <cstring>
#include <string>

#include "record/record.hpp"

namespace ulna::capi {

template <std::size_t N>
void put(char (&out)[N], const std::string& text) {
  std::size_t size = text.size() < N ? text.size() : N - 1;
  // Never cut in the middle of a UTF-8 sequence.
  while (size < text.size() && size > 0 &&
         (static_cast<unsigned char>(text[size]) & 0xC0u) == 0x80u) {
    --size;
  }
  std::memcpy(out, text.data(), size);
  std::memset(out + size, 0, N - size);
}

inline ulna_finding finding_struct(const Finding& in) {
  ulna_finding finding = {};
  finding.row = in.row;
  finding.count = in.count;
  finding.severity = static_cast<int32_t>(in.severity);
  put(finding.code, in.code);
  put(finding.channel, in.channel);
  put(finding.message, in.message);
  return finding;
}

}  // namespace ulna::capi
