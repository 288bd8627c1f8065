#include "sim/description.hpp"

#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/finite.hpp"
#include "sim/loop.hpp"

namespace ulna::sim {
namespace {

void require_number(double value, double low, double high, const char* argument,
                    const std::string& what) {
  if (std::isfinite(value) && value >= low && value <= high) return;
  throw Error(Fault::kArgument, argument,
              sentence(6, what, " is ", value, ": it must be from ", low, " to ", high));
}

void require_square(const Matrix& m, Index n, const char* argument) {
  if (m.rows() != n || m.cols() != n) {
    throw Error(
        Fault::kArgument, argument,
        sentence(6, argument, " is ", m.rows(), " x ", m.cols(), ", but m is ", n, " x ", n));
  }
  require_finite(m, argument);
}

void require_place(const Vector& v, Index n, const char* argument, bool optional) {
  if (optional && v.size() == 0) return;
  if (v.size() != n) {
    throw Error(Fault::kArgument, argument,
                sentence(6, argument, " has ", v.size(), " values, the arm has ", n, " axes"));
  }
  require_finite(v, argument);
}

void check_arm(const Arm& arm) {
  const Index n = arm.m.rows();
  require(n == 1 || n == 2, "m",
          "the arm must have 1 or 2 axes: give m as a 1 x 1 or 2 x 2 matrix");
  require_square(arm.m, n, "m");
  require_square(arm.b, n, "b");
  require_square(arm.k, n, "k");
  require_place(arm.x0, n, "x0_m", true);
  require_number(arm.payload_kg, 0.0, 100.0, "payload_kg", "the payload");
  require(arm.springs == nullptr || n == 2, "springs", "a spring array has two axes");
}

void check_human(const Human& human, Index n, double control_hz) {
  const Tremor& tremor = human.tremor;
  require_number(tremor.rms_n, 0.0, 1e3, "tremor_n", "the tremor");
  require_number(tremor.natural_hz, 1e-3, 0.25 * control_hz, "tremor_hz",
                 "the frequency of the tremor");
  require_number(tremor.damping, 1e-3, 10.0, "tremor_damping", "the damping of the tremor");
  const Cocontraction& c = human.cocontraction;
  require_number(c.level, 0.0, 1.0, "cocontraction", "the level of co-contraction");
  require_number(c.stiffness_factor, 0.0, 1e3, "stiffness_factor", "the stiffness factor");
  require_number(c.damping_factor, 0.0, 1e3, "damping_factor", "the damping factor");
  require_number(c.speed_m_s, 0.0, 1e3, "reaction_speed_m_s", "the speed that co-contracts fully");
  require_number(c.memory_s, 1e-2, 1e3, "memory_s", "the memory of the co-contraction");
  const CnsController& cns = human.cns;
  require_number(cns.delay_s, 1.0 / control_hz, 2.0, "delay_s", "the reaction delay");
  require_number(cns.lag_s, 0.0, 2.0, "lag_s", "the lag of the muscles");
  require_number(cns.stiffness_n_m, 0.0, 1e5, "stiffness_n_m", "the controller's stiffness");
  require_number(cns.damping_n_s_m, 0.0, 1e4, "damping_n_s_m", "the controller's damping");
  require_number(cns.integral_n_m_s, 0.0, 1e6, "integral_n_m_s", "the controller's integral gain");
  require_place(cns.target, n, "target_m", true);
}

void check_controller(const Controller& c, Index n) {
  require_number(c.kp_n_m, 0.0, 1e7, "kp_n_m", "the gain kp");
  require_number(c.kd_n_s_m, 0.0, 1e6, "kd_n_s_m", "the gain kd");
  require_number(c.rate_hz, 1.0, 1e5, "control_rate_hz", "the rate of the control");
  require_number(c.delay_s, 0.0, 1.0, "delay_s", "the delay of the control");
  require_number(c.force_limit_n, 0.0, 1e5, "force_limit_n", "the limit of the force");
  require_number(c.base_m.norm(), 0.0, 1e3, "base_m", "the distance of the robot's base");
  require_number(c.base_angle_rad, -100.0, 100.0, "base_angle_rad",
                 "the angle of the robot's base");
  require(c.hold_axis >= -1 && c.hold_axis < n, "hold_axis",
          "the axis that is held must be one of the arm's");
}

void check_sensors(const Sensors& s) {
  require_number(s.position_resolution_m, 0.0, 1.0, "position_resolution_m",
                 "the resolution of the position");
  require_number(s.position_noise_m, 0.0, 1.0, "position_noise_m", "the noise of the position");
  require_number(s.force_resolution_n, 0.0, 1e3, "force_resolution_n",
                 "the resolution of the force");
  require_number(s.force_noise_n, 0.0, 1e3, "force_noise_n", "the noise of the force");
  require_number(s.force_delay_s, 0.0, 1.0, "force_delay_s", "the delay of the force");
  require_number(s.acceleration_resolution_m_s2, 0.0, 1e3, "acceleration_resolution_m_s2",
                 "the resolution of the accelerometer");
  require_number(s.acceleration_noise_m_s2, 0.0, 1e3, "acceleration_noise_m_s2",
                 "the noise of the accelerometer");
}

void check_reference(const Experiment& e) {
  const Matrix& r = e.reference;
  require(r.rows() >= 2, "reference", "the reference must have at least two rows");
  if (r.cols() != e.axes()) {
    throw Error(Fault::kArgument, "reference",
                sentence(6, "the reference has ", r.cols(), " columns, the arm has ", e.axes(),
                         " axes: give one a column"));
  }
  require_finite(r, "reference");
  require_number(static_cast<double>(r.rows()) / e.rate_hz, 0.0, 1e5, "reference",
                 "the duration of the reference, in s,");
  Index last = 0;
  for (const auto& [begin, end] : e.segments) {
    if (begin >= last && end > begin && end <= r.rows()) {
      last = end;
      continue;
    }
    throw Error(
        Fault::kArgument, "segments",
        sentence(6, "the segment of rows ", begin, " to ", end,
                 " is empty, out of order or outside of the ", r.rows(), " rows of the reference"));
  }
}

std::string matrix_text(const Matrix& m) {
  std::string text = "[";
  for (Index i = 0; i < m.rows(); ++i) {
    for (Index j = 0; j < m.cols(); ++j) {
      text += sentence(6, i > 0 && j == 0 ? "; " : (j > 0 ? " " : ""), m(i, j));
    }
  }
  return text + "]";
}

}  // namespace

void check_experiment(const Experiment& e) {
  require(e.robot != nullptr, "robot", "give a robot");
  check_arm(e.arm);
  require(e.axes() == 2 || e.robot->has_independent_axes(), "m",
          "an arm of one axis needs a robot whose axes are independent: a carriage");
  require_number(e.rate_hz, 1.0, 1e5, "rate_hz", "the sample rate");
  require_number(e.settle_s, 0.0, 1e3, "settle_s", "the time to settle");
  check_controller(e.controller, e.axes());
  check_human(e.human, e.axes(), control_rate(e));
  check_sensors(e.sensors);
  require_place(e.centre, e.axes(), "centre_m", false);
  check_reference(e);
}

std::vector<std::string> provenance_of(const Experiment& e) {
  std::vector<std::string> lines;
  const Controller& c = e.controller;
  const bool position = c.mode == ControlMode::kPosition;
  lines.push_back(sentence(
      6, "simulated: ", e.robot->name(), " under ",
      position ? "position control" : "open-loop force control", " at ", control_rate(e), " Hz",
      position || c.hold_axis >= 0
          ? sentence(6, ", kp ", c.kp_n_m, " N/m, kd ", c.kd_n_s_m, " N s/m")
          : "",
      c.hold_axis >= 0 ? sentence(6, ", axis ", c.hold_axis + 1, " held") : "",
      c.delay_s > 0.0 ? sentence(6, ", delay ", c.delay_s, " s") : "",
      c.force_limit_n > 0.0 ? sentence(6, ", force limit ", c.force_limit_n, " N") : ""));
  lines.push_back(sentence(
      6, "simulated arm: M ", matrix_text(e.arm.m), " kg, B ", matrix_text(e.arm.b), " N s/m, ",
      e.arm.springs ? sentence(6, e.arm.springs->springs().size(), " springs")
                    : "K " + matrix_text(e.arm.k) + " N/m",
      ", x0 ", matrix_text((e.arm.x0.size() > 0 ? e.arm.x0 : e.centre).transpose()), " m, payload ",
      e.arm.payload_kg, " kg"));
  const Human& h = e.human;
  const Cocontraction& co = h.cocontraction;
  lines.push_back(sentence(
      6, "simulated human: tremor ", h.tremor.rms_n, " N rms (", h.tremor.natural_hz,
      " Hz, damping ", h.tremor.damping, ")",
      h.cns.on ? sentence(6, ", holds the hand by ", h.cns.stiffness_n_m, " N/m, ",
                          h.cns.damping_n_s_m, " N s/m, ", h.cns.integral_n_m_s, " N/(m s) after ",
                          h.cns.delay_s, " s, lag ", h.cns.lag_s, " s")
               : ", no voluntary control",
      co.level > 0.0 || co.speed_m_s > 0.0
          ? sentence(6, ", co-contraction ", co.level, " (K x ", co.stiffness_factor, ", B x ",
                     co.damping_factor, " at 1)",
                     co.speed_m_s > 0.0 ? sentence(6, ", rising with the speed over ", co.speed_m_s,
                                                   " m/s for ", co.memory_s, " s")
                                        : "")
          : ""));
  const Sensors& s = e.sensors;
  lines.push_back(
      sentence(6, "simulated sensors: position ", s.position_resolution_m, " m resolution, ",
               s.position_noise_m, " m noise; force ", s.force_resolution_n, " N resolution, ",
               s.force_noise_n, " N noise",
               s.force_delay_s > 0.0 ? sentence(6, ", ", s.force_delay_s, " s late") : ""));
  lines.insert(lines.end(), e.notes.begin(), e.notes.end());
  return lines;
}

}  // namespace ulna::sim
