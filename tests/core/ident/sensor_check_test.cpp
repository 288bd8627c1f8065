// An accelerometer whose faults are known, against the encoders.
#include "ident/sensor_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

struct Faults {
  Matrix gain = Matrix::Identity(2, 2);
  double lag_s = 0.0;
  double bias = 0.0;
  double noise = 0.05;
  bool dead = false;
  std::string unit = "m/s^2";
  double duration_s = 50.0;
};

// Two axes of a multisine up to 3 Hz, 2 cm; the accelerometer is gain x''(t - lag) + bias + noise.
Record made(const Faults& faults) {
  const double rate = 500.0;
  const auto rows = static_cast<Index>(faults.duration_s * rate);
  Random phases(11);
  Matrix phase(2, 9);
  for (double& p : phase.reshaped()) p = 2.0 * kPi * phases.uniform();
  Random noise(12);
  Record::Parts parts;
  parts.rate_hz = rate;
  parts.values.resize(rows, 4);
  for (Index row = 0; row < rows; ++row) {
    const double t = static_cast<double>(row) / rate;
    Vector a = Vector::Zero(2);
    for (Index j = 0; j < 2; ++j) {
      double x = 0.0;
      for (Index i = 0; i < 9; ++i) {
        const double w =
            2.0 * kPi * (0.5 + 0.28 * static_cast<double>(i) + 0.07 * static_cast<double>(j));
        x += 0.004 * std::sin(w * t + phase(j, i));
        a[j] -= 0.004 * w * w * std::sin(w * (t - faults.lag_s) + phase(j, i));
      }
      parts.values(row, j) = x + 2e-6 * noise.normal();
    }
    const Vector sensed = faults.gain * a;
    for (Index j = 0; j < 2; ++j) {
      parts.values(row, 2 + j) =
          (faults.dead && j == 1 ? 0.0 : sensed[j]) + faults.bias + faults.noise * noise.normal();
    }
  }
  const char* const names[] = {"x", "y", "a_x", "a_y"};
  for (int c = 0; c < 4; ++c) {
    Channel channel;
    channel.name = names[c];
    channel.unit = c < 2 ? "m" : faults.unit;
    channel.role = c < 2 ? Role::kPosition : Role::kOther;
    channel.axis = c % 2;
    parts.channels.push_back(channel);
  }
  return Record::make(std::move(parts));
}

SensorCheck checked(const Faults& faults) {
  SensorCheckOptions options;
  options.acceleration = "a";
  return check_sensors(made(faults), options);
}

bool finds(const SensorCheck& check, const std::string& code, const std::string& word) {
  for (const Finding& finding : check.findings) {
    if (finding.code == code && finding.message.find(word) != std::string::npos) return true;
  }
  return false;
}

TEST(SensorCheck, GoodSensorsAgreeWithinTheirErrors) {
  const SensorCheck check = checked({});
  EXPECT_EQ(check.worst, Disagreement::kNone);
  EXPECT_TRUE(check.findings.empty());
  for (Index i = 0; i < 2; ++i) {
    for (Index j = 0; j < 2; ++j) {
      EXPECT_NEAR(check.gain(i, j), i == j ? 1.0 : 0.0, 5.0 * check.gain_error(i, j) + 1e-5);
    }
    EXPECT_NEAR(check.lag_s[i], 0.0, 5.0 * check.lag_error_s[i] + 1e-6);
    EXPECT_GT(check.agreement[i], 99.0);
  }
}

TEST(SensorCheck, WithoutNoiseTheIntegralIsExact) {
  Faults faults;
  faults.noise = 0.0;
  const SensorCheck check = checked(faults);
  // What remains is the noise of the positions, 2 um, and the end transients of the filters.
  EXPECT_LT((check.gain - Matrix::Identity(2, 2)).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_LT(check.lag_s.cwiseAbs().maxCoeff(), 1e-5);
}

TEST(SensorCheck, ABiasDoesNotMatterAndIsNamed) {
  Faults faults;
  faults.bias = 0.6;
  const SensorCheck check = checked(faults);
  EXPECT_EQ(check.worst, Disagreement::kNone);
  EXPECT_TRUE(finds(check, "offset", "a tilt of 3.5"));
  EXPECT_NEAR(check.gain(0, 0), 1.0, 0.01);
}

TEST(SensorCheck, ScaleAndLagComeOutWithTheirErrors) {
  Faults faults;
  faults.gain *= 0.93;
  faults.lag_s = 0.0063;
  const SensorCheck check = checked(faults);
  EXPECT_EQ(check.worst, Disagreement::kScale);
  EXPECT_TRUE(finds(check, "scale", "% too small"));
  EXPECT_TRUE(finds(check, "lag", "ms later"));
  for (Index i = 0; i < 2; ++i) {
    EXPECT_NEAR(check.scale[i], 0.93, 5.0 * check.gain_error(i, i) + 1e-5);
    EXPECT_NEAR(check.lag_s[i], 0.0063, 5.0 * check.lag_error_s[i] + 2e-6);
    // 50 s of 2 cm: well below a percent and a tenth of a millisecond.
    EXPECT_LT(check.gain_error(i, i), 0.01);
    EXPECT_LT(check.lag_error_s[i], 1e-4 * 5);
  }
}

TEST(SensorCheck, ALongLagEitherWayIsFound) {
  for (const double lag : {-0.12, 0.2}) {
    Faults faults;
    faults.lag_s = lag;
    const SensorCheck check = checked(faults);
    EXPECT_NEAR(check.lag_s[0], lag, 1e-3);
    EXPECT_EQ(check.worst, Disagreement::kLag);
  }
}

TEST(SensorCheck, SignAxesAndUnitsAreToldApart) {
  Faults faults;
  faults.gain << 1, 0, 0, -1;
  SensorCheck check = checked(faults);
  EXPECT_EQ(check.worst, Disagreement::kSign);
  EXPECT_TRUE(finds(check, "sign", "a_y is opposite"));
  faults.gain << 0, 1, 1, 0;
  check = checked(faults);
  EXPECT_EQ(check.worst, Disagreement::kAxes);
  EXPECT_TRUE(finds(check, "axes", "a_x follows y"));
  faults.gain = Matrix::Identity(2, 2) / 9.80665;
  faults.unit = "1";
  faults.noise = 0.005;
  check = checked(faults);
  EXPECT_EQ(check.worst, Disagreement::kUnit);
  EXPECT_TRUE(finds(check, "unit", "in g"));
  EXPECT_FALSE(finds(check, "scale", "too"));
  faults.gain = Matrix::Identity(2, 2) * 1000.0;
  faults.noise = 50.0;
  check = checked(faults);
  EXPECT_TRUE(finds(check, "unit", "thousand times too large"));
}

TEST(SensorCheck, ATurnedSensorIsMeasured) {
  Faults faults;
  const double angle = 12.0 * kPi / 180.0;
  // The sensor's axes turned anticlockwise: it reads R(-angle) a.
  faults.gain << std::cos(angle), std::sin(angle), -std::sin(angle), std::cos(angle);
  const SensorCheck check = checked(faults);
  EXPECT_EQ(check.worst, Disagreement::kTurned);
  EXPECT_NEAR(check.turned_rad, angle, 5.0 * check.turned_error_rad + 1e-4);
  EXPECT_TRUE(finds(check, "turned", "turned against those of the encoders by 12"));
}

TEST(SensorCheck, ADeadAxisIsUnrelated) {
  Faults faults;
  faults.dead = true;
  const SensorCheck check = checked(faults);
  EXPECT_EQ(check.worst, Disagreement::kUnrelated);
  EXPECT_TRUE(finds(check, "unrelated", "a_y does not follow"));
}

TEST(SensorCheck, RefusesWhatCannotBeCompared) {
  const auto refused = [](const Record& record, const SensorCheckOptions& options) {
    try {
      check_sensors(record, options);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("nothing was refused");
  };
  const auto has = [](const std::string& text, const std::string& word) {
    return text.find(word) != std::string::npos;
  };
  const Record good = made({});
  SensorCheckOptions options;
  EXPECT_TRUE(has(refused(good, options), "name the channels of the accelerometer"));
  options.acceleration = "a_x";
  EXPECT_TRUE(has(refused(good, options), "one of each"));
  options.acceleration = "a";
  options.highpass_hz = 4.0;
  EXPECT_TRUE(has(refused(good, options), "leaves nothing"));
  options.highpass_hz = 0.0;
  options.max_lag_s = 0.0;
  EXPECT_TRUE(has(refused(good, options), "lag to look for"));
  options.max_lag_s = 0.25;
  Faults faults;
  faults.unit = "rad";
  EXPECT_TRUE(has(refused(made(faults), options), "not in m/s^2"));
  faults.unit = "m/s^2";
  faults.duration_s = 6.0;
  EXPECT_TRUE(has(refused(made(faults), options), "record longer"));
  options.position = "a";
  EXPECT_TRUE(has(refused(good, options), "not in m"));
}

}  // namespace
}  // namespace ulna
