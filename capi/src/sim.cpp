#include <ulna/sim.h>

#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "record/look.hpp"
#include "sim/experiment.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

Matrix matrix_of(const ulna_view* view, const char* argument) { return map_view(view, argument); }

Vector vector_of(const ulna_view* view, const char* argument) {
  if (view == nullptr) return {};
  const Matrix m = map_view(view, argument);
  require(m.cols() == 1, argument, std::string(argument) + " must have one column");
  return m.col(0);
}

std::shared_ptr<const SpringArray> springs_of(const ulna_view* view) {
  if (view == nullptr) return nullptr;
  const Matrix rows = map_view(view, "springs");
  require(rows.cols() == 4, "springs",
          "springs must have four columns: anchor x and y, rate, rest length");
  std::vector<Spring> springs;
  for (Index i = 0; i < rows.rows(); ++i) {
    springs.push_back({Vector2(rows(i, 0), rows(i, 1)), rows(i, 2), rows(i, 3)});
  }
  return std::make_shared<const SpringArray>(std::move(springs));
}

sim::Arm arm_of(const ulna_sim_arm* options) {
  const ulna_sim_arm o = read_options(&deref(options, "arm"), "arm");
  sim::Arm arm;
  arm.m = matrix_of(&deref(o.m, "m"), "m");
  arm.b = matrix_of(&deref(o.b, "b"), "b");
  arm.springs = springs_of(o.springs);
  // With springs a stiffness of zero stands in for the one that is not used.
  arm.k =
      o.k == nullptr && arm.springs ? Matrix(Matrix::Zero(2, 2)) : matrix_of(&deref(o.k, "k"), "k");
  arm.x0 = vector_of(o.x0, "x0");
  arm.payload_kg = o.payload_kg;
  return arm;
}

sim::Human human_of(const ulna_sim_human* options) {
  const ulna_sim_human o = read_options(options, "human");
  sim::Human human;
  human.tremor = {o.tremor_n, or_default(o.tremor_hz, 2.0), or_default(o.tremor_damping, 0.7)};
  require(o.cns == 0 || o.cns == 1, "cns", "cns must be 0 or 1");
  sim::CnsController& cns = human.cns;
  cns.on = o.cns == 1;
  cns.delay_s = or_default(o.delay_s, cns.delay_s);
  cns.lag_s = o.lag_s;
  cns.stiffness_n_m = o.stiffness_n_m;
  cns.damping_n_s_m = o.damping_n_s_m;
  cns.integral_n_m_s = o.integral_n_m_s;
  cns.target = vector_of(o.target, "target");
  human.cocontraction = {o.cocontraction, or_default(o.stiffness_factor, 1.0),
                         or_default(o.damping_factor, 1.0), o.reaction_speed_m_s,
                         or_default(o.memory_s, 1.0)};
  return human;
}

sim::Controller controller_of(const ulna_sim_control* options) {
  const ulna_sim_control o = read_options(options, "control");
  sim::Controller c;
  require(o.mode == ULNA_CONTROL_POSITION || o.mode == ULNA_CONTROL_FORCE, "mode",
          "mode must be ULNA_CONTROL_POSITION or ULNA_CONTROL_FORCE");
  c.mode = o.mode == ULNA_CONTROL_FORCE ? sim::ControlMode::kForce : sim::ControlMode::kPosition;
  c.hold_axis = o.hold_axis - 1;
  c.kp_n_m = or_none(o.kp_n_m, c.kp_n_m);
  c.kd_n_s_m = or_none(o.kd_n_s_m, c.kd_n_s_m);
  c.rate_hz = or_default(o.rate_hz, c.rate_hz);
  c.delay_s = o.delay_s;
  c.force_limit_n = o.force_limit_n;
  c.base_m = {o.base_m[0], o.base_m[1]};
  c.base_angle_rad = o.base_angle_rad;
  return c;
}

sim::Sensors sensors_of(const ulna_sim_sensors* options) {
  const ulna_sim_sensors o = read_options(options, "sensors");
  sim::Sensors s;
  s.position_resolution_m = or_none(o.position_resolution_m, s.position_resolution_m);
  s.position_noise_m = or_none(o.position_noise_m, s.position_noise_m);
  s.force_resolution_n = or_none(o.force_resolution_n, s.force_resolution_n);
  s.force_noise_n = or_none(o.force_noise_n, s.force_noise_n);
  s.force_delay_s = or_none(o.force_delay_s, 0.0);
  s.acceleration_resolution_m_s2 = or_none(o.acceleration_resolution_m_s2, 0.0);
  s.acceleration_noise_m_s2 = or_none(o.acceleration_noise_m_s2, 0.0);
  return s;
}

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    if (end != 0) lines.emplace_back(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return lines;
}

void read_around(const ulna_sim_options& o, sim::Experiment& e) {
  e.rate_hz = or_default(o.rate_hz, e.rate_hz);
  e.settle_s = or_none(o.settle_s, e.settle_s);
  e.centre = vector_of(&deref(o.centre, "centre"), "centre");
  require(o.segment_count >= 0 && (o.segments != nullptr || o.segment_count == 0), "segments",
          "segments must hold segment_count pairs of rows");
  for (int64_t i = 0; i < o.segment_count; ++i) {
    e.segments.emplace_back(o.segments[2 * i], o.segments[2 * i + 1]);
  }
  if (o.notes != nullptr) e.notes = lines_of(o.notes);
  if (o.frame != nullptr) e.frame = o.frame;
  constexpr int32_t kAll = ULNA_EXTRA_ACCELERATION | ULNA_EXTRA_ROBOT | ULNA_EXTRA_TRUTH;
  require((o.extras & ~kAll) == 0, "extras", "extras must be ULNA_EXTRA_ bits");
  e.extras = {(o.extras & ULNA_EXTRA_ACCELERATION) != 0, (o.extras & ULNA_EXTRA_ROBOT) != 0,
              (o.extras & ULNA_EXTRA_TRUTH) != 0};
}

struct Question {
  sim::Experiment experiment;
  std::uint64_t seed;
  int threads;
};

Question question_of(const ulna_robot* robot, const ulna_sim_arm* arm, const ulna_sim_human* human,
                     const ulna_sim_control* control, const ulna_sim_sensors* sensors,
                     const ulna_sim_options* options, const ulna_view* reference) {
  const ulna_sim_options o = read_options(&deref(options, "options"), "options");
  sim::Experiment e;
  e.robot = deref(robot, "robot").robot;
  e.arm = arm_of(arm);
  e.human = human_of(human);
  e.controller = controller_of(control);
  e.sensors = sensors_of(sensors);
  read_around(o, e);
  e.reference = map_view(reference, "reference");
  return {std::move(e), static_cast<std::uint64_t>(o.seed), o.threads};
}

std::unique_ptr<ulna_record> handle_of(Record&& record) {
  std::vector<Finding> findings = look(record);
  return std::unique_ptr<ulna_record>(
      new ulna_record{std::move(record), std::move(findings), {}, false});
}

}  // namespace

ulna_status ulna_sim_run(const ulna_robot* robot, const ulna_sim_arm* arm,
                         const ulna_sim_human* human, const ulna_sim_control* control,
                         const ulna_sim_sensors* sensors, const ulna_sim_options* options,
                         const ulna_view* reference, int64_t run, ulna_token* token,
                         ulna_record** out_record) {
  return guarded([&] {
    ulna_record*& out = deref(out_record, "out_record");
    require(run >= 0, "run", "run counts from 0");
    const Question q = question_of(robot, arm, human, control, sensors, options, reference);
    out = handle_of(
              sim::simulate(q.experiment, q.seed, static_cast<std::uint64_t>(run), token_of(token)))
              .release();
  });
}

ulna_status ulna_sim_batch(const ulna_robot* robot, const ulna_sim_arm* arm,
                           const ulna_sim_human* human, const ulna_sim_control* control,
                           const ulna_sim_sensors* sensors, const ulna_sim_options* options,
                           const ulna_view* reference, int64_t run_count, ulna_token* token,
                           ulna_record** out_records) {
  return guarded([&] {
    deref(out_records, "out_records");
    const Question q = question_of(robot, arm, human, control, sensors, options, reference);
    std::vector<std::unique_ptr<ulna_record>> made;
    for (Record& record :
         sim::simulate_batch(q.experiment, q.seed, run_count, q.threads, token_of(token))) {
      made.push_back(handle_of(std::move(record)));
    }
    for (std::size_t i = 0; i < made.size(); ++i) out_records[i] = made[i].release();
  });
}
