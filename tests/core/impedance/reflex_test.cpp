// Intrinsic and reflex paths, delayed feedback and windows from simulated records.
#include "impedance/reflex.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.hpp"
#include "base/random.hpp"
#include "impedance/delayed.hpp"
#include "impedance/window.hpp"

namespace ulna {
namespace {

constexpr double kRate = 1000.0;

// A sum of tones with exact derivatives.
struct Motion {
  std::vector<double> omega, phase, amplitude;

  Motion(std::uint64_t seed, double band_hz, int tones, double speed) {
    Random random(seed);
    for (int k = 0; k < tones; ++k) {
      omega.push_back(2.0 * kPi * (0.2 + (band_hz - 0.2) * random.uniform()));
      phase.push_back(2.0 * kPi * random.uniform());
      amplitude.push_back(speed * std::sqrt(2.0 / tones) / omega.back());
    }
  }
  double at(double t, int derivative) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < omega.size(); ++k) {
      const double turn = 0.5 * kPi * derivative;
      sum +=
          amplitude[k] * std::pow(omega[k], derivative) * std::sin(omega[k] * t + phase[k] + turn);
    }
    return sum;
  }
};

Channel channel(const char* name, const char* unit, Role role, int axis = 0) {
  Channel out;
  out.name = name;
  out.unit = unit;
  out.role = role;
  out.axis = axis;
  return out;
}

// One joint: M 0.015, B 0.8, K 60; reflex of gain `gain`, 18 rad/s, 0.8, delay 45 ms, by
// Runge-Kutta steps of 0.25 ms from three seconds before the record.
Record joint_record_of(double gain, double seconds, double noise, std::uint64_t seed,
                       int side = 1) {
  const Motion motion(seed, 8.0, 25, 0.35);
  const Index rows = static_cast<Index>(seconds * kRate);
  constexpr double kOmega = 18.0, kZeta = 0.8, kDelay = 0.045;
  constexpr int kFine = 4;
  const double h = 1.0 / (kRate * kFine);
  double w = 0.0, dw = 0.0;
  Record::Parts parts;
  parts.values.resize(rows, 2);
  Random random(seed, 7);
  double slow = 0.0;
  const Index before = static_cast<Index>(3.0 * kRate) * kFine;
  const auto drive = [&](double t) {
    return side * std::max(side * motion.at(t - kDelay, 1), 0.0);
  };
  double now = drive(-static_cast<double>(before) * h);
  for (Index step = -before; step < rows * kFine; ++step) {
    const double t = static_cast<double>(step) * h;
    if (step >= 0 && step % kFine == 0) {
      const Index row = step / kFine;
      slow += 0.02 * (random.normal() - slow);
      const double torque = 0.015 * motion.at(t, 2) + 0.8 * motion.at(t, 1) +
                            60.0 * motion.at(t, 0) + 2.0 + gain * w + 10.0 * noise * slow;
      parts.time.push_back(t);
      parts.values(row, 0) = motion.at(t, 0);
      parts.values(row, 1) = -torque;
    }
    // The derivative of (w, dw) by the classical fourth-order rule.
    const double middle = drive(t + 0.5 * h);
    const double next = drive(t + h);
    const auto slope = [&](double x, double v, double u) {
      return kOmega * kOmega * (u - x) - 2.0 * kZeta * kOmega * v;
    };
    const double k1 = slope(w, dw, now);
    const double k2 = slope(w + 0.5 * h * dw, dw + 0.5 * h * k1, middle);
    const double k3 = slope(w + 0.5 * h * (dw + 0.5 * h * k1), dw + 0.5 * h * k2, middle);
    const double k4 = slope(w + h * (dw + 0.5 * h * k2), dw + h * k3, next);
    w += h * (dw + h * (k1 + k2 + k3) / 6.0);
    dw += h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0;
    now = next;
  }
  parts.channels = {channel("q", "rad", Role::kPosition), channel("tau", "Nm", Role::kForce)};
  return Record::make(std::move(parts));
}

ReflexOptions options() {
  ReflexOptions out;
  out.prepare.lowpass_hz = 50.0;
  out.side = 1;
  out.reflex_irf_s = 0.0;
  return out;
}

TEST(Reflex, ARecordWithoutNoiseGivesTheParametersBack) {
  const ReflexEstimate e = identify_reflex(joint_record_of(6.0, 15.0, 0.0, 2), options());
  // Corners of the rectified velocity lie above the band, and the low pass takes 1e-7 of the
  // motion.
  const double truth[] = {0.015, 0.8, 60.0, 6.0, 18.0, 0.8, 0.045};
  for (Index k = 0; k < kReflexParameterCount; ++k) {
    EXPECT_NEAR(e.fit.value[k], truth[k], 3e-4 * truth[k]) << k;
  }
  EXPECT_GT(e.vaf, 99.9999);
  EXPECT_EQ(e.outcome, kReflexGood);
}

TEST(Reflex, NoiseWidensTheIntervalsOnly) {
  ReflexOptions settings = options();
  settings.train_s = 12.0;  // what is left holds the five blocks that an interval of the VAF needs
  const ReflexEstimate e = identify_reflex(joint_record_of(6.0, 20.0, 0.2, 3), settings);
  const double truth[] = {0.015, 0.8, 60.0, 6.0, 18.0, 0.8, 0.045};
  for (Index k = 0; k < kReflexParameterCount; ++k) {
    const double spread = 0.25 * (e.fit.interval(1, k) - e.fit.interval(0, k));
    EXPECT_GT(spread, 0.0);
    EXPECT_NEAR(e.fit.value[k], truth[k], 4.5 * spread) << k;
  }
  EXPECT_LT(e.p_value, 0.02);
  EXPECT_GT(e.gain_interval[0], 0.0);
}

TEST(Reflex, WithoutOneNoneIsShown) {
  const ReflexEstimate e = identify_reflex(joint_record_of(0.0, 20.0, 0.2, 4), options());
  EXPECT_GT(e.p_value, 0.01);
  EXPECT_LT(e.vaf - e.vaf_without, 1.0);
}

TEST(Reflex, RefusesWhatItCannotUse) {
  const Record record = joint_record_of(0.0, 2.0, 0.1, 5);
  ReflexOptions bad = options();
  bad.order = 3;
  EXPECT_THROW(identify_reflex(record, bad), Error);
  bad = options();
  bad.threshold = 1e3;
  try {
    identify_reflex(record, bad);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kAnalysis);
    EXPECT_EQ(error.argument(), "threshold");
  }
  bad = options();
  bad.delay_max_s = 5.0;
  try {
    identify_reflex(record, bad);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.fault(), Fault::kData);
  }
  Token token;
  token.cancel();
  EXPECT_THROW(identify_reflex(record, options(), &token), Error);
}

TEST(Delayed, ARecordWithoutNoiseGivesTheParametersBack) {
  const Motion motion(6, 4.0, 25, 0.06);
  constexpr double kDelay = 0.0873;
  Record::Parts parts;
  parts.values.resize(15000, 2);
  for (Index i = 0; i < 15000; ++i) {
    const double t = static_cast<double>(i) / kRate;
    parts.time.push_back(t);
    parts.values(i, 0) = 0.2 + motion.at(t, 0);
    parts.values(i, 1) = -(1.3 * motion.at(t, 2) + 9.0 * motion.at(t, 1) + 70.0 * motion.at(t, 0) +
                           40.0 * motion.at(t - kDelay, 0) + 5.0 * motion.at(t - kDelay, 1));
  }
  parts.channels = {channel("x", "m", Role::kPosition), channel("F", "N", Role::kForce)};
  DelayedOptions options;
  options.prepare.lowpass_hz = 30.0;
  const DelayedEstimate e = identify_delayed(Record::make(std::move(parts)), options);
  EXPECT_NEAR(e.delay_s, kDelay, 1e-6);
  EXPECT_NEAR(e.m(0, 0), 1.3, 1e-4);
  EXPECT_NEAR(e.b(0, 0), 9.0, 1e-3);
  EXPECT_NEAR(e.k(0, 0), 70.0, 1e-2);
  EXPECT_NEAR(e.k_delayed(0, 0), 40.0, 1e-2);
  EXPECT_NEAR(e.b_delayed(0, 0), 5.0, 1e-3);
  EXPECT_NEAR(e.x0[0], 0.2, 1e-6);
  EXPECT_EQ(e.covariance.rows(), 7);
}

TEST(Windows, BothSidesOfTheBorderAreFound) {
  // Displacements of changing speed: each rises from rest and comes back; B and K grow by half
  // after 100 ms.
  Record::Parts parts;
  constexpr Index kRows = 31000;
  parts.values.resize(kRows, 3);
  Random random(9);
  for (Index i = 0; i < kRows; ++i) {
    const double t = static_cast<double>(i) / kRate;
    parts.time.push_back(t);
    const double since = std::fmod(t, 2.0) - 0.5;
    const double pulse = 15.0 + 5.0 * static_cast<double>(i / 2000 % 5);  // rad/s
    double x = 0.0, v = 0.0, a = 0.0;
    if (since > 0.0 && since < 2.0 * kPi / pulse) {
      // (1 - cos)^2: starts and ends without a jump in acceleration.
      const double s = std::sin(pulse * since), c = std::cos(pulse * since);
      x = 0.002 * (1.0 - c) * (1.0 - c);
      v = 0.004 * pulse * (1.0 - c) * s;
      a = 0.004 * pulse * pulse * (s * s + (1.0 - c) * c);
    }
    const double late = since >= 0.1 ? 1.5 : 1.0;
    parts.values(i, 0) = x;
    parts.values(i, 1) = -(1.2 * a + late * (8.0 * v + 150.0 * x)) + 0.3 + 0.01 * random.normal();
    parts.values(i, 2) = x;
  }
  parts.channels = {channel("x", "m", Role::kPosition), channel("F", "N", Role::kForce),
                    channel("x_ref", "m", Role::kReference)};
  const Record record = Record::make(std::move(parts));
  WindowOptions options;
  for (int k = 0; k < 16; ++k) options.onsets_s.push_back(0.5 + 2.0 * k);
  const WindowComparison w = compare_windows(record, options);
  EXPECT_EQ(w.onsets.size(), 16u);
  EXPECT_NEAR(w.late.k(0, 0), 225.0, 5.0);
  EXPECT_NEAR(w.late.b(0, 0), 12.0, 0.5);
  EXPECT_NEAR(w.early.k(0, 0), 150.0, 5.0 * std::sqrt(w.early.covariance(2, 2)) + 8.0);
  EXPECT_LT(w.p_value, 0.01);
  options.onsets_s.clear();  // found from the reference, whose motion begins with the fourth power
  const WindowComparison found = compare_windows(record, options);
  ASSERT_EQ(found.onset_time_s.size(), 16u);
  for (int k = 0; k < 16; ++k) {
    EXPECT_NEAR(found.onset_time_s[static_cast<std::size_t>(k)], 0.5 + 2.0 * k, 0.008);
  }
  EXPECT_DOUBLE_EQ(w.degrees, 15.0);
  options.onsets_s = {0.5, 0.4};
  EXPECT_THROW(compare_windows(record, options), Error);
  options.onsets_s = {0.5};
  EXPECT_THROW(compare_windows(record, options), Error);
}

}  // namespace
}  // namespace ulna
