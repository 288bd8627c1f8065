#include <cmath>
#include <limits>

#include "base/random.hpp"
#include "record/look.hpp"
#include "record/split.hpp"
#include "text.hpp"

namespace ulna {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A noisy motion and force of one axis, 1 kHz.
Record::Parts motion(Index rows, double scale = 0.01, const char* unit = "m") {
  Record::Parts parts;
  Random random(7);
  parts.values.resize(rows, 2);
  for (Index i = 0; i < rows; ++i) {
    const double t = 1e-3 * static_cast<double>(i);
    parts.time.push_back(t);
    parts.values(i, 0) = scale * (std::sin(9.0 * t) + 0.01 * random.normal());
    parts.values(i, 1) = 5.0 * std::cos(9.0 * t) + 0.1 * random.normal();
  }
  parts.channels = {{"x", unit, "", 1, Role::kPosition, 0, "x", unit},
                    {"F_x", "N", "", 1, Role::kForce, 0, "F_x", "N"}};
  return parts;
}

std::vector<Finding> findings(const Record::Parts& parts) { return look(Record::make(parts)); }

TEST(Look, FindsNothingInAGoodLog) { EXPECT_TRUE(findings(motion(5000)).empty()); }

TEST(Look, VoicesSuspiciousUnits) {
  EXPECT_TRUE(has(findings(motion(5000, 10.0)), "unit", "x"));         // mm taken for m
  EXPECT_TRUE(has(findings(motion(5000, 10.0, "rad")), "unit", "x"));  // degrees taken for rad
  EXPECT_TRUE(has(findings(motion(5000, 1e-6)), "unit", "x"));         // m taken for mm
  Record::Parts parts = motion(5000);
  parts.values.col(1) *= 1e4;
  EXPECT_TRUE(has(findings(parts), "unit", "F_x"));
  parts.channels[1].unit = "Nm";
  parts.values.col(1) *= 1e-1;
  EXPECT_TRUE(has(findings(parts), "unit", "F_x"));
}

TEST(Look, FindsClockFaults) {
  Record::Parts parts = motion(5000);
  for (std::size_t i = 2000; i < 5000; ++i) parts.time[i] += 0.5;
  const std::vector<Finding> gap = findings(parts);
  ASSERT_TRUE(has(gap, "gap"));
  EXPECT_EQ(gap[0].row, 2000);
  EXPECT_EQ(gap[0].severity, Severity::kError);
  parts = motion(5000);
  Random random(3);
  for (double& t : parts.time) t += 1e-4 * (random.uniform() - 0.5);
  EXPECT_TRUE(has(findings(parts), "jitter"));
  parts = motion(5000);
  for (double& t : parts.time) t *= 1e3;  // ms taken for s
  EXPECT_TRUE(has(findings(parts), "rate"));
  EXPECT_TRUE(has(findings(motion(10)), "short"));
}

TEST(Look, FindsMissingConstantAndZero) {
  Record::Parts parts = motion(5000);
  parts.values(100, 0) = parts.values(101, 0) = parts.values(300, 0) = kNan;
  const std::vector<Finding> nan = findings(parts);
  ASSERT_TRUE(has(nan, "nan", "x"));
  EXPECT_EQ(nan[0].row, 100);
  EXPECT_EQ(nan[0].count, 3);
  EXPECT_NE(nan[0].message.find("2 runs"), std::string::npos);
  parts = motion(5000);
  parts.values.col(1).setZero();
  EXPECT_TRUE(has(findings(parts), "zero", "F_x"));
  parts.values.col(1).setConstant(2.0);
  EXPECT_TRUE(has(findings(parts), "constant", "F_x"));
  parts.values.col(1).setConstant(kNan);
  EXPECT_TRUE(has(findings(parts), "nan", "F_x"));
}

TEST(Look, FindsClippingButNoRestAndNoQuanta) {
  Record::Parts parts = motion(5000);
  parts.values.col(1) = parts.values.col(1).cwiseMin(4.0);
  EXPECT_TRUE(has(findings(parts), "saturated", "F_x"));
  parts = motion(5000);
  parts.values.col(1) = parts.values.col(1).cwiseMin(4.9).cwiseMax(-4.9);
  EXPECT_TRUE(has(findings(parts), "saturated", "F_x"));
  // A slow encoder of 1000 steps turns on its extreme values.
  parts = motion(5000);
  for (Index i = 0; i < 5000; ++i) {
    const double t = parts.time[static_cast<std::size_t>(i)];
    parts.values(i, 0) = std::round(1000.0 * std::sin(3.0 * t)) * 1e-5;
  }
  EXPECT_FALSE(has(findings(parts), "saturated"));
  // At rest before the motion, with the rest at the extreme.
  for (Index i = 0; i < 5000; ++i) {
    const double t = parts.time[static_cast<std::size_t>(i)];
    parts.values(i, 0) = t < 1.0 ? 0.0 : 0.01 * (1.0 - std::cos(3.0 * (t - 1.0)));
  }
  EXPECT_FALSE(has(findings(parts), "saturated"));
  // Coarse quanta are only noted.
  parts = motion(5000);
  parts.values.col(0) = (parts.values.col(0).array() / 5e-4).round() * 5e-4;
  EXPECT_TRUE(has(findings(parts), "quantised", "x"));
}

TEST(Split, CutsAtGapsAndMissingValues) {
  Record::Parts parts = motion(3000);
  for (std::size_t i = 1000; i < 3000; ++i) parts.time[i] += 0.5;
  for (Index i = 2000; i < 2010; ++i) parts.values(i, 1) = kNan;
  parts.values(2050, 1) = kNan;
  const Record record = split(Record::make(parts));
  ASSERT_EQ(record.trials().size(), 3u);  // rows 2010 to 2050 are too short
  EXPECT_EQ(record.trials()[0].end, 1000);
  EXPECT_EQ(record.trials()[1].begin, 1000);
  EXPECT_EQ(record.trials()[1].end, 2000);
  EXPECT_EQ(record.trials()[2].begin, 2051);
  EXPECT_EQ(record.rows(), 3000);
  EXPECT_FALSE(has(look(record), "gap"));
  EXPECT_FALSE(has(look(record), "nan"));
  parts.values.col(1).setConstant(kNan);
  EXPECT_THROW(split(Record::make(parts)), Error);
}

TEST(Split, SelectsRowsAndTrials) {
  Record::Parts parts = motion(3000);
  parts.trials = {{0, 1000}, {1000, 2000}, {2000, 3000}};
  const Record record = Record::make(parts);
  const Record rows = select_rows(record, 500, 1500);
  EXPECT_EQ(rows.rows(), 1000);
  ASSERT_EQ(rows.trials().size(), 2u);
  EXPECT_EQ(rows.values()(0, 0), record.values()(500, 0));
  EXPECT_EQ(rows.segments()[1].begin, 500);
  const Record trials = select_trials(record, {2, 0, 2});
  EXPECT_EQ(trials.rows(), 2000);
  EXPECT_EQ(trials.values()(1000, 1), record.values()(2000, 1));
  EXPECT_EQ(trials.provenance().back(), "trials 0, 2");
  EXPECT_THROW(select_trials(record, {3}), Error);
  EXPECT_THROW(select_trials(record, {}), Error);
  EXPECT_THROW(select_rows(record, 10, 10), Error);
  EXPECT_THROW(select_rows(record, 0, 3001), Error);
}

TEST(Split, CutsSegmentsAtOnsets) {
  const Record record = Record::make(motion(3000));
  const Record cut = with_segments(record, {2.0, 0.5}, 0.1, 0.3);
  ASSERT_EQ(cut.segments().size(), 2u);
  EXPECT_EQ(cut.segments()[0].begin, 400);
  EXPECT_EQ(cut.segments()[0].end, 800);
  EXPECT_EQ(cut.segments()[1].begin, 1900);
  for (const double onset : {2.9, 0.05, 7.0, -1.0, kNan}) {
    EXPECT_THROW(with_segments(record, {onset}, 0.1, 0.3), Error) << onset;
  }
}

TEST(Split, JoinsTrialsOfTheSameChannels) {
  const Record a = Record::make(motion(1000));
  const Record both = join({a, a});
  EXPECT_EQ(both.trials().size(), 2u);
  EXPECT_EQ(both.values()(1500, 0), a.values()(500, 0));
  Record::Parts other = motion(1000);
  other.channels[1].name = "F_y";
  EXPECT_THROW(join({a, Record::make(other)}), Error);
  other = motion(1000);
  for (double& t : other.time) t *= 2.0;
  EXPECT_THROW(join({a, Record::make(other)}), Error);
  EXPECT_THROW(join({}), Error);
}

}  // namespace
}  // namespace ulna
