#include "record/record.hpp"

#include <cmath>
#include <limits>

#include "text.hpp"

namespace ulna {
namespace {

Record::Parts parts_of(std::vector<std::string> names, Index rows = 10) {
  Record::Parts parts;
  parts.values = Matrix::Random(rows, static_cast<Index>(names.size()));
  for (Index i = 0; i < rows; ++i) parts.time.push_back(0.001 * static_cast<double>(i));
  for (const std::string& name : names) {
    Channel channel;
    channel.name = name;
    parts.channels.push_back(channel);
  }
  return parts;
}

TEST(Record, DerivesRateTrialAndSegment) {
  const Record record = Record::make(parts_of({"x"}));
  EXPECT_EQ(record.rate_hz(), 1000.0);
  ASSERT_EQ(record.trials().size(), 1u);
  EXPECT_EQ(record.trials()[0].end, 10);
  EXPECT_EQ(record.segments()[0].end, 10);
}

TEST(Record, MakesTheClockFromTheRate) {
  Record::Parts parts = parts_of({"x"});
  parts.time.clear();
  parts.rate_hz = 250.0;
  EXPECT_EQ(Record::make(parts).time()[3], 3 / 250.0);
}

TEST(Record, RateLeavesGapsOut) {
  Record::Parts parts = parts_of({"x"}, 20);
  for (std::size_t i = 10; i < 20; ++i) parts.time[i] += 5.0;
  EXPECT_NEAR(Record::make(parts).rate_hz(), 1000.0, 1e-6);  // rounding of the stamps
}

TEST(Record, RefusesTimeThatGoesBackOrRepeats) {
  for (const double value : {0.003, 0.001, std::numeric_limits<double>::quiet_NaN()}) {
    Record::Parts parts = parts_of({"x"});
    parts.time[4] = value;
    try {
      Record::make(parts);
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.fault(), Fault::kData);
      EXPECT_EQ(error.detail(), "row 4");
    }
  }
}

TEST(Record, TimeMayRestartBetweenTrials) {
  Record::Parts parts = parts_of({"x"});
  for (std::size_t i = 5; i < 10; ++i) parts.time[i] -= 0.005;
  EXPECT_THROW(Record::make(parts), Error);
  parts.trials = {{0, 5}, {5, 10}};
  EXPECT_EQ(Record::make(parts).segments().size(), 2u);
}

TEST(Record, RefusesWrongShapesNamesAndRanges) {
  EXPECT_THROW(Record::make(parts_of({"x", "x"})), Error);
  EXPECT_THROW(Record::make(parts_of({""})), Error);
  EXPECT_THROW(Record::make(parts_of({"a\nb"})), Error);
  EXPECT_THROW(Record::make(parts_of({std::string(128, 'a')})), Error);
  Record::Parts parts = parts_of({"x"});
  parts.channels.clear();
  EXPECT_THROW(Record::make(parts), Error);
  for (const Trial bad : {Trial{0, 11}, Trial{5, 5}, Trial{-1, 4}}) {
    parts = parts_of({"x"});
    parts.trials = {bad};
    EXPECT_THROW(Record::make(parts), Error);
  }
  parts = parts_of({"x"});
  parts.trials = {{0, 5}, {4, 10}};
  EXPECT_THROW(Record::make(parts), Error);
  parts.trials = {{0, 5}, {5, 10}};
  parts.segments = {{3, 6, 0}};
  EXPECT_THROW(Record::make(parts), Error);
  parts.segments = {{3, 5, 2}};
  EXPECT_THROW(Record::make(parts), Error);
  parts = parts_of({"x"}, 0);
  EXPECT_THROW(Record::make(parts), Error);
  parts = parts_of({"x"}, 1);
  EXPECT_THROW(Record::make(parts), Error);
}

TEST(Record, ResolvesWords) {
  Record::Parts parts = parts_of({"x", "y", "F_y", "F_x", "x_ref", "y_ref", "q1", "q2", "note"});
  const Role roles[] = {Role::kPosition, Role::kPosition,  Role::kForce,
                        Role::kForce,    Role::kReference, Role::kReference,
                        Role::kOther,    Role::kOther,     Role::kOther};
  for (std::size_t i = 0; i < 9; ++i) {
    parts.channels[i].role = roles[i];
    parts.channels[i].axis = parts.channels[i].name.find('y') == std::string::npos ? 0 : 1;
  }
  const Record record = Record::make(parts);
  using List = std::vector<Index>;
  EXPECT_EQ(record.find("F_x"), 3);
  EXPECT_EQ(record.resolve("x"), (List{0, 1}));
  EXPECT_EQ(record.resolve("y"), (List{1}));
  EXPECT_EQ(record.resolve("F"), (List{3, 2}));
  EXPECT_EQ(record.resolve("F_y"), (List{2}));
  EXPECT_EQ(record.resolve("x_ref"), (List{4, 5}));
  EXPECT_EQ(record.resolve("q"), (List{6, 7}));
  EXPECT_EQ(record.resolve("note"), (List{8}));
  EXPECT_EQ(record.resolve("force"), (List{3, 2}));
  EXPECT_EQ(record.resolve("position"), (List{0, 1}));
  EXPECT_EQ(record.with_role(Role::kReference), (List{4, 5}));
  for (const char* word : {"", "G", "_x"}) EXPECT_THROW(record.resolve(word), Error) << word;
  try {
    record.find("Fx");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("F_y, F_x"), std::string::npos);
  }
}

TEST(Record, OneAxisNamesResolve) {
  Record::Parts parts = parts_of({"position", "torque"});
  parts.channels[0].role = Role::kPosition;
  parts.channels[1].role = Role::kForce;
  const Record record = Record::make(parts);
  EXPECT_EQ(record.resolve("position"), std::vector<Index>{0});
  EXPECT_EQ(record.resolve("torque"), std::vector<Index>{1});
  EXPECT_EQ(record.resolve("force"), std::vector<Index>{1});
}

}  // namespace
}  // namespace ulna
