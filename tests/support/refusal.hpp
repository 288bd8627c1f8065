// What a call of the core is refused with.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "base/error.hpp"

namespace ulna::made {

// The error that a call throws, in one line; a failure of the test where it throws none.
template <class Call>
Error refusal_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_STRNE(error.what(), "");
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error;
  }
  ADD_FAILURE() << "nothing was refused";
  return Error(Fault::kInternal, "", "nothing was refused");
}

inline bool says(const Error& error, const std::string& words) {
  return std::string(error.what()).find(words) != std::string::npos;
}

// The call is refused with this kind of fault, in a sentence with these words.
template <class Call>
void expect_refusal(const Call& call, const std::string& words, Fault fault = Fault::kArgument) {
  SCOPED_TRACE(words);
  const Error error = refusal_of(call);
  EXPECT_EQ(error.fault(), fault) << error.what();
  EXPECT_TRUE(says(error, words)) << error.what();
}

}  // namespace ulna::made
