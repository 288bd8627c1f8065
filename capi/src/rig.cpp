#include <ulna/rig.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "ident.hpp"
#include "ident/strain_gauge.hpp"
#include "impedance/tare.hpp"
#include "plant/spring_array.hpp"
#include "plant/spring_design.hpp"
#include "signal/finite.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

constexpr double kRadius = 0.025;
constexpr double kLinearShare = 0.05;

SpringArray springs_of(const ulna_spring* springs, int64_t count) {
  require(count >= 1 && count <= SpringArray::kMost, "springs",
          "a spring array has from 1 to 8 springs");
  deref(springs, "springs");
  std::vector<Spring> out;
  for (int64_t i = 0; i < count; ++i) {
    const ulna_spring& s = springs[i];
    out.push_back({Vector2(s.anchor_x_m, s.anchor_y_m), s.rate_n_m, s.rest_m});
  }
  return SpringArray(std::move(out));
}

// What `make(position)` gives at every row, written row by row.
template <class Make>
void write_field(const ulna_view* position, Index width, const Make& make, double* out,
                 int64_t capacity, int64_t* out_count) {
  const Matrix at = map_view(position, "position");
  require(at.cols() == 2, "position", "positions have two columns, x and y");
  require_finite(at, "position");
  std::vector<double> values(static_cast<std::size_t>(at.rows() * width));
  for (Index i = 0; i < at.rows(); ++i) {
    const Matrix value = make(Vector2(at.row(i).transpose()));
    // Symmetric matrices and vectors: the order of rows and columns does not matter.
    std::copy_n(value.data(), width, values.begin() + i * width);
  }
  write_array(values.data(), at.rows() * width, out, capacity, out_count);
}

SpringDesignOptions wish_of(const ulna_springs_wish& in) {
  SpringDesignOptions out;
  out.centre = Vector2(in.centre_m[0], in.centre_m[1]);
  if (in.half_m[0] != 0.0) out.half_x = in.half_m[0];
  if (in.half_m[1] != 0.0) out.half_y = in.half_m[1];
  if (in.radius_m != 0.0) out.radius = in.radius_m;
  if (in.reach != 0.0) out.reach = in.reach;
  if (in.rest_m != 0.0) out.rest = in.rest_m;
  out.max_rate = in.max_rate_n_m;
  out.offset = Vector2(in.offset_m[0], in.offset_m[1]);
  out.seed = static_cast<std::uint64_t>(in.seed);
  out.threads = in.threads;
  require(in.kind_count >= 0 && in.kind_count <= 1000, "springs",
          "a drawer holds at most 1000 kinds of spring");
  if (in.kind_count > 0) deref(in.kinds, "springs");
  for (int64_t i = 0; i < in.kind_count; ++i) {
    const ulna_spring_kind& kind = in.kinds[i];
    require(kind.count >= 0, "springs", "the count of a kind of spring must not be negative");
    out.kinds.push_back(
        {kind.rate_n_m, kind.rest_m, static_cast<int>(std::min<int64_t>(kind.count, 8))});
  }
  return out;
}

ulna_springs_choice choice_struct(const SpringDesign& d) {
  ulna_springs_choice out = {};
  std::copy_n(d.rates.begin(), 8, out.rates_n_m);
  std::copy_n(d.rests.begin(), 8, out.rests_m);
  std::copy_n(d.kinds.begin(), 8, out.kinds);
  out.error = d.error;
  out.evaluations = d.evaluations;
  out.taut = d.taut ? 1 : 0;
  out.central = d.central ? 1 : 0;
  out.exhaustive = d.exhaustive ? 1 : 0;
  return out;
}

Vector column_of(const ulna_view* view, const char* argument) {
  const StridedMap values = map_view(view, argument);
  require(values.cols() == 1, argument, std::string(argument) + " must have one column");
  return values;
}

NaturalParameters natural_input(const ulna_view* value, const ulna_view* covariance,
                                const char* argument) {
  return {column_of(value, argument), map_view(covariance, argument)};
}

ulna_gauge_line line_struct(const CalibrationLine& in) {
  ulna_gauge_line out = {};
  out.slope_n_v = in.slope;
  out.intercept_n = in.intercept;
  out.slope_se = std::sqrt(in.covariance(0, 0));
  out.intercept_se = std::sqrt(in.covariance(1, 1));
  out.covariance = in.covariance(0, 1);
  out.r_squared = in.r_squared;
  out.residual_n = in.residual_n;
  out.chi_square = in.chi_square;
  out.fit_p = in.fit_p;
  out.curvature_p = in.curvature_p;
  out.largest_residual = in.largest_residual;
  out.outlier_p = in.outlier_p;
  out.largest_row = in.largest_row;
  out.points = in.points;
  return out;
}

CalibrationLine line_of(const ulna_gauge_line* given, const char* argument) {
  deref(given, argument);
  const ulna_gauge_line in = read_options(given, argument);
  CalibrationLine out;
  out.slope = in.slope_n_v;
  out.intercept = in.intercept_n;
  require(in.slope_se >= 0.0 && in.intercept_se >= 0.0 &&
              std::abs(in.covariance) <= in.slope_se * in.intercept_se * (1.0 + 1e-9),
          argument,
          "the errors of a calibration line must not be negative, nor its covariance "
          "larger than their product");
  out.covariance << in.slope_se * in.slope_se, in.covariance, in.covariance,
      in.intercept_se * in.intercept_se;
  return out;
}

std::string text_or(const char* text, const char* otherwise) {
  return text == nullptr ? otherwise : text;
}

GaugeOptions gauge_options(const ulna_gauge_options& in) {
  GaugeOptions out;
  out.volts = text_or(in.volts, "");
  require(!out.volts.empty(), "volts", "name the two channels of the sensor's voltages");
  out.angle = text_or(in.angle, "");
  out.name = text_or(in.name, "F");
  out.lever_m = in.lever_m;
  out.lever_error_m = in.lever_error_m;
  out.zero = in.rest_end != 0 ? GaugeZero::kRest : GaugeZero::kCalibration;
  out.rest_begin = in.rest_begin;
  out.rest_end = in.rest_end;
  out.sign = in.sign == 0 ? 1 : in.sign;
  return out;
}

std::unique_ptr<ulna_sensed> sensed_of(Record record, ForceErrors errors) {
  Matrix total = systematic_error(errors);
  return std::make_unique<ulna_sensed>(
      ulna_sensed{std::move(record), std::move(errors), {}, std::move(total)});
}

}  // namespace

ulna_status ulna_springs_frame(double half_x_m, double half_y_m, double centre_x_m,
                               double centre_y_m, double* out, int64_t capacity,
                               int64_t* out_count) {
  return guarded([&] {
    const auto anchors = SpringArray::frame_anchors(
        half_x_m == 0.0 ? SpringArray::kHalfX : half_x_m,
        half_y_m == 0.0 ? SpringArray::kHalfY : half_y_m, Vector2(centre_x_m, centre_y_m));
    write_array(anchors[0].data(), 16, out, capacity, out_count);
  });
}

ulna_status ulna_springs_force(const ulna_spring* springs, int64_t count, const ulna_view* position,
                               double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const SpringArray array = springs_of(springs, count);
    write_field(
        position, 2, [&](const Vector2& at) { return array.force(at); }, out, capacity, out_count);
  });
}

ulna_status ulna_springs_stiffness(const ulna_spring* springs, int64_t count,
                                   const ulna_view* position, double* out, int64_t capacity,
                                   int64_t* out_count) {
  return guarded([&] {
    const SpringArray array = springs_of(springs, count);
    write_field(
        position, 4, [&](const Vector2& at) { return array.stiffness(at); }, out, capacity,
        out_count);
  });
}

ulna_status ulna_springs_equilibrium(const ulna_spring* springs, int64_t count, double radius_m,
                                     ulna_springs_info* out_info) {
  return guarded([&] {
    const SpringArray array = springs_of(springs, count);
    const SpringEquilibrium at = array.equilibrium();
    const Linearity linear = array.linearity(at, radius_m == 0.0 ? kRadius : radius_m);
    ulna_springs_info info = {};
    info.x_m = at.position[0];
    info.y_m = at.position[1];
    std::copy_n(at.stiffness.data(), 4, info.stiffness_n_m);
    std::copy_n(at.eigenvalues.data(), 2, info.eigenvalues_n_m);
    info.slack_radius_m = at.slack_radius;
    info.residual_n = at.residual_n;
    info.deviation_n = linear.deviation_n;
    info.deviation_share = linear.share;
    info.linear_radius_m = array.linear_radius(at, kLinearShare);
    for (std::size_t i = 0; i < at.slack.size(); ++i) info.slack[i] = at.slack[i] ? 1 : 0;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_springs_choose(const ulna_springs_wish* wish, ulna_token* token,
                                ulna_springs_choice* out_choice) {
  return guarded([&] {
    deref(wish, "wish");
    const ulna_springs_wish in = read_options(wish, "wish");
    Matrix2 wanted;
    wanted << in.stiffness_n_m[0], in.stiffness_n_m[1], in.stiffness_n_m[2], in.stiffness_n_m[3];
    const SpringDesign design = design_springs(wanted, wish_of(in), token_of(token));
    write_result(out_choice, choice_struct(design), "out_choice");
  });
}

ulna_status ulna_tare_impedance(const ulna_view* measured, const ulna_view* measured_covariance,
                                const ulna_view* rig, const ulna_view* rig_covariance,
                                int32_t quantity, double* out, int64_t capacity,
                                int64_t* out_count) {
  return guarded([&] {
    require(quantity == ULNA_TARE_PARAMETERS || quantity == ULNA_TARE_COVARIANCE, "quantity",
            "quantity must be an ULNA_TARE_ constant");
    const NaturalParameters hand =
        tare_impedance(natural_input(measured, measured_covariance, "measured"),
                       natural_input(rig, rig_covariance, "rig"));
    const bool value = quantity == ULNA_TARE_PARAMETERS;
    write_array(value ? hand.value.data() : hand.covariance.data(),
                value ? hand.value.size() : hand.covariance.size(), out, capacity, out_count);
  });
}

ulna_status ulna_tare_record(const ulna_record* record, const ulna_prepare_options* prepare,
                             const ulna_view* rig, const ulna_view* rig_covariance,
                             ulna_token* token, ulna_sensed** out_sensed) {
  return guarded([&] {
    const Record& source = deref(record, "record").record;
    ulna_sensed*& out = deref(out_sensed, "out_sensed");
    const PrepareRequest request = prepare_request(prepare);
    const Roles roles = find_roles(source, request.position, request.force, request.reference);
    TaredRecord tared = tare_record(source, natural_input(rig, rig_covariance, "rig"), roles,
                                    request.options, request.threads, token_of(token));
    out = sensed_of(std::move(tared.record), std::move(tared.errors)).release();
  });
}

ulna_status ulna_gauge_calibrate(const ulna_view* volts, const ulna_view* forces,
                                 const ulna_view* errors, int32_t relative,
                                 ulna_gauge_line* out_line) {
  return guarded([&] {
    const Vector weights = errors == nullptr ? Vector() : column_of(errors, "errors_n");
    const CalibrationLine line = calibrate_line(
        column_of(volts, "volts"), column_of(forces, "forces_n"), weights, relative != 0);
    write_result(out_line, line_struct(line), "out_line");
  });
}

ulna_status ulna_gauge_published(int32_t axis, ulna_gauge_line* out_line) {
  return guarded([&] {
    require(axis == 0 || axis == 1, "axis", "the published sensor has the axes 0 and 1");
    const StrainGauge gauge = published_gauge();
    write_result(out_line, line_struct(axis == 0 ? gauge.x : gauge.y), "out_line");
  });
}

ulna_status ulna_gauge_apply(const ulna_record* record, const ulna_gauge_options* options,
                             ulna_sensed** out_sensed) {
  return guarded([&] {
    const Record& source = deref(record, "record").record;
    ulna_sensed*& out = deref(out_sensed, "out_sensed");
    deref(options, "options");
    const ulna_gauge_options in = read_options(options, "options");
    StrainGauge gauge{line_of(in.x, "x"), line_of(in.y, "y")};
    if (in.calibration_lever_m != 0.0) gauge.lever_m = in.calibration_lever_m;
    gauge.lever_error_m = in.calibration_lever_error_m;
    GaugedForce forces = apply_gauge(source, gauge, gauge_options(in));
    out = sensed_of(std::move(forces.record), std::move(forces.errors)).release();
  });
}
