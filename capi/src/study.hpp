// What both sources of study.h need.
#pragma once

#include "guard.hpp"

namespace ulna::capi {

// Answers a question for the count, or refuses a buffer that is too small, before any work is done.
inline bool study_count_only(int64_t count, const void* out, int64_t capacity, int64_t* out_count) {
  deref(out_count, "out_count");
  if (out != nullptr && capacity >= count) return false;
  if (out == nullptr && capacity == 0) {
    *out_count = count;
    return true;
  }
  deref(static_cast<const char*>(out), "out");
  throw Error(Fault::kBuffer, "capacity",
              "the buffer holds " + std::to_string(capacity) + " values, " + std::to_string(count) +
                  " are needed");
}

}  // namespace ulna::capi
