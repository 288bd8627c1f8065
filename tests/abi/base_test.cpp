// Errors, tokens and versions.
#include <gtest/gtest.h>
#include <ulna/base.h>

#include <cstring>
#include <string>
#include <thread>

extern "C" int ulna_first_unit(void);
extern "C" int ulna_second_unit(void);

namespace {

ulna_error last_error() {
  ulna_error error{};
  error.struct_size = sizeof error;
  EXPECT_EQ(ulna_error_last(&error), ULNA_OK);
  return error;
}

TEST(Base, HeadersCompileInTwoUnitsOfC99) {
  EXPECT_EQ(ulna_first_unit(), ULNA_INTERFACE);
  EXPECT_EQ(ulna_second_unit(), ULNA_INTERFACE);
}

TEST(Base, LibraryHasTheNumbersOfItsHeaderAndItsFile) {
  EXPECT_EQ(ulna_interface_number(), ULNA_INTERFACE);
  EXPECT_EQ(ULNA_SOVERSION, ULNA_INTERFACE);  // CMake's number, which names the file
  EXPECT_STREQ(ulna_release(), ULNA_VERSION);
  EXPECT_STRNE(ulna_build(), "");
}

TEST(Base, EveryStatusHasItsName) {
  for (ulna_status status = ULNA_ERROR_INTERNAL; status <= ULNA_OK; ++status) {
    ASSERT_NE(ulna_status_name(status), nullptr) << status;
    EXPECT_EQ(std::string(ulna_status_name(status)).rfind("ULNA_", 0), 0u);
  }
  EXPECT_EQ(ulna_status_name(1), nullptr);
  EXPECT_EQ(ulna_status_name(ULNA_ERROR_INTERNAL - 1), nullptr);
}

TEST(Error, SaysWhatWasWrong) {
  EXPECT_EQ(ulna_token_cancel(nullptr), ULNA_ERROR_ARGUMENT);
  const ulna_error error = last_error();
  EXPECT_EQ(error.status, ULNA_ERROR_ARGUMENT);
  EXPECT_STREQ(error.argument, "token");
  EXPECT_STREQ(error.message, "token must not be NULL");
}

TEST(Error, BelongsToTheThreadThatFailed) {
  EXPECT_EQ(ulna_token_cancel(nullptr), ULNA_ERROR_ARGUMENT);
  std::thread([] {
    EXPECT_EQ(last_error().status, ULNA_OK);
    EXPECT_EQ(ulna_token_new(nullptr), ULNA_ERROR_ARGUMENT);
    EXPECT_STREQ(last_error().argument, "out_token");
  }).join();
  EXPECT_STREQ(last_error().argument, "token");
}

TEST(Error, StaysAfterACallThatSucceeds) {
  EXPECT_EQ(ulna_token_cancel(nullptr), ULNA_ERROR_ARGUMENT);
  ulna_token* token = nullptr;
  ASSERT_EQ(ulna_token_new(&token), ULNA_OK);
  ulna_token_free(token);
  EXPECT_EQ(last_error().status, ULNA_ERROR_ARGUMENT);
}

TEST(Error, CopiesAsMuchAsTheCallersBuildKnows) {
  EXPECT_EQ(ulna_token_cancel(nullptr), ULNA_ERROR_ARGUMENT);
  // An older build: the record ends before `detail`.
  ulna_error small;
  std::memset(&small, 0x5a, sizeof small);
  small.struct_size = offsetof(ulna_error, detail);
  ASSERT_EQ(ulna_error_last(&small), ULNA_OK);
  EXPECT_STREQ(small.argument, "token");
  EXPECT_EQ(small.detail[0], 0x5a);
  // A newer build: what this library does not know is left zero.
  struct {
    ulna_error known;
    char tail[32];
  } large = {};
  large.known.struct_size = sizeof large;
  ASSERT_EQ(ulna_error_last(&large.known), ULNA_OK);
  EXPECT_EQ(large.known.struct_size, static_cast<int64_t>(sizeof large));
  EXPECT_STREQ(large.known.argument, "token");
  EXPECT_EQ(large.tail[0], 0);
}

TEST(Token, CarriesProgressAndCanBeFreedWhenNull) {
  ulna_token* token = nullptr;
  ASSERT_EQ(ulna_token_new(&token), ULNA_OK);
  double fraction = -1.0;
  EXPECT_EQ(ulna_token_progress(token, &fraction), ULNA_OK);
  EXPECT_EQ(fraction, 0.0);
  EXPECT_EQ(ulna_token_cancel(token), ULNA_OK);
  EXPECT_EQ(ulna_token_progress(nullptr, &fraction), ULNA_ERROR_ARGUMENT);
  EXPECT_EQ(fraction, 0.0);
  ulna_token_free(token);
  ulna_token_free(nullptr);
}

}  // namespace
