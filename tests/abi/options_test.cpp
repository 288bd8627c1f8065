// Options grow at their end: a program that was built with an older or a newer header keeps its
// meaning, and an option that this library does not know is refused, never ignored.
#include <gtest/gtest.h>
#include <ulna/ulna.h>

#include <cmath>
#include <cstring>
#include <string>

#include "round_trip.h"

namespace {

constexpr char kTable[] = "t,x,F\n0,1,2\n0.1,2,3\n0.2,3,5\n0.3,5,7\n";

ulna_status read_table(const ulna_read_options* options) {
  ulna_record* record = nullptr;
  const ulna_status status =
      ulna_record_read_csv_memory(kTable, sizeof kTable - 1, options, nullptr, &record);
  EXPECT_EQ(record != nullptr, status == ULNA_OK);
  ulna_record_free(record);
  return status;
}

ulna_status margins_of_unit(const ulna_passivity_options* options) {
  const double one = 1.0;
  const ulna_view view = {&one, 1, 1, 1, 1};
  ulna_passivity_margins margins = {};
  margins.struct_size = sizeof margins;
  return ulna_passivity_of_model(&view, &view, &view, options, &margins);
}

template <class Options>
struct Newer {
  Options known;
  unsigned char tail[32];
};

template <class Options>
void check_rule(ulna_status (*call)(const Options*)) {
  EXPECT_EQ(call(nullptr), ULNA_OK) << "NULL means defaults";

  Newer<Options> options = {};
  options.known.struct_size = sizeof(Options);
  EXPECT_EQ(call(&options.known), ULNA_OK) << "zero bytes mean defaults";

  options.known.struct_size = sizeof(int64_t);
  std::memset(options.tail, 0x5a, sizeof options.tail);
  EXPECT_EQ(call(&options.known), ULNA_OK) << "an older program knows fewer options";

  options.known.struct_size = sizeof options;
  std::memset(options.tail, 0, sizeof options.tail);
  EXPECT_EQ(call(&options.known), ULNA_OK) << "a newer program that uses nothing new";

  for (std::size_t i = 0; i < sizeof options.tail; ++i) {
    options.tail[i] = 1;
    EXPECT_EQ(call(&options.known), ULNA_ERROR_ARGUMENT) << "an unknown option at byte " << i;
    options.tail[i] = 0;
  }
  ulna_error error = {};
  error.struct_size = sizeof error;
  ASSERT_EQ(ulna_error_last(&error), ULNA_OK);
  EXPECT_NE(std::string(error.message).find("does not know"), std::string::npos) << error.message;

  for (const int64_t size : {int64_t{0}, int64_t{7}, int64_t{-1}, int64_t{65537}, INT64_MAX}) {
    options.known.struct_size = size;
    EXPECT_EQ(call(&options.known), ULNA_ERROR_ARGUMENT) << size;
  }
}

TEST(Options, OfReadingGrowAtTheirEnd) { check_rule<ulna_read_options>(read_table); }

TEST(Options, OfPassivityGrowAtTheirEnd) { check_rule<ulna_passivity_options>(margins_of_unit); }

TEST(Options, OfIdentificationGrowAtTheirEnd) {
  check_rule<ulna_impedance_options>(ulna_identify_with);
}

// Options within options follow the same rule.
TEST(Options, OfPreparationGrowAtTheirEnd) {
  check_rule<ulna_prepare_options>([](const ulna_prepare_options* prepare) {
    ulna_impedance_options options = {};
    options.struct_size = sizeof options;
    options.prepare = prepare;
    return ulna_identify_with(&options);
  });
}

TEST(Options, OfSamplingRefuseAGuardThatIsNoNumber) {
  const auto design = [](double guard) {
    ulna_sampling_options options = {};
    options.struct_size = sizeof options;
    options.factors = 2;
    options.n = 4;
    options.scheme = ULNA_SCHEME_RADIAL;
    options.sampler = ULNA_SAMPLER_LATIN;
    options.guard = guard;
    ulna_sampling* sampling = nullptr;
    const ulna_status status = ulna_sampling_new(&options, nullptr, &sampling);
    EXPECT_EQ(sampling != nullptr, status == ULNA_OK);
    ulna_sampling_free(sampling);
    return status;
  };
  for (const double guard : {-1.0, 0.0, 0.4}) EXPECT_EQ(design(guard), ULNA_OK) << guard;
  for (const double guard : {std::nan(""), 0.5, HUGE_VAL}) {
    EXPECT_EQ(design(guard), ULNA_ERROR_ARGUMENT) << guard;
    ulna_error error = {};
    error.struct_size = sizeof error;
    ulna_error_last(&error);
    EXPECT_STREQ(error.argument, "guard");
    EXPECT_NE(std::string(error.message).find("at least 0 and below 0.5"), std::string::npos);
  }
}

TEST(Results, AreAsLargeAsTheCallersBuildKnows) {
  const double one = 1.0;
  const ulna_view view = {&one, 1, 1, 1, 1};
  Newer<ulna_passivity_margins> margins;

  std::memset(&margins, 0x5a, sizeof margins);
  margins.known.struct_size = offsetof(ulna_passivity_margins, b_min);
  ASSERT_EQ(ulna_passivity_of_model(&view, &view, &view, nullptr, &margins.known), ULNA_OK);
  EXPECT_EQ(margins.known.m_min, 1.0);
  unsigned char byte = 0;
  std::memcpy(&byte, &margins.known.b_min, 1);
  EXPECT_EQ(byte, 0x5a) << "written past the end of the caller's struct";

  std::memset(&margins, 0x5a, sizeof margins);
  margins.known.struct_size = sizeof margins;
  ASSERT_EQ(ulna_passivity_of_model(&view, &view, &view, nullptr, &margins.known), ULNA_OK);
  EXPECT_EQ(margins.known.struct_size, static_cast<int64_t>(sizeof margins));
  EXPECT_EQ(margins.known.b_min, 1.0);
  for (const unsigned char value : margins.tail) EXPECT_EQ(value, 0) << "unknown members are zero";
}

}  // namespace
