// Safety and planning of a design: the second half of design.h.
#include <ulna/design.h>

#include <algorithm>
#include <memory>
#include <sstream>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "ident.hpp"
#include "signal/excitation.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

ArmModel arm_of(const ulna_design_arm* given) {
  deref(given, "arm");
  const ulna_design_arm o = read_options(given, "arm");
  ArmModel out;
  out.m = map_view(o.m, "M");
  out.b = map_view(o.b, "B");
  out.k = map_view(o.k, "K");
  check_axes(out.m.rows());
  out.x0 = Vector::Zero(out.m.rows());
  if (o.x0 != nullptr) {
    const StridedMap x0 = map_view(o.x0, "x0");
    require(x0.cols() == 1, "x0", "x0 must have one column");
    out.x0 = x0;
  }
  return out;
}

RobotModel robot_of(const ulna_design_robot* given, Index n) {
  const ulna_design_robot o = read_options(given, "robot");
  const auto matrix = [n](const ulna_view* view, const char* argument) -> Matrix {
    return view == nullptr ? Matrix::Zero(n, n) : Matrix(map_view(view, argument));
  };
  return {matrix(o.stiffness, "stiffness"), matrix(o.damping, "damping"), matrix(o.mass, "mass")};
}

ArmLoop loop_of(const ulna_design* design, const ulna_design_arm* arm,
                const ulna_design_robot* robot) {
  const Drive drive = deref(design, "design").excitation.drive;
  ArmModel model = arm_of(arm);
  RobotModel machine = robot_of(robot, model.m.rows());
  return ArmLoop(std::move(model), std::move(machine), drive);
}

struct Disturbance {
  Tremor tremor;
  SensorNoise sensors;
};

Disturbance noise_of(const ulna_design_noise* given) {
  const ulna_design_noise o = read_options(given, "noise");
  Disturbance out;
  out.tremor = {o.tremor, o.tremor_low_hz, or_default(o.tremor_high_hz, 5.0)};
  out.sensors = {o.force, o.position};
  return out;
}

SafetyOptions safety_options(const ulna_safety_options& o, const ulna_design_noise* noise) {
  SafetyOptions out;
  out.limits = {o.force, o.displacement, o.velocity, o.per_axis != 0};
  out.tremor = noise_of(noise).tremor;
  out.sigmas = o.sigmas < 0.0 ? 0.0 : or_default(o.sigmas, out.sigmas);
  return out;
}

template <class Enum>
Enum choice(int32_t value, int32_t last, const char* argument) {
  require(value >= 0 && value <= last, argument,
          std::string(argument) + " must be one of its constants, 0 to " + std::to_string(last));
  return static_cast<Enum>(value);
}

PlanOptions plan_options(const ulna_plan_options* given) {
  const ulna_plan_options o = read_options(given, "options");
  PlanOptions out;
  out.prepare = prepare_request(o.prepare).options;
  out.structure.model = choice<Model>(o.model, ULNA_MODEL_PASSIVE, "model");
  out.structure.no_damping = o.no_damping != 0;
  out.structure.diagonal_mass = o.diagonal_mass != 0;
  out.estimator = choice<EstimatorChoice>(o.estimator, ULNA_ESTIMATOR_INSTRUMENTAL, "estimator");
  out.refit = choice<Refit>(o.refit, ULNA_REFIT_NO, "refit");
  out.train_s = o.train_s;
  out.condition_limit = or_default(o.condition_limit, out.condition_limit);
  out.repetitions = or_default(o.repetitions, out.repetitions);
  return out;
}

std::vector<std::string> names_of(const char* axes) {
  std::vector<std::string> names;
  std::istringstream text(&deref(axes, "axes"));
  for (std::string name; std::getline(text, name, ',');) names.push_back(name);
  return names;
}

const Matrix& response_of(const ArmLoop::Response& r, int32_t response) {
  const Matrix* const all[] = {&r.position, &r.velocity, &r.acceleration, &r.force};
  require(response >= ULNA_RESPONSE_POSITION && response <= ULNA_RESPONSE_FORCE, "response",
          "response must be an ULNA_RESPONSE_ constant");
  return *all[response];
}

ulna_safety_info safety_struct(const Safety& s) {
  ulna_safety_info out = {};
  out.axes = s.peaks[0].value.size() - 1;
  out.scale = s.scale;
  out.within = s.within ? 1 : 0;
  out.tightest = static_cast<int32_t>(s.tightest);
  for (int q = 0; q < 3; ++q) {
    out.limits[q] = s.peaks[q].limit;
    out.scales[q] = s.peaks[q].scale;
    out.scale_times_s[q] = s.peaks[q].scale_time_s;
    out.scale_axes[q] = static_cast<int32_t>(s.peaks[q].axis);
  }
  return out;
}

ulna_plan_info plan_struct(const Plan& p) {
  ulna_plan_info out = {};
  out.axes = p.n;
  out.condition = p.condition;
  out.weakness = p.weakness;
  out.seconds = p.seconds;
  out.used_s = p.used_s;
  out.repetitions = p.repetitions;
  out.lowpass_hz = p.report.lowpass_hz;
  out.estimator = p.estimator == Estimator::kInstrumental ? ULNA_ESTIMATOR_INSTRUMENTAL
                                                          : ULNA_ESTIMATOR_LEAST_SQUARES;
  return out;
}

Matrix plan_values(const Plan& p, int32_t quantity) {
  switch (quantity) {
    case ULNA_PLAN_TRUTH:
      return p.truth;
    case ULNA_PLAN_ERROR:
      return p.standard_error();
    case ULNA_PLAN_COVARIANCE:
      return p.covariance;
    case ULNA_PLAN_BIAS:
      return p.bias;
    case ULNA_PLAN_LEAST_SQUARES_BIAS:
      return p.least_squares_bias;
    case ULNA_PLAN_LEAST_SQUARES_ERROR:
      return p.least_squares_error;
    case ULNA_PLAN_MOTION_SHARE:
      return p.rho;
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_PLAN_ constant");
  }
}

}  // namespace

ulna_status ulna_design_respond(const ulna_design* design, const ulna_design_arm* arm,
                                const ulna_design_robot* robot, int32_t response, ulna_token* token,
                                double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const ArmLoop loop = loop_of(design, arm, robot);
    const ArmLoop::Response all = loop.respond(design->excitation, token_of(token));
    const Matrix& values = response_of(all, response);
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}

ulna_status ulna_design_check(const ulna_design* design, const ulna_design_arm* arm,
                              const ulna_design_robot* robot, const ulna_design_noise* noise,
                              const char* axes, const ulna_safety_options* options,
                              ulna_token* token, ulna_safety** out_safety) {
  return guarded([&] {
    const Excitation& e = deref(design, "design").excitation;
    ulna_safety*& out = deref(out_safety, "out_safety");
    const ulna_safety_options o = read_options(options, "options");
    const Safety safety =
        check_safety(e, loop_of(design, arm, robot), safety_options(o, noise), token_of(token));
    std::string words = safety_sentence(safety, names_of(axes), o.rotational != 0);
    out = new ulna_safety{safety, std::move(words)};
  });
}

void ulna_safety_free(ulna_safety* safety) { delete safety; }

ulna_status ulna_safety_get_info(const ulna_safety* safety, ulna_safety_info* out_info) {
  return guarded(
      [&] { write_result(out_info, safety_struct(deref(safety, "safety").safety), "out_info"); });
}

ulna_status ulna_safety_get_peaks(const ulna_safety* safety, int32_t quantity, double* out,
                                  int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Safety& s = deref(safety, "safety").safety;
    require(quantity >= ULNA_LIMIT_FORCE && quantity <= ULNA_LIMIT_VELOCITY, "quantity",
            "quantity must be an ULNA_LIMIT_ constant");
    const PeakOf& peak = s.peaks[quantity];
    Matrix table(peak.value.size(), 3);
    table << peak.value, peak.time_s, peak.tremor;
    write_array(table.data(), table.size(), out, capacity, out_count);
  });
}

ulna_status ulna_safety_get_text(const ulna_safety* safety, char* out_text, int64_t capacity,
                                 int64_t* out_size) {
  return guarded([&] { write_text(deref(safety, "safety").words, out_text, capacity, out_size); });
}

ulna_status ulna_design_plan(const ulna_design* design, const ulna_design_arm* arm,
                             const ulna_design_robot* robot, const ulna_design_noise* noise,
                             const ulna_plan_options* options, ulna_token* token,
                             ulna_plan** out_plan) {
  return guarded([&] {
    const Excitation& e = deref(design, "design").excitation;
    ulna_plan*& out = deref(out_plan, "out_plan");
    ArmModel model = arm_of(arm);
    const RobotModel machine = robot_of(robot, model.m.rows());
    const Disturbance disturbance = noise_of(noise);
    out = new ulna_plan{plan_experiment(e, model, machine, disturbance.tremor, disturbance.sensors,
                                        plan_options(options), token_of(token))};
  });
}

void ulna_plan_free(ulna_plan* plan) { delete plan; }

ulna_status ulna_plan_get_info(const ulna_plan* plan, ulna_plan_info* out_info) {
  return guarded(
      [&] { write_result(out_info, plan_struct(deref(plan, "plan").plan), "out_info"); });
}

ulna_status ulna_plan_get_values(const ulna_plan* plan, int32_t quantity, double* out,
                                 int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Matrix values = plan_values(deref(plan, "plan").plan, quantity);
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}

ulna_status ulna_plan_get_text(const ulna_plan* plan, char* out_text, int64_t capacity,
                               int64_t* out_size) {
  return guarded([&] {
    std::string text;
    for (const std::string& warning : deref(plan, "plan").plan.warnings) {
      text += (text.empty() ? "" : "\n") + warning;
    }
    write_text(text, out_text, capacity, out_size);
  });
}

ulna_status ulna_plan_seconds_for(const ulna_plan* plan, int64_t parameter, double error,
                                  double* out_seconds) {
  return guarded([&] {
    double& out = deref(out_seconds, "out_seconds");
    out = seconds_for(deref(plan, "plan").plan, parameter, error);
  });
}
