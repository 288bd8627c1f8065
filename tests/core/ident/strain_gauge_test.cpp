// Calibration lines against closed forms, and force channels against the equations by hand.
#include "ident/strain_gauge.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "base/error.hpp"
#include "base/random.hpp"
#include "refusal.hpp"

namespace ulna {
namespace {

using made::refusal_of;
using made::says;

Vector numbers(std::initializer_list<double> values) {
  Vector out(static_cast<Index>(values.size()));
  std::copy(values.begin(), values.end(), out.data());
  return out;
}

Channel channel(const std::string& name, const std::string& unit, Role role = Role::kOther) {
  Channel c;
  c.name = name;
  c.unit = unit;
  c.role = role;
  return c;
}

// V_x, V_y, theta_2 and an older force.
Record volts(const Matrix& values) {
  Record::Parts parts;
  parts.rate_hz = 1000.0;
  parts.values = values;
  parts.channels = {channel("V_x", "V"), channel("V_y", "V"), channel("theta_2", "rad"),
                    channel("old_x", "N", Role::kForce)};
  return Record::make(std::move(parts));
}

Record some_volts(Index rows = 200) {
  Random random(1);
  Matrix values(rows, 4);
  for (double& v : values.reshaped()) v = random.normal();
  return volts(values);
}

TEST(Calibration, AnUnweightedLineInClosedForm) {
  // x = -1, 0, 1, 2, y = 2, 1, 1, -1: slope -0.9, intercept 1.2, residuals in closed form.
  const CalibrationLine line =
      calibrate_line(numbers({-1, 0, 1, 2}), numbers({2, 1, 1, -1}), {}, false);
  EXPECT_NEAR(line.slope, -0.9, 1e-14);
  EXPECT_NEAR(line.intercept, 1.2, 1e-14);
  // SSE = 0.7, two degrees of freedom, Sxx = 5, mean x = 0.5.
  EXPECT_NEAR(line.covariance(0, 0), 0.35 / 5.0, 1e-14);
  EXPECT_NEAR(line.covariance(1, 1), 0.35 * (0.25 + 0.25 / 5.0), 1e-14);
  EXPECT_NEAR(line.covariance(0, 1), -0.35 * 0.5 / 5.0, 1e-14);
  EXPECT_NEAR(line.r_squared, 1.0 - 0.7 / 4.75, 1e-14);
  EXPECT_NEAR(line.residual_n, std::sqrt(0.35), 1e-14);
  EXPECT_TRUE(std::isnan(line.chi_square));
  EXPECT_EQ(line.points, 4);
}

TEST(Calibration, WeightsAreThoseOfTheErrors) {
  // A point of a tenth of the error counts a hundred times: the line runs through it.
  const Vector v = numbers({0, 1, 2, 3, 4});
  const Vector f = numbers({0.1, 0.9, 2.3, 2.9, 4.2});
  const Vector errors = numbers({0.2, 0.2, 0.02, 0.2, 0.2});
  const CalibrationLine absolute = calibrate_line(v, f, errors, false);
  const CalibrationLine relative = calibrate_line(v, f, errors * 10.0, true);
  EXPECT_NEAR(absolute.slope, relative.slope, 1e-13);
  EXPECT_NEAR(absolute.slope * 2.0 + absolute.intercept, 2.3, 0.02);
  // Errors as given, or scaled by the scatter.
  const double factor = absolute.chi_square / 3.0;
  EXPECT_NEAR(relative.covariance(0, 0), absolute.covariance(0, 0) * factor, 1e-13);
  EXPECT_GT(absolute.fit_p, 0.0);
  EXPECT_TRUE(std::isnan(relative.fit_p));
}

TEST(Calibration, IntervalsCoverAndChecksKeepTheirLevel) {
  Random random(7);
  int covered = 0;
  int strayed = 0;
  int bent = 0;
  const int runs = 2000;
  for (int run = 0; run < runs; ++run) {
    Vector v(11);
    Vector f(11);
    for (Index i = 0; i < 11; ++i) {
      v[i] = -5.0 + static_cast<double>(i);
      f[i] = -8.56 * v[i] + 0.54 + 0.5 * random.normal();
    }
    const CalibrationLine line = calibrate_line(v, f, {}, false);
    // Student's t with 9 degrees of freedom: 2.262 at 95 %.
    covered += std::abs(line.slope + 8.56) < 2.262157 * std::sqrt(line.covariance(0, 0)) ? 1 : 0;
    bent += line.curvature_p < 0.05 ? 1 : 0;
    strayed += line.outlier_p < 0.05 ? 1 : 0;
  }
  // Four standard errors of 2000 draws: 2 %.
  EXPECT_NEAR(covered / double(runs), 0.95, 0.02);
  EXPECT_NEAR(bent / double(runs), 0.05, 0.02);
  // By Bonferroni at most that, and hardly less for eleven residuals.
  EXPECT_NEAR(strayed / double(runs), 0.05, 0.02);
}

TEST(Calibration, ACurveAndAStrayPointAreSeen) {
  Vector v(12);
  Vector f(12);
  Random random(2);
  for (Index i = 0; i < 12; ++i) {
    v[i] = -6.0 + static_cast<double>(i);
    f[i] = -8.5 * v[i] + 0.05 * random.normal();
  }
  EXPECT_GT(calibrate_line(v, f, {}, false).curvature_p, 0.01);
  Vector bent = f + 0.05 * v.cwiseAbs2();
  EXPECT_LT(calibrate_line(v, bent, {}, false).curvature_p, 1e-6);
  Vector stray = f;
  stray[4] += 3.0;
  const CalibrationLine line = calibrate_line(v, stray, {}, false);
  EXPECT_EQ(line.largest_row, 4);
  // Internally studentised it cannot exceed sqrt(10); the other points judge it.
  EXPECT_GT(line.largest_residual, 2.9);
  EXPECT_LT(line.outlier_p, 1e-6);
  EXPECT_LT(calibrate_line(v, stray, Vector::Constant(12, 0.05), false).outlier_p, 1e-6);
  EXPECT_GT(calibrate_line(v, f, {}, false).outlier_p, 0.05);
  EXPECT_EQ(calibrate_line(v, -8.5 * v, {}, false).outlier_p, 1.0);
  EXPECT_TRUE(std::isnan(calibrate_line(v.head(3), f.head(3), {}, false).outlier_p));
}

TEST(Calibration, RefusesWhatGivesNoLine) {
  EXPECT_TRUE(says(refusal_of([] {
                     calibrate_line(numbers({1, 2}), numbers({1, 2}), {}, false);
                   }),
                   "at least three"));
  EXPECT_TRUE(says(refusal_of([] {
                     calibrate_line(numbers({3, 3, 3, 3}), numbers({1, 2, 3, 4}), {}, false);
                   }),
                   "same voltage"));
  EXPECT_TRUE(says(refusal_of([] {
                     calibrate_line(numbers({1, 2, 3}), numbers({1, 2}), {}, false);
                   }),
                   "one force for every voltage"));
  const Error error = refusal_of([] {
    calibrate_line(numbers({1, NAN, 3, 4}), numbers({1, 2, 3, 4}), {}, false);
  });
  EXPECT_EQ(error.detail(), "row 1");
  EXPECT_TRUE(
      says(refusal_of([] {
             calibrate_line(numbers({1, 2, 3}), numbers({1, 2, 3}), numbers({1, 0, 1}), false);
           }),
           "must be above zero"));
}

TEST(StrainGauge, ForcesFollowTheThreeEquations) {
  const Record record = some_volts();
  StrainGauge gauge = published_gauge();
  GaugeOptions options;
  options.volts = "V";
  options.angle = "theta_2";
  options.lever_m = 0.08;
  const GaugedForce out = apply_gauge(record, gauge, options);
  const Index fx = out.record.find("F_x");
  for (Index row = 0; row < record.rows(); ++row) {
    const double xs = 0.0688 / 0.08 * (-8.56 * record.values()(row, 0) + 0.54);
    const double ys = 0.0688 / 0.08 * (-8.15 * record.values()(row, 1) + 2.3);
    const double s = std::sin(record.values()(row, 2));
    const double c = std::cos(record.values()(row, 2));
    EXPECT_NEAR(out.record.values()(row, fx), s * xs + c * ys, 1e-12);
    EXPECT_NEAR(out.record.values()(row, fx + 1), -c * xs + s * ys, 1e-12);
  }
  EXPECT_EQ(out.record.with_role(Role::kForce), (std::vector<Index>{fx, fx + 1}));
  EXPECT_EQ(out.record.channels()[static_cast<std::size_t>(fx)].unit, "N");
  EXPECT_NE(out.record.provenance().back().find("strain gauge"), std::string::npos);
}

TEST(StrainGauge, ZeroFromARestAndSign) {
  Matrix values = Matrix::Zero(100, 4);
  values.col(0).setConstant(0.7);
  values.col(1).setConstant(-0.2);
  values.bottomRows(50).col(0).array() += 1.0;
  values(0, 3) = 1.0;
  GaugeOptions options;
  options.volts = "V";
  options.zero = GaugeZero::kRest;
  options.rest_end = 50;
  options.sign = -1;
  const GaugedForce out = apply_gauge(volts(values), published_gauge(), options);
  const Index fx = out.record.find("F_x");
  EXPECT_NEAR(out.record.values()(10, fx), 0.0, 1e-12);
  EXPECT_NEAR(out.record.values()(90, fx), 8.56, 1e-12);
  EXPECT_NEAR(out.record.values()(90, fx + 1), 0.0, 1e-12);
}

TEST(StrainGauge, ErrorsAreDifferences) {
  const Record record = some_volts(50);
  GaugeOptions options;
  options.volts = "V";
  options.angle = "theta_2";
  options.lever_m = 0.08;
  options.lever_error_m = 0.001;
  const StrainGauge gauge = published_gauge();
  const GaugedForce base = apply_gauge(record, gauge, options);
  const auto forces = [&](const StrainGauge& g, const GaugeOptions& o) {
    const Record r = apply_gauge(record, g, o).record;
    return Matrix(r.values().rightCols(2));
  };
  const Matrix before = forces(gauge, options);
  const double h = 1e-4;
  std::vector<Matrix> slopes;
  for (int k = 0; k < 4; ++k) {
    StrainGauge changed = gauge;
    (k == 0   ? changed.x.slope
     : k == 1 ? changed.x.intercept
     : k == 2 ? changed.y.slope
              : changed.y.intercept) += h;
    slopes.push_back((forces(changed, options) - before) / h);
  }
  GaugeOptions longer = options;
  longer.lever_m /= 1.0 + 1e-7;
  slopes.push_back((forces(gauge, longer) - before) / 1e-7);
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_LT((slopes[k] - base.errors.sensitivity[k]).cwiseAbs().maxCoeff(), 1e-5) << k;
  }
  EXPECT_NEAR(base.errors.covariance(0, 0), 0.03 * 0.03, 1e-15);
  EXPECT_NEAR(std::sqrt(base.errors.covariance(4, 4)), 0.001 / 0.08, 1e-12);
}

TEST(StrainGauge, RefusesWrongUnitsAndMissingChannels) {
  const Record record = some_volts();
  const auto with = [&](const std::function<void(GaugeOptions&, StrainGauge&)>& change) {
    GaugeOptions options;
    options.volts = "V";
    StrainGauge gauge = published_gauge();
    change(options, gauge);
    return refusal_of([&] { apply_gauge(record, gauge, options); });
  };
  EXPECT_TRUE(says(with([](auto& o, auto&) { o.volts = "theta_2,old_x"; }), "in rad, not in V"));
  EXPECT_TRUE(says(with([](auto& o, auto&) { o.volts = "V_x"; }), "two axes"));
  EXPECT_TRUE(says(with([](auto& o, auto&) { o.volts = "U"; }), "U"));
  EXPECT_TRUE(says(with([](auto& o, auto&) { o.angle = "V_x"; }), "in V, not in rad"));
  EXPECT_TRUE(says(with([](auto& o, auto&) { o.lever_m = -0.1; }), "above zero"));
  EXPECT_TRUE(says(with([](auto&, auto& g) { g.x.slope = 0.0; }), "slope that is not zero"));
  EXPECT_TRUE(says(with([](auto& o, auto&) { o.name = "old"; }), "already has a channel old_x"));
  EXPECT_TRUE(says(with([](auto& o, auto&) {
                     o.zero = GaugeZero::kRest;
                     o.rest_end = 900;
                   }),
                   "within the record"));
  Matrix values = some_volts().values();
  values(17, 1) = NAN;
  GaugeOptions options;
  options.volts = "V";
  EXPECT_EQ(refusal_of([&] { apply_gauge(volts(values), published_gauge(), options); }).detail(),
            "row 17");
}

}  // namespace
}  // namespace ulna
