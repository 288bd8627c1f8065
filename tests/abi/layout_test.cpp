// The layout of every struct and the value of every constant: in C, in C++ and as the generator
// computed them from the text of the headers. A difference would make bindings read wrong members.
#include "layout.h"

#include <gtest/gtest.h>

extern "C" {
extern const ulna_layout_row ulna_layout_actual_cxx[];
extern const int ulna_layout_rows_cxx;
extern const ulna_constant_row ulna_constants_actual_cxx[];
extern const int ulna_constant_rows_cxx;
}

namespace {

TEST(Layout, StructsAreTheSameInCAndCxxAndInTheHeadersText) {
  ASSERT_GT(ulna_layout_rows, 0);
  ASSERT_EQ(ulna_layout_rows, ulna_layout_rows_cxx);
  for (int i = 0; i < ulna_layout_rows; ++i) {
    const ulna_layout_row& expected = ulna_layout_expected[i];
    for (const ulna_layout_row* table : {ulna_layout_actual, ulna_layout_actual_cxx}) {
      EXPECT_STREQ(table[i].type, expected.type);
      EXPECT_STREQ(table[i].member, expected.member);
      EXPECT_EQ(table[i].offset, expected.offset) << expected.type << "." << expected.member;
      EXPECT_EQ(table[i].size, expected.size) << expected.type << "." << expected.member;
    }
  }
}

TEST(Layout, ConstantsAreTheSameInCAndCxxAndInTheHeadersText) {
  ASSERT_GT(ulna_constant_rows, 0);
  ASSERT_EQ(ulna_constant_rows, ulna_constant_rows_cxx);
  for (int i = 0; i < ulna_constant_rows; ++i) {
    EXPECT_EQ(ulna_constants_actual[i].value, ulna_constants_expected[i].value)
        << ulna_constants_actual[i].name;
    EXPECT_EQ(ulna_constants_actual_cxx[i].value, ulna_constants_expected[i].value)
        << ulna_constants_actual[i].name;
  }
}

}  // namespace
