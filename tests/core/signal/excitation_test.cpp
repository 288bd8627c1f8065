// Designs against closed forms: filter responses, spectrum lines, crest factors, ranges and orders.
#include "signal/excitation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "base/error.hpp"
#include "base/random.hpp"
#include "signal/binary_sequence.hpp"
#include "signal/crest.hpp"
#include "signal/multisine.hpp"
#include "signal/steps.hpp"

namespace ulna {
namespace {

template <class Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()), "");
    return error.argument();
  }
  return "nothing was refused";
}

// The filter
// ---------------------------------------------------------------------------------------

TEST(SecondOrder, FactsOfThePublishedFilter) {
  const StepFacts facts = step_facts({});
  EXPECT_NEAR(100.0 * facts.overshoot, 72.9248, 5e-5);  // the reference's last digit
  EXPECT_NEAR(facts.peak_time_s, 0.210495, 5e-7);
  EXPECT_NEAR(facts.settling_s, 2.67, 5e-3);
  const SignalPoint peak = step_response({}, facts.peak_time_s);
  EXPECT_NEAR(peak.value, 1.0 + facts.overshoot, 1e-14);
  EXPECT_NEAR(peak.rate, 0.0, 1e-13);
  EXPECT_EQ(step_facts({1.0, 2.0}).overshoot, 0.0);
  EXPECT_NEAR(step_facts({1.0, 2.0}).settling_s, 2.0, 1e-15);
}

// x'' + 2 zeta w x' + w^2 x = w^2 at every damping, and the derivatives belong to each other.
TEST(SecondOrder, SatisfiesItsEquationAtEveryDamping) {
  for (const double zeta :
       {0.01, 0.1, 0.7, 0.999, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.001, 3.0, 100.0}) {
    const SecondOrder filter{zeta, 15.0};
    for (double t = 0.0; t < 3.0; t += 0.0371) {
      const SignalPoint p = step_response(filter, t);
      EXPECT_NEAR(p.acceleration + 2.0 * zeta * 15.0 * p.rate + 225.0 * p.value, 225.0, 1e-9)
          << zeta << " " << t;
      // A central difference errs by h^2 f''' / 6: 1e-10 * (2 zeta w)^3 / 6 at most.
      const double h = 1e-5;
      const double slope =
          (step_response(filter, t + h).value - step_response(filter, t - h).value) / (2.0 * h);
      if (t > 2.0 * h) {
        EXPECT_NEAR(p.rate, slope, 1e-10 * std::pow(30.0 * std::max(1.0, zeta), 3) + 1e-9);
      }
    }
  }
}

TEST(SecondOrder, NearCriticalDampingIsContinuous) {
  for (double t = 0.0; t < 1.0; t += 0.01) {
    const double at = step_response({1.0, 15.0}, t).value;
    // Closed form of the double pole.
    EXPECT_NEAR(at, 1.0 - std::exp(-15.0 * t) * (1.0 + 15.0 * t), 1e-14);
    EXPECT_NEAR(step_response({1.0 - 1e-8, 15.0}, t).value, at, 1e-7);
    EXPECT_NEAR(step_response({1.0 + 1e-8, 15.0}, t).value, at, 1e-7);
  }
}

TEST(SecondOrder, AResponseContinuesFromAnyState) {
  const SecondOrder filter{0.1, 15.0};
  const SignalPoint half = free_response(filter, 0.3, -2.0, 0.17);
  const SignalPoint all = free_response(filter, 0.3, -2.0, 0.41);
  const SignalPoint then = free_response(filter, half.value, half.rate, 0.24);
  EXPECT_NEAR(then.value, all.value, 1e-15);
  EXPECT_NEAR(then.rate, all.rate, 1e-13);
}

TEST(SecondOrder, BadFilters) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double zeta : {0.0, -0.1, 101.0, nan}) {
    EXPECT_EQ(refusal([&] { check_second_order({zeta, 15.0}); }), "damping_ratio");
  }
  for (const double w : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(refusal([&] { check_second_order({0.1, w}); }), "natural_rad_s");
  }
}

TEST(SecondOrder, TheWayBackMeetsStateAndRest) {
  const SignalPoint from{1.3, -4.0, 70.0};
  const SignalPoint begin = gently_back(from, 0.8, 0.0);
  EXPECT_NEAR(begin.value, 1.3, 1e-15);
  EXPECT_NEAR(begin.rate, -4.0, 1e-14);
  EXPECT_NEAR(begin.acceleration, 70.0, 1e-12);
  const SignalPoint end = gently_back(from, 0.8, 0.8);
  EXPECT_NEAR(end.value, 0.0, 1e-14);
  EXPECT_NEAR(end.rate, 0.0, 1e-13);
  EXPECT_NEAR(end.acceleration, 0.0, 1e-11);
}

// Crest factors
// ------------------------------------------------------------------------------------

Sinusoids harmonics(Index count) {
  Sinusoids out{Vector::LinSpaced(count, 1.0, static_cast<double>(count)), Vector::Ones(count),
                Vector::Zero(count)};
  return out;
}

TEST(Crest, ClosedForms) {
  // Equal phases: the peak is the sum, the rms sqrt(count / 2).
  for (const Index count : {1, 2, 10, 31}) {
    const Sinusoids lines = harmonics(count);
    EXPECT_NEAR(crest_factor(lines, 1.0), std::sqrt(2.0 * static_cast<double>(count)), 1e-12);
  }
}

TEST(Crest, SchroederOfAFlatSpectrum) {
  const Vector phase = schroeder_phases(Vector::Ones(15));
  for (Index k = 0; k < 15; ++k) {
    // -pi k (k - 1) / count with k from 1, up to the slope that a shift in time adds: the second
    // difference is -2 pi / count.
    if (k < 2) continue;
    const double second = phase[k] - 2.0 * phase[k - 1] + phase[k - 2];
    EXPECT_NEAR(std::remainder(second + 2.0 * kPi / 15.0, 2.0 * kPi), 0.0, 1e-12);
  }
  // Flat spectra keep a crest factor near 1.7 however many lines they have (Schroeder 1970).
  for (const Index count : {15, 31, 63, 127}) {
    Sinusoids lines = harmonics(count);
    lines.phase_rad = schroeder_phases(lines.amplitude);
    const double crest = crest_factor(lines, 1.0);
    EXPECT_GT(crest, 1.6) << count;
    EXPECT_LT(crest, 1.8) << count;
  }
}

TEST(Crest, OptimisedIsBelowSchroederIsBelowRandom) {
  double optimised = 0.0, schroeder = 0.0, random = 0.0;
  for (int seed = 0; seed < 8; ++seed) {
    Random numbers(static_cast<std::uint64_t>(seed), 99);
    Sinusoids lines = harmonics(10);
    for (double& a : lines.phase_rad) a = 2.0 * kPi * numbers.uniform();
    random += crest_factor(lines, 1.0) / 8.0;
    lines.phase_rad = schroeder_phases(lines.amplitude);
    schroeder += crest_factor(lines, 1.0) / 8.0;
    lines.phase_rad = low_crest_phases(lines, 1.0, 3, static_cast<std::uint64_t>(seed), 0, nullptr);
    const double found = crest_factor(lines, 1.0);
    optimised += found / 8.0;
    EXPECT_LT(found, 1.5) << seed;
  }
  EXPECT_LT(optimised, 0.9 * schroeder);
  EXPECT_LT(schroeder, 0.9 * random);
}

TEST(Crest, GoodPhasesAreNotMadeWorseAndOneLineIsLeft) {
  Sinusoids lines = harmonics(6);
  lines.phase_rad = low_crest_phases(lines, 1.0, 6, 5, 0, nullptr);
  const double before = crest_factor(lines, 1.0);
  lines.phase_rad = low_crest_phases(lines, 1.0, 0, 0, 0, nullptr);
  EXPECT_LE(crest_factor(lines, 1.0), before * (1.0 + 2e-3));  // judged on a coarser grid
  const Sinusoids one{Vector::Ones(1), Vector::Ones(1), Vector::Constant(1, 0.4)};
  EXPECT_EQ(low_crest_phases(one, 1.0, 3, 0, 0, nullptr)[0], 0.4);
}

TEST(Crest, CanBeCancelled) {
  Token token;
  token.cancel();
  EXPECT_THROW(low_crest_phases(harmonics(10), 1.0, 3, 0, 0, &token), Error);
}

// Multisines
// ---------------------------------------------------------------------------------------

MultisineSpec spec(Index axes = 2) {
  MultisineSpec out;
  out.amplitude = Vector::Constant(axes, 0.01);
  out.rate_hz = 200.0;
  out.duration_s = 20.0;
  return out;
}

// Amplitude and phase of one line by correlation over whole periods.
std::complex<double> at_line(const Vector& u, double freq_hz, double rate_hz) {
  std::complex<double> sum = 0.0;
  for (Index i = 0; i < u.size(); ++i) {
    sum += u[i] * std::polar(1.0, -2.0 * kPi * freq_hz * static_cast<double>(i) / rate_hz);
  }
  return 2.0 * sum / static_cast<double>(u.size());
}

TEST(Multisine, LinesAreWhereTheyAreSaidAndNowhereElse) {
  for (const Phases phases : {Phases::kOptimised, Phases::kRandom, Phases::kSchroeder}) {
    MultisineSpec s = spec();
    s.phases = phases;
    s.slope = -0.5;
    const Excitation e = multisine(s);
    ASSERT_EQ(e.lines.size(), 20u);
    EXPECT_EQ(e.period_s, 20.0);
    for (Index a = 0; a < 2; ++a) {
      std::map<Index, Line> own;
      for (const Line& line : e.lines) {
        if (line.axis == a) own[static_cast<Index>(std::lround(20.0 * line.freq_hz))] = line;
      }
      ASSERT_EQ(own.size(), 10u);
      const double first = own.begin()->second.amplitude;
      for (Index bin = 1; bin < 80; ++bin) {
        const auto found = at_line(e.value.col(a), static_cast<double>(bin) / 20.0, 200.0);
        const auto line = own.find(bin);
        if (line == own.end()) {
          EXPECT_LT(std::abs(found), 1e-15) << bin;
          continue;
        }
        const Line& l = line->second;
        EXPECT_NEAR(std::abs(found - std::polar(l.amplitude, l.phase_rad)), 0.0, 1e-15) << bin;
        EXPECT_NEAR(l.amplitude / first, std::pow(l.freq_hz / own.begin()->second.freq_hz, -0.5),
                    1e-12);
      }
      EXPECT_NEAR(e.value.col(a).cwiseAbs().maxCoeff(), 0.01, 1e-17);
    }
  }
}

// 20 lines on the 150 steps of 50 s: 7 steps apart rather than 7.5, so that both axes hold
// harmonics.
TEST(Multisine, LinesAreHarmonicsWhereThatReachesTheBand) {
  MultisineSpec s = spec();
  s.duration_s = 50.0;
  s.phases = Phases::kSchroeder;
  const Excitation e = multisine(s);
  for (const Line& line : e.lines) {
    const double cycles = 50.0 * line.freq_hz;
    EXPECT_NEAR(std::remainder(cycles, 7.0), 0.0, 1e-9) << line.freq_hz;
    EXPECT_EQ(std::lround(cycles / 7.0) % 2, line.axis == 0 ? 1 : 0);
  }
  s.duration_s = 25.0;  // 3.75 steps: 3 would leave a fifth of the band empty
  const Excitation wide = multisine(s);
  double highest = 0.0;
  for (const Line& line : wide.lines) highest = std::max(highest, line.freq_hz);
  EXPECT_NEAR(highest, 3.0, 1e-12);
}

TEST(Multisine, AxesTakeTurnsOrShare) {
  const Excitation turns = multisine(spec());
  std::set<double> all;
  for (const Line& line : turns.lines) all.insert(line.freq_hz);
  EXPECT_EQ(all.size(), 20u);
  EXPECT_EQ(*all.rbegin(), 3.0);

  MultisineSpec s = spec(3);
  s.shared = true;
  for (const Phases phases : {Phases::kOptimised, Phases::kRandom, Phases::kSchroeder}) {
    s.phases = phases;
    const Excitation shared = multisine(s);
    std::set<double> few;
    for (const Line& line : shared.lines) few.insert(line.freq_hz);
    EXPECT_EQ(few.size(), 10u);
    // Not along a line: no axis repeats another, nor its speed.
    for (const Matrix* other : {&shared.value, &shared.rate}) {
      const Matrix cross = shared.value.transpose() * *other;
      for (Index i = 0; i < 3; ++i) {
        for (Index j = 0; j < 3; ++j) {
          if (i == j) continue;
          EXPECT_LT(std::abs(cross(i, j)), 0.5 * shared.value.col(i).norm() * other->col(j).norm());
        }
      }
    }
    EXPECT_EQ(shared.notes.size(), 3u);
  }
}

TEST(Multisine, DerivativesAndStart) {
  const Excitation e = multisine(spec());
  const Index rows = e.rows();
  const double h = 1.0 / 200.0;
  for (Index a = 0; a < 2; ++a) {
    EXPECT_NEAR(e.value(0, a), 0.0, 1e-14);  // it starts where the robot is
    const Vector v = e.value.col(a);
    const Vector r = e.rate.col(a);
    // Simpson's rule over two samples errs by h^5 / 90 of the fifth derivative: 1e-9 here.
    for (Index i = 1; i + 1 < rows; ++i) {
      EXPECT_NEAR(v[i + 1] - v[i - 1], h / 3.0 * (r[i - 1] + 4.0 * r[i] + r[i + 1]), 1e-9);
    }
    double sum = 0.0;
    for (const Line& line : e.lines) {
      if (line.axis == a)
        sum += line.amplitude * line.amplitude * 8.0 * std::pow(kPi, 4) * std::pow(line.freq_hz, 4);
    }
    EXPECT_NEAR(e.acceleration.col(a).squaredNorm() / static_cast<double>(rows), sum, 1e-9 * sum);
  }
}

TEST(Multisine, RmsCrestAndNames) {
  MultisineSpec s = spec();
  s.rms = true;
  const Extent extent = extent_of(multisine(s));
  for (Index a = 0; a < 2; ++a) {
    EXPECT_NEAR(extent.rms[a], 0.01, 1e-16);
    EXPECT_LT(extent.crest[a], 1.6);
    EXPECT_NEAR(extent.crest[a], extent.peak[a] / extent.rms[a], 1e-15);
  }
}

TEST(Multisine, AFadeStartsAndEndsAtRest) {
  MultisineSpec s = spec();
  s.fade_s = 1.0;
  const Excitation e = multisine(s);
  EXPECT_EQ(e.rows(), 4000);
  ASSERT_EQ(e.segments.size(), 1u);
  EXPECT_EQ(e.segments[0].begin, 200);
  EXPECT_EQ(e.segments[0].end, 3800);
  EXPECT_EQ(e.period_s, 18.0);
  for (const Index row : {Index{0}, e.rows() - 1}) {
    EXPECT_EQ(e.value.row(row).norm(), 0.0);
    EXPECT_EQ(e.rate.row(row).norm(), 0.0);
    EXPECT_EQ(e.acceleration.row(row).norm(), 0.0);
  }
  // Within the segment nothing is faded, and the lines fit it.
  const Vector used = e.value.col(0).segment(200, 3600);
  for (const Line& line : e.lines) {
    if (line.axis != 0) continue;
    EXPECT_NEAR(std::abs(at_line(used, line.freq_hz, 200.0)), line.amplitude, 1e-15);
  }
  // Product rule.
  for (Index i = 1; i < 199; ++i) {
    const double slope = (e.value(i + 1, 0) - e.value(i - 1, 0)) * 100.0;
    EXPECT_NEAR(e.rate(i, 0), slope, 2e-4);
    const double second = (e.rate(i + 1, 0) - e.rate(i - 1, 0)) * 100.0;
    EXPECT_NEAR(e.acceleration(i, 0), second, 1e-2);
  }
}

TEST(Multisine, OwnLinesAndTheirLeakage) {
  MultisineSpec s = spec();
  s.lines_hz = Matrix{{0.5}, {1.25}, {2.0}};
  Excitation e = multisine(s);
  EXPECT_EQ(e.lines.size(), 6u);
  EXPECT_NE(e.notes[0].find("do not leak"), std::string::npos);
  s.lines_hz(1, 0) = 1.26;
  e = multisine(s);
  EXPECT_NE(e.notes[0].find("2 of 6 lines, the first at 1.26 Hz"), std::string::npos) << e.notes[0];
  s = spec();
  s.period_s = 8.0;
  e = multisine(s);
  EXPECT_NE(e.notes[0].find("take the first 16 s"), std::string::npos) << e.notes[0];
}

TEST(Multisine, SeedsTell) {
  MultisineSpec s = spec();
  s.phases = Phases::kRandom;
  const Excitation a = multisine(s);
  EXPECT_EQ(a.value, multisine(s).value);
  s.seed = 1;
  EXPECT_NE(a.value, multisine(s).value);
  s.phases = Phases::kOptimised;
  EXPECT_EQ(multisine(s).value, multisine(s).value);
}

TEST(Multisine, BadInput) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto with = [](auto change) {
    MultisineSpec s = spec();
    change(s);
    return refusal([&] { multisine(s); });
  };
  EXPECT_EQ(with([&](auto& s) { s.rate_hz = 0.0; }), "rate_hz");
  EXPECT_EQ(with([&](auto& s) { s.rate_hz = nan; }), "rate_hz");
  EXPECT_EQ(with([&](auto& s) { s.duration_s = -1.0; }), "fade_s");
  EXPECT_EQ(with([&](auto& s) { s.duration_s = 1e12; }), "duration_s");
  EXPECT_EQ(with([&](auto& s) { s.amplitude[1] = 0.0; }), "amplitude");
  EXPECT_EQ(with([&](auto& s) { s.amplitude = Vector::Ones(7); }), "axes");
  EXPECT_EQ(with([&](auto& s) { s.amplitude = Vector(); }), "axes");
  EXPECT_EQ(with([&](auto& s) { s.lines = 0; }), "lines");
  EXPECT_EQ(with([&](auto& s) { s.lines = 31; }), "lines");  // the band holds 60 for both axes
  EXPECT_EQ(with([&](auto& s) { s.high_hz = 100.0; }), "high_hz");
  EXPECT_EQ(with([&](auto& s) { s.low_hz = 3.0; }), "high_hz");
  EXPECT_EQ(with([&](auto& s) { s.low_hz = -0.1; }), "low_hz");
  EXPECT_EQ(with([&](auto& s) { s.fade_s = 10.0; }), "fade_s");
  EXPECT_EQ(with([&](auto& s) { s.fade_s = nan; }), "fade_s");
  EXPECT_EQ(with([&](auto& s) { s.slope = 5.0; }), "slope");
  EXPECT_EQ(with([&](auto& s) { s.period_s = nan; }), "period_s");
  EXPECT_EQ(with([&](auto& s) { s.starts = -1; }), "starts");
  EXPECT_EQ(with([&](auto& s) { s.lines_hz = Matrix{{1.0}, {1.0}}; }), "lines_hz");
  EXPECT_EQ(with([&](auto& s) { s.lines_hz = Matrix{{100.0}}; }), "lines_hz");
  EXPECT_EQ(with([&](auto& s) { s.lines_hz = Matrix{{1.0, 2.0, 3.0}}; }), "lines_hz");
}

// Steps
// --------------------------------------------------------------------------------------------

TEST(Steps, RangesOrderAndDirections) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    StepsSpec s;
    s.seed = seed;
    const Excitation e = steps(s);
    ASSERT_EQ(e.events.size(), 16u);
    ASSERT_EQ(e.segments.size(), 16u);
    double free_since = 0.0;
    std::vector<int> count(8, 0);
    for (std::size_t i = 0; i < 16; ++i) {
      const StepEvent& event = e.events[i];
      EXPECT_GE(event.hold_s, 1.5);
      EXPECT_LE(event.hold_s, 2.0);
      EXPECT_GE(event.onset_s - free_since, 2.0 - 1e-12);
      EXPECT_LE(event.onset_s - free_since, 7.0 + 1e-12);
      free_since = event.onset_s + event.hold_s;
      EXPECT_EQ(e.segments[i].begin, std::lround(1000.0 * event.onset_s));
      EXPECT_EQ(e.segments[i].end, std::lround(1000.0 * free_since));
      EXPECT_NEAR(event.size.norm(), 0.005, 1e-17);
      const double angle = std::atan2(event.size[1], event.size[0]);
      EXPECT_NEAR(
          std::remainder(angle - kPi / 4.0 * static_cast<double>(event.direction), 2.0 * kPi), 0.0,
          1e-14);
      ++count[static_cast<std::size_t>(event.direction)];
      // The first half holds every direction once, so that it identifies as well as all.
      if (i == 7) {
        EXPECT_EQ(count, std::vector<int>(8, 1));
      }
    }
    EXPECT_EQ(count, std::vector<int>(8, 2));
  }
}

TEST(Steps, TheReferenceIsTheFilteredStepThenRest) {
  StepsSpec s;
  s.seed = 3;
  const Excitation e = steps(s);
  Index before = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    const auto [begin, end] = e.segments[i];
    // Rest from the end of the way back to the onset.
    const Index still = i == 0 ? 0 : before + 1001;
    EXPECT_EQ(e.value.middleRows(still, begin - still).cwiseAbs().maxCoeff(), 0.0);
    for (Index r = begin; r < end; ++r) {
      const SignalPoint p = step_response({}, static_cast<double>(r - begin) / 1000.0);
      EXPECT_NEAR((e.value.row(r).transpose() - p.value * e.events[i].size).norm(), 0.0, 1e-17);
      EXPECT_NEAR((e.rate.row(r).transpose() - p.rate * e.events[i].size).norm(), 0.0, 1e-15);
    }
    before = end;
  }
  // No jump anywhere but of the acceleration at an onset: w^2 times the size.
  const double jump = (e.value.bottomRows(e.rows() - 1) - e.value.topRows(e.rows() - 1))
                          .rowwise()
                          .norm()
                          .maxCoeff();
  EXPECT_LT(jump, 1.01 * e.rate.rowwise().norm().maxCoeff() / 1000.0);
  // The samples miss the peak by at most half a millisecond: w^2 0.73 (h / 2)^2 / 2 of the size.
  EXPECT_NEAR(e.value.rowwise().norm().maxCoeff(), 0.005 * 1.729248, 1.1e-7);
  EXPECT_EQ(e.value.bottomRows(999).cwiseAbs().maxCoeff(), 0.0);
  ASSERT_EQ(e.notes.size(), 2u);
  EXPECT_NE(e.notes[0].find("overshoots by 72.92 %, 0.2105 s"), std::string::npos) << e.notes[0];
  EXPECT_NE(e.notes[1].find("settles to 2 % in 2.67 s, longer than the hold"), std::string::npos)
      << e.notes[1];
}

TEST(Steps, OtherAxesAndDirections) {
  StepsSpec s;
  s.axes = 1;
  s.directions = 2;
  s.drive = Drive::kForce;
  s.size = 2.0;
  const Excitation one = steps(s);
  EXPECT_EQ(one.axes(), 1);
  EXPECT_EQ(one.events.size(), 4u);
  s.vectors = Matrix{{0.0, 0.0, 1.0}, {0.6, 0.0, 0.8}};
  s.repeats = 1;
  const Excitation three = steps(s);
  EXPECT_EQ(three.axes(), 3);
  EXPECT_EQ(three.value.col(1).cwiseAbs().maxCoeff(), 0.0);
  s.filter.damping_ratio = 1.0;
  s.hold_low_s = s.hold_high_s = 3.0;
  EXPECT_TRUE(steps(s).notes.empty());
  StepsSpec a, b;
  a.seed = 7;
  b.seed = 8;
  EXPECT_EQ(steps(a).value, steps(a).value);
  EXPECT_NE(steps(a).rows(), steps(b).rows());
}

TEST(Steps, BadInput) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto with = [](auto change) {
    StepsSpec s;
    change(s);
    return refusal([&] { steps(s); });
  };
  EXPECT_EQ(with([](auto& s) { s.size = 0.0; }), "size");
  EXPECT_EQ(with([&](auto& s) { s.size = nan; }), "size");
  EXPECT_EQ(with([](auto& s) { s.repeats = 0; }), "repeats");
  EXPECT_EQ(with([](auto& s) { s.directions = 0; }), "directions");
  EXPECT_EQ(with([](auto& s) { s.axes = 3; }), "directions");
  EXPECT_EQ(with([](auto& s) { s.axes = 0; }), "axes");
  EXPECT_EQ(with([](auto& s) { s.vectors = Matrix{{1.0, 1.0}}; }), "directions");
  EXPECT_EQ(with([](auto& s) { s.hold_low_s = 3.0; }), "hold_s");
  EXPECT_EQ(with([](auto& s) { s.hold_low_s = s.hold_high_s = 1e-4; }), "hold_s");
  EXPECT_EQ(with([&](auto& s) { s.hold_high_s = nan; }), "hold_s");
  EXPECT_EQ(with([](auto& s) { s.wait_low_s = 0.5; }), "wait_s");
  EXPECT_EQ(with([](auto& s) { s.return_s = 0.0; }), "return_s");
  EXPECT_EQ(with([](auto& s) { s.rest_s = -1.0; }), "rest_s");
  EXPECT_EQ(with([](auto& s) { s.filter.damping_ratio = 0.0; }), "damping_ratio");
  EXPECT_EQ(with([](auto& s) { s.rate_hz = 0.2; }), "hold_s");
  EXPECT_EQ(with([](auto& s) { s.rate_hz = -1.0; }), "rate_hz");
}

// Binary sequences
// ---------------------------------------------------------------------------------

// Superposition of closed-form step responses at the switches, of which the recursion knows
// nothing.
TEST(Binary, IsTheSumOfItsSteps) {
  BinarySpec s;
  s.amplitude = Vector{{2.0, 3.0}};
  s.duration_s = 20.0;
  s.seed = 4;
  s.filtered = false;
  const Excitation raw = random_binary(s);
  s.filtered = true;
  const Excitation e = random_binary(s);
  EXPECT_EQ(e.segments[0].end, 19000);
  for (Index a = 0; a < 2; ++a) {
    const double high = s.amplitude[a];
    EXPECT_TRUE((raw.value.col(a).head(19000).array().abs() == high).all());
    for (Index row = 0; row < 19000; row += 97) {
      SignalPoint sum;
      double before = 0.0;
      for (Index k = 0; k <= row; k += 500) {
        const double input = raw.value(k, a);
        if (input != before) {
          const SignalPoint p = step_response(s.filter, static_cast<double>(row - k) / 1000.0);
          sum.value += (input - before) * p.value;
          sum.rate += (input - before) * p.rate;
          sum.acceleration += (input - before) * p.acceleration;
        }
        before = input;
      }
      EXPECT_NEAR(e.value(row, a), sum.value, 1e-11);
      EXPECT_NEAR(e.rate(row, a), sum.rate, 1e-10);
      EXPECT_NEAR(e.acceleration(row, a), sum.acceleration, 1e-9);
    }
    EXPECT_NEAR(e.value(19999, a), 0.0, 1e-6);  // one sample before the end of the way back
  }
  EXPECT_NE(raw.value.col(0).head(19000).sum() / 2.0, raw.value.col(1).head(19000).sum() / 3.0);
}

TEST(Binary, SignsAreFair) {
  BinarySpec s;
  s.amplitude = Vector::Ones(1);
  s.filtered = false;
  s.clock_s = 0.001;
  s.return_s = 0.0;
  const Excitation e = random_binary(s);
  // 50000 fair signs: the sum has a standard deviation of 224, and so has that of neighbours.
  EXPECT_LT(std::abs(e.value.sum()), 5.0 * 224.0);
  const Vector u = e.value.col(0);
  EXPECT_LT(std::abs(u.head(49999).dot(u.tail(49999))), 5.0 * 224.0);
}

TEST(Binary, BadInput) {
  const auto with = [](auto change) {
    BinarySpec s;
    s.amplitude = Vector::Ones(1);
    change(s);
    return refusal([&] { random_binary(s); });
  };
  EXPECT_EQ(with([](auto& s) { s.amplitude[0] = -1.0; }), "amplitude");
  EXPECT_EQ(with([](auto& s) { s.amplitude = Vector(); }), "axes");
  EXPECT_EQ(with([](auto& s) { s.clock_s = 1e-4; }), "clock_s");
  EXPECT_EQ(with([](auto& s) { s.return_s = -1.0; }), "return_s");
  EXPECT_EQ(with([](auto& s) { s.duration_s = 1.2; }), "duration_s");
  EXPECT_EQ(with([](auto& s) { s.filter.natural_rad_s = 0.0; }), "natural_rad_s");
}

// Any design
// ---------------------------------------------------------------------------------------

TEST(Excitation, OwnSignalsAndScale) {
  Matrix u(4, 1);
  u << 0.0, 1.0, 4.0, 9.0;
  const Excitation e = excitation_of(Drive::kForce, 10.0, u, {{1, 3}});
  EXPECT_NEAR(e.rate(1, 0), 20.0, 1e-12);
  EXPECT_NEAR(e.rate(0, 0), 10.0, 1e-12);
  EXPECT_EQ(extent_of(e).peak[0], 4.0);
  const Excitation twice = scaled(e, -2.0);
  EXPECT_EQ(twice.value(3, 0), -18.0);
  EXPECT_EQ(twice.rate(1, 0), -2.0 * e.rate(1, 0));
  EXPECT_EQ(refusal([&] { scaled(e, 0.0); }), "factor");
  EXPECT_EQ(refusal([&] { scaled(e, std::nan("")); }), "factor");
  EXPECT_EQ(refusal([&] { excitation_of(Drive::kForce, 10.0, u, {{2, 2}}); }), "segments");
  EXPECT_EQ(refusal([&] { excitation_of(Drive::kForce, 10.0, u, {{0, 2}, {1, 3}}); }), "segments");
  EXPECT_EQ(refusal([&] { excitation_of(Drive::kForce, 10.0, u, {{0, 5}}); }), "segments");
  EXPECT_EQ(refusal([&] { excitation_of(Drive::kForce, 0.0, u, {}); }), "rate_hz");
  EXPECT_EQ(refusal([&] { excitation_of(Drive::kForce, 10.0, u.topRows(2), {}); }), "reference");
  EXPECT_EQ(refusal([&] { excitation_of(Drive::kForce, 10.0, u, {}, Matrix(3, 1)); }), "velocity");
  u(2, 0) = std::nan("");
  EXPECT_EQ(refusal([&] { excitation_of(Drive::kForce, 10.0, u, {}); }), "reference");
}

}  // namespace
}  // namespace ulna
