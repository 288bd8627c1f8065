// What the preparation reports, refuses and promises.
#include "ident/prepare.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "../impedance/made_record.hpp"
#include "base/error.hpp"
#include "ident/prepared_record.hpp"
#include "ident/regularise.hpp"

namespace ulna {
namespace {

Record example(double rate_hz = 1000.0, double duration_s = 12.0) {
  Recording recording;
  recording.rate_hz = rate_hz;
  recording.duration_s = duration_s;
  return make_record(participant(1), recording);
}

Prepared prepared(const Record& record, const PrepareOptions& options = {}, int threads = 1) {
  return prepare(record, find_roles(record, "", "", ""), options, threads);
}

struct Refusal {
  Fault fault = Fault::kInternal;
  std::string argument, message, detail;
};

template <class Call>
Refusal refusal(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return {error.fault(), error.argument(), error.what(), error.detail()};
  }
  ADD_FAILURE() << "nothing was refused";
  return {};
}

Refusal refused(const Record::Parts& parts, const PrepareOptions& options = {}) {
  return refusal([&] { prepared(Record::make(parts), options); });
}

bool says(const Refusal& refusal, const std::string& word) {
  return refusal.message.find(word) != std::string::npos;
}

TEST(Prepare, DefaultsAreThoseOfTheThesis) {
  PrepareOptions options;
  options.lowpass_hz = 5.0;
  const Prepared p = prepared(example(), options);
  EXPECT_EQ(p.report.window, 101);
  EXPECT_EQ(p.report.order, 6);
  EXPECT_EQ(p.report.lowpass_order, 5);
  EXPECT_EQ(p.report.lowpass_hz, 5.0);
  EXPECT_FALSE(p.report.lowpass_chosen);
  EXPECT_EQ(p.report.dropped_rows, 50);
  EXPECT_EQ(p.report.pad_rows, 712);  // ceil(ln 1e-3 / ln 0.990340), the slowest pole: 711.6
  // Two passes: 0.9156 of the design frequency at order 5 (10.3); the kernel takes 1e-4 more.
  EXPECT_NEAR(p.report.effective_cutoff_hz / 5.0, 0.9156, 2e-4);
  ASSERT_EQ(p.trials.size(), 1u);
  EXPECT_EQ(p.trials[0].begin(), 50);
  EXPECT_EQ(p.trials[0].rows(), 12000 - 100);
  EXPECT_EQ(p.trials[0].table().cols(), 14);
}

TEST(Prepare, ACorrectedLowPassIsEffectiveWhereItWasAskedFor) {
  PrepareOptions options;
  options.lowpass_hz = 5.0;
  options.corrected = true;
  const Prepared p = prepared(example(), options);
  EXPECT_NEAR(p.report.effective_cutoff_hz, 5.0, 2e-3);
  EXPECT_NEAR(p.report.lowpass_hz, 5.0 / 0.9156, 1e-3);
}

TEST(Prepare, WithoutALowPassNothingIsPadded) {
  PrepareOptions options;
  options.lowpass_hz = -1.0;
  const Prepared p = prepared(example(), options);
  EXPECT_EQ(p.report.lowpass_order, 0);
  EXPECT_EQ(p.report.lowpass_hz, 0.0);
  EXPECT_EQ(p.report.pad_rows, 0);
  EXPECT_EQ(p.report.transient_rows, 0);
}

// One linear operator for all: the law between the channels survives where plain kernels break it.
TEST(Prepare, MatchedKernelsKeepTheLawAndPlainOnesNearly) {
  const Truth arm = participant(1);
  const Record record = example();
  const auto error = [&](bool plain) {
    PrepareOptions options;
    options.lowpass_hz = 5.0;
    options.plain_savgol = plain;
    const PreparedTrial trial = prepared(record, options).trials[0];
    const Matrix offset = trial.position().rowwise() - arm.x0.transpose();
    const Matrix law = trial.acceleration() * arm.m.transpose() +
                       trial.velocity() * arm.b.transpose() + offset * arm.k.transpose();
    return (law + trial.force()).norm() / trial.force().norm();
  };
  EXPECT_LT(error(false), 1e-9);
  EXPECT_GT(error(true), 1e-7);
  EXPECT_LT(error(true), 1e-3);
}

TEST(Prepare, ThreadsDoNotChangeABit) {
  Recording recording;
  recording.trials = 4;
  recording.duration_s = 10.0;
  const Record record = make_record(participant(1), recording);
  const Prepared one = prepared(record, {}, 1);
  const Prepared four = prepared(record, {}, 4);
  for (std::size_t t = 0; t < 4; ++t) {
    EXPECT_EQ(one.trials[t].table(), four.trials[t].table());
    EXPECT_EQ(one.trials[t].begin(), record.trials()[t].begin + one.report.dropped_rows);
  }
}

TEST(Prepare, RefusesMissingNumbersWithTheirRow) {
  Record::Parts parts = example().parts();
  parts.values.block(3210, 2, 7, 1).setConstant(std::nan(""));
  const Refusal r = refused(parts);
  EXPECT_EQ(r.fault, Fault::kData);
  EXPECT_EQ(r.argument, "F_x");
  EXPECT_EQ(r.detail, "row 3210");
  EXPECT_TRUE(says(r, "7 rows from row 3210")) << r.message;
}

TEST(Prepare, RefusesGapsAndJitterApart) {
  Record::Parts gap = example().parts();
  for (std::size_t i = 5000; i < gap.time.size(); ++i) gap.time[i] += 0.25;
  const Refusal missing = refused(gap);
  EXPECT_EQ(missing.fault, Fault::kData);
  EXPECT_EQ(missing.detail, "row 5000");
  EXPECT_TRUE(says(missing, "samples are missing")) << missing.message;

  Record::Parts jitter = example().parts();
  jitter.time[700] += 0.0003;
  const Refusal shaken = refused(jitter);
  EXPECT_EQ(shaken.fault, Fault::kData);
  EXPECT_EQ(shaken.detail, "row 700");
  EXPECT_TRUE(says(shaken, "jitter")) << shaken.message;
}

TEST(Prepare, RefusesChannelsThatSayNothing) {
  Record::Parts zero = example().parts();
  zero.values.col(3).setZero();
  EXPECT_TRUE(says(refused(zero), "zero throughout"));
  EXPECT_EQ(refused(zero).argument, "F_y");
  Record::Parts constant = example().parts();
  constant.values.col(0).setConstant(0.2);
  EXPECT_TRUE(says(refused(constant), "constant"));
  EXPECT_EQ(refused(constant).argument, "x");
}

TEST(Prepare, RefusesTooFewSamples) {
  Record::Parts parts = example(1000.0, 0.15).parts();
  PrepareOptions options;
  options.lowpass_hz = 5.0;
  const Refusal r = refused(parts, options);
  EXPECT_EQ(r.fault, Fault::kData);
  EXPECT_TRUE(says(r, "only 150 samples")) << r.message;
  Record::Parts ten = example(1000.0, 0.01).parts();
  EXPECT_EQ(refused(ten).fault, Fault::kData);
}

TEST(Prepare, RefusesOptionsThatDoNotFit) {
  const Record record = example();
  const auto with = [&](auto change) {
    PrepareOptions options;
    change(options);
    return refusal([&] { prepared(record, options); }).fault;
  };
  EXPECT_EQ(with([](auto& o) { o.lowpass_hz = 500.0; }), Fault::kArgument);
  EXPECT_EQ(with([](auto& o) { o.lowpass_hz = std::nan(""); }), Fault::kArgument);
  EXPECT_EQ(with([](auto& o) { o.window = 100; }), Fault::kArgument);
  EXPECT_EQ(with([](auto& o) { o.order = 1; }), Fault::kArgument);
  EXPECT_EQ(with([](auto& o) { o.lowpass_order = -3; }), Fault::kArgument);
}

TEST(Prepare, RolesAreFoundAndMissingOnesNamed) {
  const Record record = example();
  const Roles roles = find_roles(record, "", "F", "x_ref");
  EXPECT_EQ(roles.position, (std::vector<Index>{0, 1}));
  EXPECT_EQ(roles.force, (std::vector<Index>{2, 3}));
  EXPECT_EQ(roles.reference, (std::vector<Index>{4, 5}));
  Record::Parts parts = record.parts();
  parts.channels[2].role = parts.channels[3].role = Role::kOther;
  const Record blind = Record::make(parts);
  const Refusal none = refusal([&] { find_roles(blind, "", "", ""); });
  EXPECT_EQ(none.argument, "force");
  EXPECT_TRUE(says(none, "F_x")) << none.message;
  parts.channels[2].role = Role::kForce;
  const Record half = Record::make(parts);
  EXPECT_TRUE(says(refusal([&] { find_roles(half, "", "", ""); }), "every axis"));
}

TEST(PreparedRecord, HoldsWhatTheAnalysisSaw) {
  const Record record = example();
  const Prepared p = prepared(record);
  const Record out = prepared_record(record, p);
  EXPECT_EQ(out.rows(), p.trials[0].rows());
  EXPECT_EQ(Matrix(out.values()), p.trials[0].table());
  EXPECT_EQ(out.column(out.find("x_acceleration")), p.trials[0].acceleration().col(0));
  EXPECT_EQ(out.channels()[static_cast<std::size_t>(out.find("y_ref_rate"))].unit, "m/s");
  EXPECT_EQ(out.time()[0], record.time()[static_cast<std::size_t>(p.report.dropped_rows)]);
  EXPECT_EQ(out.provenance().size(), record.provenance().size() + 1);
}

TEST(Regularise, AJitteredClockGivesTheSameSignals) {
  const Record even = example(1000.0, 6.0);
  Record::Parts parts = even.parts();
  Random random(2);
  // Jitter the clock and sample the same motion there: by a local parabola, exact to 1e-9 of 3 Hz.
  for (Index i = 1; i + 1 < even.rows(); ++i) {
    const double u = 0.4 * (random.uniform() - 0.5);
    parts.time[static_cast<std::size_t>(i)] += u / 1000.0;
    const auto before = even.values().row(i - 1), here = even.values().row(i),
               after = even.values().row(i + 1);
    parts.values.row(i) =
        here + 0.5 * u * (after - before) + 0.5 * u * u * (after - 2.0 * here + before);
  }
  parts.rate_hz = 1000.0;
  const Record shaken = Record::make(parts);
  EXPECT_THROW(prepared(shaken), Error);
  const Record out = regularise(shaken);
  ASSERT_EQ(out.rows(), even.rows());
  const Matrix inside = (out.values() - even.values()).middleRows(200, 5600);
  EXPECT_LT(inside.leftCols(2).cwiseAbs().maxCoeff(), 1e-6 * 0.04);  // m, of 40 mm
  EXPECT_NO_THROW(prepared(out));
  EXPECT_NE(out.provenance().back().find("even clock"), std::string::npos);
}

TEST(Regularise, RefusesWhatItWouldInvent) {
  Record::Parts gap = example(1000.0, 3.0).parts();
  for (std::size_t i = 1000; i < gap.time.size(); ++i) gap.time[i] += 0.5;
  gap.rate_hz = 1000.0;
  const Record broken = Record::make(gap);
  EXPECT_EQ(refusal([&] { regularise(broken); }).fault, Fault::kData);
  Record::Parts holes = example(1000.0, 3.0).parts();
  holes.values(1234, 0) = std::nan("");
  const Record missing = Record::make(holes);
  const Refusal r = refusal([&] { regularise(missing); });
  EXPECT_EQ(r.fault, Fault::kData);
  EXPECT_EQ(r.detail, "row 1234");
  EXPECT_EQ(refusal([&] { regularise(example(), -1.0); }).fault, Fault::kArgument);
  EXPECT_EQ(refusal([&] { regularise(example(), std::nan("")); }).fault, Fault::kArgument);
}

}  // namespace
}  // namespace ulna
