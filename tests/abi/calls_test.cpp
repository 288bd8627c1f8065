// Every function, also those that later headers add, with NULL and with bad arguments: it returns,
// says which argument is wrong, and leaves its outputs alone.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "calls.h"

extern "C" void ulna_fill(void* objects, size_t size, size_t count, const ulna_bad_arguments* bad) {
  const int64_t stated = bad->struct_size == -1 ? static_cast<int64_t>(size) : bad->struct_size;
  std::memset(objects, 0, size * count);
  for (size_t i = 0; i < count; ++i) {
    std::memcpy(static_cast<char*>(objects) + i * size, &stated, sizeof stated);
  }
}

namespace {

ulna_error last_error() {
  ulna_error error{};
  error.struct_size = sizeof error;
  EXPECT_EQ(ulna_error_last(&error), ULNA_OK);
  return error;
}

TEST(Calls, NullIsRefusedAndNamed) {
  for (int i = 0; i < ulna_call_rows; ++i) {
    const ulna_call_row& row = ulna_calls[i];
    SCOPED_TRACE(row.name);
    const ulna_status status = row.with_nulls();
    if (row.returns_status == 0) continue;
    EXPECT_EQ(status, ULNA_ERROR_ARGUMENT);
    // The one call that must not overwrite the record it is asked for.
    if (std::string(row.name) == "ulna_error_last") continue;
    const ulna_error error = last_error();
    EXPECT_EQ(error.status, status);
    EXPECT_STRNE(error.argument, "");
    EXPECT_STRNE(error.message, "");
    EXPECT_EQ(std::string(error.message).find("ulna_"), std::string::npos)
        << "a message names no function: " << error.message;
  }
}

using Text = std::array<char, 80>;  // zeros after the text, so that 64 bytes can be read

std::vector<ulna_bad_arguments> bad_arguments() {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  static const double few[4] = {1.0, nan, infinity, -1.0};
  static const Text empty = {}, bytes = {"\xff\xfe"}, path = {"/nonexistent/file.csv"},
                    folder = {"."}, equals = {"="}, brackets = {"[["}, word = {"x"};
  const int32_t lowest = std::numeric_limits<int32_t>::min();
  return {
      {0, 0.0, empty.data(), {nullptr, 0, 0, 1, 1}, -1},
      {-1, nan, bytes.data(), {nullptr, 5, 1, 1, 1}, 0},
      {lowest, -infinity, path.data(), {few, -1, 1, 1, 1}, 7},
      {1, infinity, folder.data(), {few, 1, -1, 1, 1}, 65537},
      {2, -1.0, equals.data(), {few, 4, 1, 1, 4}, std::numeric_limits<int64_t>::max()},
      {3, 1e308, brackets.data(), {few, 2, 2, 1, 2}, std::numeric_limits<int64_t>::min()},
      {64, 1.0, word.data(), {few, 0, 3, 1, 1}, -1},
  };
}

TEST(Calls, BadArgumentsLeaveTheOutputsAlone) {
  for (const ulna_bad_arguments& bad : bad_arguments()) {
    for (int i = 0; i < ulna_call_rows; ++i) {
      const ulna_call_row& row = ulna_calls[i];
      SCOPED_TRACE(std::string(row.name) + " with number " + std::to_string(bad.number));
      int same = 0;
      const ulna_status status = row.with_bad(&bad, &same);
      EXPECT_LE(status, 0);
      EXPECT_NE(ulna_status_name(status), nullptr) << status;
      EXPECT_NE(status, ULNA_ERROR_INTERNAL) << last_error().message;
      EXPECT_TRUE(status == ULNA_OK || same != 0) << "a failing call wrote to its outputs";
    }
  }
}

}  // namespace
