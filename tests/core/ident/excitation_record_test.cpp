// Designs as records, and their perturbations as segments of what was recorded.
#include "ident/excitation_record.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "base/error.hpp"
#include "signal/steps.hpp"

namespace ulna {
namespace {

Excitation design() {
  StepsSpec spec;
  spec.rate_hz = 100.0;
  spec.repeats = 1;
  spec.drive = Drive::kForce;
  return steps(spec);
}

Record recording(Index rows, double rate_hz, int trials) {
  Record::Parts parts;
  parts.rate_hz = rate_hz;
  parts.values = Matrix::Random(rows * trials, 1);
  for (Index i = 0; i < rows * trials; ++i) {
    parts.time.push_back(static_cast<double>(i) / rate_hz);
  }
  Channel channel;
  channel.name = "x";
  channel.unit = "m";
  parts.channels = {channel};
  for (int t = 0; t < trials; ++t) parts.trials.push_back({t * rows, (t + 1) * rows});
  return Record::make(std::move(parts));
}

TEST(ExcitationRecord, HoldsReferenceDerivativesAndSegments) {
  const Excitation e = design();
  const Record record = record_of(e, {"x", "y"}, false, true);
  ASSERT_EQ(record.channel_count(), 6);
  EXPECT_EQ(record.channels()[0].name, "F_x_ref");
  EXPECT_EQ(record.channels()[0].unit, "N");
  EXPECT_EQ(record.channels()[0].role, Role::kReference);
  EXPECT_EQ(record.channels()[3].name, "F_y_ref_rate");
  EXPECT_EQ(record.channels()[5].unit, "N/s^2");
  EXPECT_EQ(record.with_role(Role::kReference).size(), 2u);
  EXPECT_EQ(record.column(1), e.value.col(1));
  EXPECT_EQ(record.column(4), e.acceleration.col(0));
  EXPECT_EQ(record.segments().size(), e.segments.size());
  EXPECT_EQ(record.provenance().front(), e.provenance);
  EXPECT_EQ(record_of(e, {"a", "b"}, true, false).channels()[1].unit, "Nm");
  EXPECT_THROW(record_of(e, {"x"}, false, false), Error);
  EXPECT_THROW(record_of(e, {"x", "x"}, false, false), Error);
}

TEST(ExcitationRecord, SegmentsOfEveryTrialAtAnotherRate) {
  const Excitation e = design();
  const Index rows = 2 * e.rows() + 300;
  const Record marked = with_segments_of(recording(rows, 200.0, 2), e, 1.5);
  ASSERT_EQ(marked.segments().size(), 16u);
  for (std::size_t s = 0; s < 16; ++s) {
    const RowRange& range = e.segments[s % 8];
    const Index first = s < 8 ? 0 : rows;
    EXPECT_EQ(marked.segments()[s].begin, first + 300 + 2 * range.begin);
    EXPECT_EQ(marked.segments()[s].end, first + 300 + 2 * range.end);
    EXPECT_EQ(marked.segments()[s].trial, s < 8 ? 0 : 1);
  }
  try {
    with_segments_of(recording(rows, 200.0, 1), e, 1e4);
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kData);
    EXPECT_EQ(error.detail(), "segment 0");
  }
  EXPECT_THROW(with_segments_of(recording(rows, 200.0, 1), e, -1.0), Error);
  EXPECT_THROW(
      with_segments_of(recording(rows, 200.0, 1), e, std::numeric_limits<double>::quiet_NaN()),
      Error);
}

}  // namespace
}  // namespace ulna
