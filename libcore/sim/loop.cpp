#include "sim/loop.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "sim/streams.hpp"

namespace ulna::sim {
namespace {

constexpr double kRunaway_m_s = 10.0;  // no arm and no robot of this kind is ever that fast

// An arm of one axis is simulated with a second one that stays at rest.
Matrix2 padded(const Matrix& m, double other) {
  Matrix2 out = other * Matrix2::Identity();
  out.topLeftCorner(m.rows(), m.cols()) = m;
  return out;
}

Vector2 padded(const Vector& v) {
  Vector2 out = Vector2::Zero();
  out.head(v.size()) = v;
  return out;
}

Matrix2 rotation(double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  Matrix2 r;
  r << c, -s, s, c;
  return r;
}

ColouredNoise tremor_of(const Experiment& e, int axis, double step_s, std::uint64_t seed,
                        std::uint64_t run) {
  const Tremor& t = e.human.tremor;
  const double rms = axis < e.axes() ? t.rms_n : 0.0;
  const Stream stream = axis == 0 ? Stream::kTremorX : Stream::kTremorY;
  return ColouredNoise(rms, t.natural_hz, t.damping, step_s, random_of(seed, run, stream));
}

}  // namespace

double control_rate(const Experiment& e) {
  return e.rate_hz * std::max(1.0, std::ceil(e.controller.rate_hz / e.rate_hz - 1e-9));
}

History::History(double steps) : ring_(static_cast<std::size_t>(std::ceil(steps)) + 2) {}

void History::push(const Vector2& value) noexcept {
  ring_[static_cast<std::size_t>(pushed_) % ring_.size()] = value;
  ++pushed_;
}

const Vector2& History::at(Index steps) const noexcept {
  const Index index = std::max<Index>(0, pushed_ - 1 - steps);
  return ring_[static_cast<std::size_t>(index) % ring_.size()];
}

Vector2 History::back(double steps) const noexcept {
  const double whole = std::floor(steps);
  const double part = steps - whole;
  const auto near = static_cast<Index>(whole);
  if (part == 0.0) return at(near);
  return (1.0 - part) * at(near) + part * at(near + 1);
}

Loop::Loop(const Experiment& e, std::uint64_t seed, std::uint64_t run, const Vector2& offset_m,
           Index substeps)
    : e_(e),
      step_s_(1.0 / control_rate(e)),
      substeps_(substeps),
      m_(padded(e.arm.m, 1.0) + e.arm.payload_kg * Matrix2::Identity()),
      b_(padded(e.arm.b, 1.0)),
      k_(padded(e.arm.k, 1.0)),
      turn_(rotation(e.controller.base_angle_rad)),
      x0_(padded(e.arm.x0.size() > 0 ? e.arm.x0 : e.centre)),
      centre_(padded(e.centre)),
      target_(padded(e.human.cns.target.size() > 0 ? e.human.cns.target : e.centre)),
      commands_(std::round(e.controller.delay_s * control_rate(e))),
      tremor_x_(tremor_of(e, 0, step_s_, seed, run)),
      tremor_y_(tremor_of(e, 1, step_s_, seed, run)),
      positions_(e.human.cns.delay_s * control_rate(e)),
      velocities_(e.human.cns.delay_s * control_rate(e)) {
  Vector2 start = centre_;
  if (e.controller.mode == ControlMode::kPosition) {
    start += padded(Vector(e.reference.row(0).transpose()));
  }
  const Vector2 in_robot = turn_.transpose() * (start + offset_m - e.controller.base_m);
  now_ = {usable_angles(*e.robot, in_robot, "centre_m", "the start of the experiment"),
          Vector2::Zero()};
  const RobotState robot = state_of(now_);
  const Matrix2 back = robot.jacobian.inverse();
  const Matrix2 total = m_ + back.transpose() * robot.inertia * back;
  const Eigen::SelfAdjointEigenSolver<Matrix2> eigen(0.5 * (total + total.transpose()));
  if (!(eigen.eigenvalues()[0] > 1e-6)) {
    throw Error(Fault::kArgument, "m",
                sentence(3, "the inertia of arm and robot together is not positive definite (",
                         eigen.eigenvalues()[0],
                         " kg in one direction): a negative mass cannot be simulated"));
  }
  if (substeps_ == 0) choose_substeps();
  tremor_now_ << tremor_x_.next(), tremor_y_.next();
}

RobotState Loop::state_of(const Motion& at) const {
  RobotState s = e_.robot->at(at.angle, at.rate);
  s.position = e_.controller.base_m + turn_ * s.position;
  s.jacobian = turn_ * s.jacobian;
  s.jacobian_rate = turn_ * s.jacobian_rate;
  return s;
}

Loop::Response Loop::respond(const Motion& at, const Pull& pull, const Vector2& own) const {
  Response r;
  r.robot = state_of(at);
  r.velocity = r.robot.jacobian * at.rate;
  r.arm = pull.b * r.velocity;
  if (e_.arm.springs) {
    r.arm -= e_.arm.springs->force(r.robot.position);
  } else {
    r.arm += pull.k * (r.robot.position - x0_);
  }
  const Matrix2 transposed = r.robot.jacobian.transpose();
  const Matrix2 inertia = r.robot.inertia + transposed * m_ * r.robot.jacobian;
  r.mobility = inertia.inverse();
  r.free = r.mobility * (transposed * (own - r.arm - m_ * (r.robot.jacobian_rate * at.rate)) -
                         r.robot.coriolis * at.rate - r.robot.friction);
  return r;
}

// A step must follow the fastest mode there is: dry friction near rest, a stiff or light arm.
void Loop::choose_substeps() {
  constexpr double kSmall = 1e-9;  // rad/s or m/s: the slope of the friction at rest
  const Cocontraction& c = e_.human.cocontraction;
  const RobotState robot = state_of(now_);
  const Matrix2 mobility =
      (robot.inertia + robot.jacobian.transpose() * m_ * robot.jacobian).inverse();
  Matrix2 damping =
      robot.jacobian.transpose() * std::max(1.0, c.damping_factor) * b_ * robot.jacobian;
  for (int j = 0; j < 2; ++j) {
    damping.col(j) += e_.robot->at(now_.angle, kSmall * Vector2::Unit(j)).friction / kSmall;
  }
  Matrix2 stiffness = std::max(1.0, c.stiffness_factor) * k_;
  if (e_.arm.springs) stiffness = e_.arm.springs->stiffness(robot.position);
  const Matrix2 spring = robot.jacobian.transpose() * stiffness * robot.jacobian;
  const double fastest = (mobility * damping).norm() + std::sqrt((mobility * spring).norm());
  // At 0.5 the truncation of one step, (0.5)^5 / 120, is 3e-4 of a mode that dies out in four.
  const double wanted = std::ceil(fastest * step_s_ / 0.5);
  constexpr double kMost = 200.0;
  if (!(wanted <= kMost)) {
    throw Error(Fault::kArgument, "robot",
                sentence(3, "the loop has a time constant of ", 1.0 / fastest,
                         " s, too short to simulate at ", 1.0 / step_s_,
                         " Hz: raise the threshold of the dry friction, the mass, or the rate of "
                         "the control"));
  }
  substeps_ = std::max<Index>(1, static_cast<Index>(wanted));
}

Vector2 Loop::command(const RobotState& robot, const Vector2& velocity, const Vector2& reference,
                      const Vector2& reference_rate) {
  const Controller& c = e_.controller;
  const Vector2 from_centre = robot.position - centre_;
  Vector2 force = reference;
  if (c.mode == ControlMode::kPosition) {
    force = c.kp_n_m * (reference - from_centre) + c.kd_n_s_m * (reference_rate - velocity);
  } else if (c.hold_axis >= 0) {
    force[c.hold_axis] = -c.kp_n_m * from_centre[c.hold_axis] - c.kd_n_s_m * velocity[c.hold_axis];
  }
  const double size = force.norm();
  if (c.force_limit_n > 0.0 && size > c.force_limit_n) {
    force *= c.force_limit_n / size;
    ++limited_;
  }
  commands_.push(force);
  return commands_.back(std::round(c.delay_s / step_s_));
}

// What the human does about the displacement of delay_s ago; sets the force of the next instant.
void Loop::feel(const Vector2& position, const Vector2& velocity) {
  const CnsController& cns = e_.human.cns;
  const Cocontraction& co = e_.human.cocontraction;
  cns_now_ = cns_next_;
  if (!cns.on && co.speed_m_s == 0.0) return;
  positions_.push(position);
  velocities_.push(velocity);
  const double back = std::max(0.0, cns.delay_s / step_s_ - 1.0);  // seen from the next instant
  const Vector2 error = positions_.back(back) - target_;
  const Vector2 speed = velocities_.back(back);
  if (co.speed_m_s > 0.0) {
    const double rise = speed.norm() / co.speed_m_s - reaction_;
    reaction_ = std::clamp(reaction_ + rise * step_s_ / co.memory_s, 0.0, 1.0);
  }
  if (!cns.on) return;
  const double share = 1.0 - reaction_;
  integral_ += share * cns.integral_n_m_s * step_s_ * error;
  Vector2 drive = -share * (cns.stiffness_n_m * error + cns.damping_n_s_m * speed + integral_);
  if (e_.axes() == 1) drive[1] = 0.0;
  const double keep = cns.lag_s > 0.0 ? std::exp(-step_s_ / cns.lag_s) : 0.0;
  cns_next_ =
      keep * cns_next_ + (1.0 - keep) * (keep > 0.0 ? Vector2(0.5 * (drive_ + drive)) : drive);
  drive_ = drive;
}

void Loop::integrate(const Vector2& first, const Pull& pull, const Vector2& torque) {
  const double h = step_s_ / static_cast<double>(substeps_);
  for (Index i = 0; i < substeps_; ++i) {
    const auto own = [&](double within) -> Vector2 {
      const double part = (static_cast<double>(i) + within) / static_cast<double>(substeps_);
      return pull.from + part * (pull.to - pull.from);
    };
    const auto slope = [&](const Motion& at, double within) -> Vector2 {
      const Response r = respond(at, pull, own(within));
      return r.free + r.mobility * torque;
    };
    const Motion& a = now_;
    const Vector2 a1 = i == 0 ? first : slope(a, 0.0);
    const Motion b{a.angle + 0.5 * h * a.rate, a.rate + 0.5 * h * a1};
    const Vector2 a2 = slope(b, 0.5);
    const Motion c{a.angle + 0.5 * h * b.rate, a.rate + 0.5 * h * a2};
    const Vector2 a3 = slope(c, 0.5);
    const Motion d{a.angle + h * c.rate, a.rate + h * a3};
    const Vector2 a4 = slope(d, 1.0);
    now_ = {a.angle + h / 6.0 * (a.rate + 2.0 * b.rate + 2.0 * c.rate + d.rate),
            a.rate + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)};
  }
}

void Loop::check_motion(const Vector2& velocity) const {
  const bool runs_away = !(velocity.norm() < kRunaway_m_s);
  const std::string broken = runs_away ? std::string() : e_.robot->broken_limit(now_.angle);
  if (!runs_away && broken.empty()) return;
  const double time = static_cast<double>(count_) * step_s_ - e_.settle_s;
  const std::string when = sentence(4, "time ", time, " s");
  if (runs_away) {
    throw Error(
        Fault::kAnalysis, "loop",
        sentence(4, "the handle runs away: at ", time, " s of the record it is faster than ",
                 kRunaway_m_s, " m/s; the loop is unstable or the reference too large"),
        when);
  }
  throw Error(Fault::kAnalysis, "loop",
              sentence(4, "the robot meets a stop at ", time, " s of the record, ", broken,
                       ": make the reference smaller, move the robot's base, or make the loop "
                       "stiffer"),
              when);
}

Instant Loop::advance(const Vector2& reference, const Vector2& reference_rate) {
  tremor_next_ << tremor_x_.next(), tremor_y_.next();
  const Cocontraction& co = e_.human.cocontraction;
  Instant out;
  out.cocontraction = std::min(1.0, co.level + reaction_);
  const double level = out.cocontraction;
  Pull pull{cns_next_ + tremor_now_, Vector2::Zero(),
            (1.0 + level * (co.damping_factor - 1.0)) * b_,
            (1.0 + level * (co.stiffness_factor - 1.0)) * k_};
  const Response r = respond(now_, pull, pull.from);
  check_motion(r.velocity);
  feel(r.robot.position, r.velocity);
  pull.to = cns_next_ + tremor_next_;

  const Vector2 torque =
      r.robot.jacobian.transpose() * command(r.robot, r.velocity, reference, reference_rate);
  out.torque = count_ == 0 ? torque : Vector2(0.5 * (last_torque_ + torque));
  out.angle = now_.angle;
  out.position = r.robot.position;
  out.velocity = r.velocity;
  out.acceleration =
      r.robot.jacobian * (r.free + r.mobility * out.torque) + r.robot.jacobian_rate * now_.rate;
  out.cns = cns_now_;
  out.tremor = tremor_now_;
  out.force = pull.from - m_ * out.acceleration - r.arm;

  integrate(r.free + r.mobility * torque, pull, torque);
  last_torque_ = torque;
  tremor_now_ = tremor_next_;
  ++count_;
  return out;
}

void check_stability(const Experiment& experiment, Token* token) {
  constexpr double kPush_m = 1e-4;
  constexpr double kDuration_s = 4.0;
  constexpr double kWindow_s = 0.5;
  constexpr double kGrowth = 1.2;  // a push that stays, as on a free mass, is no instability
  Experiment quiet = experiment;
  quiet.human.tremor.rms_n = 0.0;
  quiet.reference = experiment.reference.topRows(1);
  const Vector2 reference = padded(Vector(quiet.reference.row(0).transpose()));
  const Vector2 push = quiet.axes() == 1
                           ? Vector2(kPush_m, 0.0)
                           : Vector2(kPush_m * std::sqrt(0.5), kPush_m * std::sqrt(0.5));
  const auto refuse = [&](const std::string& how) {
    throw Error(Fault::kAnalysis, "loop",
                "the loop is unstable: at rest a push of 0.1 mm " + how +
                    "; lower kp and kd, shorten the delays, or lower the gains of the human's "
                    "controller");
  };
  Loop pushed(quiet, 0, 0, push);
  Loop still(quiet, 0, 0);
  const auto steps = static_cast<Index>(kDuration_s / still.step_s());
  const auto window = static_cast<Index>(kWindow_s / still.step_s());
  double early = 0.0;
  double late = 0.0;
  try {
    for (Index i = 0; i < steps; ++i) {
      if (i % 1000 == 0) step(token, 0.0);
      const Vector2 apart = pushed.advance(reference, Vector2::Zero()).position -
                            still.advance(reference, Vector2::Zero()).position;
      double& seen = i < steps / 2 ? early : late;
      if (i < window || i >= steps - window) seen = std::max(seen, apart.norm());
    }
  } catch (const Error& failure) {
    if (failure.fault() != Fault::kAnalysis) throw;
    refuse("makes the handle run away");
  }
  if (late > kGrowth * early)
    refuse(sentence(3, "grows to ", 1e3 * late, " mm in ", kDuration_s, " s"));
}

}  // namespace ulna::sim
