#include <ulna/rig.h>

#include <limits>
#include <memory>
#include <vector>

#include "finding.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "ident.hpp"
#include "ident/virtual_sensor.hpp"
#include "record/look.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

std::string word(const char* text) { return text == nullptr ? "" : text; }

void set(double value, double& field) {
  if (value != 0.0) field = value;
}

void write_matrix(const Matrix& values, double* out, int64_t capacity, int64_t* out_count) {
  const Matrix by_row = values.transpose();
  write_array(by_row.data(), by_row.size(), out, capacity, out_count);
}

std::string lines(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : "\n") + text;
  return all;
}

VirtualSensorOptions virtual_options(const ulna_virtual_options* given) {
  const ulna_virtual_options in = read_options(given, "options");
  const PrepareRequest prepare = prepare_request(in.prepare);
  VirtualSensorOptions out;
  out.angle = word(in.angle);
  out.torque = word(in.torque);
  out.acceleration = word(in.acceleration);
  out.reference = word(in.reference);
  out.prepare = prepare.options;
  out.threads = prepare.threads;
  if (in.parameter_covariance != nullptr) {
    out.parameter_covariance = map_view(in.parameter_covariance, "parameter_covariance");
  }
  set(in.least_quality, out.least_quality);
  out.torque_scale_error = in.torque_scale_error;
  out.acceleration_scale_error = in.acceleration_scale_error;
  out.torque_noise = in.torque_noise_nm;
  out.angle_noise = in.angle_noise_rad;
  out.angle_step = in.angle_step_rad;
  out.acceleration_noise = in.acceleration_noise_m_s2;
  return out;
}

Matrix sensed_values(const ulna_sensed& sensed, int32_t quantity) {
  const Index axes = sensed.total.cols();
  switch (quantity) {
    case ULNA_SENSED_TOTAL:
      return sensed.total;
    case ULNA_SENSED_TORQUE:
    case ULNA_SENSED_ANGLE:
    case ULNA_SENSED_ACCELERATION:
      if (sensed.random.size() == 0) return Matrix::Zero(sensed.total.rows(), axes);
      return sensed.random.middleCols(2 * (quantity - ULNA_SENSED_TORQUE), 2);
    case ULNA_SENSED_SYSTEMATIC:
      if (sensed.errors.names.empty()) return Matrix::Zero(sensed.total.rows(), axes);
      return systematic_error(sensed.errors);
    case ULNA_SENSED_COVARIANCE:
      return sensed.errors.covariance;
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_SENSED_ constant");
  }
}

const Matrix& budget_values(const ForceBudget& budget, int32_t quantity) {
  switch (quantity) {
    case ULNA_BUDGET_SENSITIVITY:
      return budget.sensitivity;
    case ULNA_BUDGET_SYSTEMATIC:
      return budget.systematic;
    case ULNA_BUDGET_TOTAL:
      return budget.total;
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_BUDGET_ constant");
  }
}

SensorCheckOptions check_options_of(const ulna_sensor_check_options* given) {
  const ulna_sensor_check_options in = read_options(given, "options");
  const PrepareRequest prepare = prepare_request(in.prepare);
  SensorCheckOptions out;
  out.position = word(in.position);
  out.acceleration = word(in.acceleration);
  out.prepare = prepare.options;
  out.threads = prepare.threads;
  out.highpass_hz = in.highpass_hz;
  set(in.max_lag_s, out.max_lag_s);
  return out;
}

Matrix check_values(const SensorCheck& check, int32_t quantity) {
  Matrix follows(static_cast<Index>(check.follows.size()), 1);
  for (Index i = 0; i < follows.rows(); ++i) {
    follows(i, 0) = static_cast<double>(check.follows[static_cast<std::size_t>(i)]);
  }
  const Matrix all[] = {check.gain,        check.gain_error, check.lag_s,     check.lag_error_s,
                        check.correlation, check.agreement,  check.corrected, check.offset,
                        follows,           check.trace};
  require(quantity >= ULNA_SENSOR_CHECK_GAIN && quantity <= ULNA_SENSOR_CHECK_TRACE, "quantity",
          "quantity must be an ULNA_SENSOR_CHECK_ constant");
  return all[quantity];
}

RobotFitOptions robot_fit_options(const ulna_robot_fit_options* given) {
  const ulna_robot_fit_options in = read_options(given, "options");
  const PrepareRequest prepare = prepare_request(in.prepare);
  require(in.estimator >= ULNA_ESTIMATOR_AUTO && in.estimator <= ULNA_ESTIMATOR_INSTRUMENTAL,
          "estimator", "estimator must be an ULNA_ESTIMATOR_ constant");
  RobotFitOptions out;
  out.angle = word(in.angle);
  out.torque = word(in.torque);
  out.reference = word(in.reference);
  out.force = word(in.force);
  require(in.estimator != ULNA_ESTIMATOR_INSTRUMENTAL || !out.reference.empty(), "estimator",
          "instrumental variables need the commanded angles: name the reference");
  out.least_squares = in.estimator == ULNA_ESTIMATOR_LEAST_SQUARES;
  out.dry_friction = in.dry_friction != 0;
  set(in.dry_threshold_rad_s, out.dry_threshold);
  out.prepare = prepare.options;
  out.threads = prepare.threads;
  out.train_s = in.train_s;
  set(in.lag_s, out.lag_s);
  set(in.condition_limit, out.condition_limit);
  return out;
}

ulna_robot_fit_info fit_struct(const RobotFit& fit) {
  ulna_robot_fit_info out = {};
  out.parameters = static_cast<int32_t>(fit.value.size());
  out.estimator = fit.estimator == Estimator::kInstrumental ? ULNA_ESTIMATOR_INSTRUMENTAL
                                                            : ULNA_ESTIMATOR_LEAST_SQUARES;
  out.feasible = fit.feasible ? 1 : 0;
  out.condition = fit.condition;
  out.difference_p = fit.difference_p;
  out.least_inertia_kg_m2 = fit.least_inertia;
  out.least_friction = fit.least_friction;
  out.feasible_probability = fit.feasible_probability;
  out.lowpass_hz = fit.lowpass_hz;
  out.wide_hz = fit.wide_hz;
  out.train_s = fit.train_s;
  out.train_rows = fit.train_rows;
  out.held_out_rows = fit.held_out_rows;
  return out;
}

Matrix fit_values(const RobotFit& fit, int32_t quantity) {
  const Matrix all[] = {fit.value, fit.covariance, fit.other,       fit.other_covariance,
                        fit.vaf,   fit.vaf_train,  fit.residual_nm, fit.excitation};
  require(quantity >= ULNA_ROBOT_FIT_VALUE && quantity <= ULNA_ROBOT_FIT_EXCITATION, "quantity",
          "quantity must be an ULNA_ROBOT_FIT_ constant");
  return all[quantity];
}

}  // namespace

ulna_status ulna_virtual_sense(const ulna_record* record, const ulna_robot* robot,
                               const ulna_virtual_options* options, ulna_token* token,
                               ulna_sensed** out_sensed) {
  return guarded([&] {
    ulna_sensed*& out = deref(out_sensed, "out_sensed");
    VirtualForce force = sense_force(deref(record, "record").record, *deref(robot, "robot").robot,
                                     virtual_options(options), token_of(token));
    out = new ulna_sensed{std::move(force.record), std::move(force.errors), std::move(force.random),
                          std::move(force.total),  force.accelerometer,     force.worst_quality,
                          force.worst_row,         force.report.lowpass_hz};
  });
}

void ulna_sensed_free(ulna_sensed* sensed) { delete sensed; }

ulna_status ulna_sensed_get_info(const ulna_sensed* sensed, ulna_sensed_info* out_info) {
  return guarded([&] {
    const ulna_sensed& s = deref(sensed, "sensed");
    ulna_sensed_info info = {};
    info.rows = s.record.rows();
    info.axes = static_cast<int32_t>(s.total.cols());
    info.constants = static_cast<int32_t>(s.errors.names.size());
    info.accelerometer = s.accelerometer ? 1 : 0;
    info.worst_quality = s.worst_quality;
    info.worst_row = s.worst_row;
    info.lowpass_hz = s.lowpass_hz;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_sensed_get_record(const ulna_sensed* sensed, ulna_record** out_record) {
  return guarded([&] {
    ulna_record*& out = deref(out_record, "out_record");
    Record record = deref(sensed, "sensed").record;
    auto findings = look(record);
    out = std::make_unique<ulna_record>(
              ulna_record{std::move(record), std::move(findings), {}, false})
              .release();
  });
}

ulna_status ulna_sensed_get_values(const ulna_sensed* sensed, int32_t quantity, double* out,
                                   int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_matrix(sensed_values(deref(sensed, "sensed"), quantity), out, capacity, out_count);
  });
}

ulna_status ulna_sensed_get_names(const ulna_sensed* sensed, char* out_text, int64_t capacity,
                                  int64_t* out_size) {
  return guarded([&] {
    write_text(lines(deref(sensed, "sensed").errors.names), out_text, capacity, out_size);
  });
}

ulna_status ulna_force_budget_new(const ulna_sensed* sensed, const ulna_impedance* impedance,
                                  ulna_token* token, ulna_force_budget** out_budget) {
  return guarded([&] {
    ulna_force_budget*& out = deref(out_budget, "out_budget");
    out = new ulna_force_budget{force_budget(deref(impedance, "impedance").estimate,
                                             deref(sensed, "sensed").errors, token_of(token))};
  });
}

void ulna_force_budget_free(ulna_force_budget* budget) { delete budget; }

ulna_status ulna_force_budget_get_values(const ulna_force_budget* budget, int32_t quantity,
                                         double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_matrix(budget_values(deref(budget, "budget").budget, quantity), out, capacity, out_count);
  });
}

ulna_status ulna_sensor_check_new(const ulna_record* record,
                                  const ulna_sensor_check_options* options, ulna_token* token,
                                  ulna_sensor_check** out_check) {
  return guarded([&] {
    ulna_sensor_check*& out = deref(out_check, "out_check");
    out = new ulna_sensor_check{
        check_sensors(deref(record, "record").record, check_options_of(options), token_of(token))};
  });
}

void ulna_sensor_check_free(ulna_sensor_check* check) { delete check; }

ulna_status ulna_sensor_check_get_info(const ulna_sensor_check* check,
                                       ulna_sensor_check_info* out_info) {
  return guarded([&] {
    const SensorCheck& c = deref(check, "check").check;
    ulna_sensor_check_info info = {};
    info.axes = static_cast<int32_t>(c.gain.rows());
    info.worst = static_cast<int32_t>(c.worst);
    info.findings = static_cast<int64_t>(c.findings.size());
    info.turned_rad = c.turned_rad;
    info.turned_error_rad = c.turned_error_rad;
    info.highpass_hz = c.highpass_hz;
    info.lowpass_hz = c.lowpass_hz;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_sensor_check_get_values(const ulna_sensor_check* check, int32_t quantity,
                                         double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_matrix(check_values(deref(check, "check").check, quantity), out, capacity, out_count);
  });
}

ulna_status ulna_sensor_check_get_finding(const ulna_sensor_check* check, int64_t index,
                                          ulna_finding* out_finding) {
  return guarded([&] {
    const std::vector<Finding>& all = deref(check, "check").check.findings;
    require(index >= 0 && index < static_cast<int64_t>(all.size()), "index",
            "index must be from 0 to " + std::to_string(all.size()) + ", excluded");
    write_result(out_finding, finding_struct(all[static_cast<std::size_t>(index)]), "out_finding");
  });
}

ulna_status ulna_sensor_check_get_text(const ulna_sensor_check* check, int32_t which,
                                       char* out_text, int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const SensorCheck& c = deref(check, "check").check;
    const bool positions = which == ULNA_SENSOR_CHECK_TEXT_POSITIONS;
    require(positions || which == ULNA_SENSOR_CHECK_TEXT_ACCELERATIONS, "which",
            "which must be an ULNA_SENSOR_CHECK_TEXT_ constant");
    write_text(lines(positions ? c.positions : c.accelerations), out_text, capacity, out_size);
  });
}

ulna_status ulna_robot_fit_new(const ulna_record* record, const ulna_robot* robot,
                               const ulna_robot_fit_options* options, ulna_token* token,
                               ulna_robot_fit** out_fit) {
  return guarded([&] {
    ulna_robot_fit*& out = deref(out_fit, "out_fit");
    out = new ulna_robot_fit{identify_robot(deref(record, "record").record,
                                            *deref(robot, "robot").robot,
                                            robot_fit_options(options), token_of(token))};
  });
}

void ulna_robot_fit_free(ulna_robot_fit* fit) { delete fit; }

ulna_status ulna_robot_fit_get_info(const ulna_robot_fit* fit, ulna_robot_fit_info* out_info) {
  return guarded([&] { write_result(out_info, fit_struct(deref(fit, "fit").fit), "out_info"); });
}

ulna_status ulna_robot_fit_get_values(const ulna_robot_fit* fit, int32_t quantity, double* out,
                                      int64_t capacity, int64_t* out_count) {
  return guarded(
      [&] { write_matrix(fit_values(deref(fit, "fit").fit, quantity), out, capacity, out_count); });
}

ulna_status ulna_robot_fit_get_text(const ulna_robot_fit* fit, int32_t which, char* out_text,
                                    int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const RobotFit& f = deref(fit, "fit").fit;
    const std::vector<std::string>* const all[] = {&f.names, &f.warnings, &f.provenance};
    require(which >= ULNA_ROBOT_FIT_TEXT_NAMES && which <= ULNA_ROBOT_FIT_TEXT_PROVENANCE, "which",
            "which must be an ULNA_ROBOT_FIT_TEXT_ constant");
    write_text(lines(*all[which]), out_text, capacity, out_size);
  });
}

ulna_status ulna_robot_feasible(const ulna_robot* robot, const ulna_view* parameters,
                                double* out_inertia_kg_m2, double* out_friction) {
  return guarded([&] {
    const PlanarRobot& body = *deref(robot, "robot").robot;
    const Matrix values = map_view(parameters, "parameters");
    require(values.cols() == 1 && values.rows() >= body.parameters().size() && values.allFinite(),
            "parameters", "give at least as many finite parameters as the robot has, in a column");
    double& inertia = deref(out_inertia_kg_m2, "out_inertia_kg_m2");
    double& friction = deref(out_friction, "out_friction");
    const Feasibility result = feasibility(body, values.col(0));
    inertia = result.least_inertia;
    friction = result.least_friction;
  });
}
