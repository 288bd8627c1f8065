#include "sim/mobilisation.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>

#include "base/error.hpp"
#include "base/words.hpp"
#include "sim/joint_log.hpp"

namespace ulna::sim {
namespace {

constexpr double kStartDegrees = 110.0;    // published, of the elbow
constexpr double kPublishedRate = 2.0;     // rad/s
constexpr double kStepsBetweenLooks = 20;  // at the token and the clock

std::string degrees_of(double angle) { return sentence(4, angle / kDegree); }

Index index_in(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : static_cast<Index>(found - names.begin());
}

// Protocol with its defaults filled in for a plant.
struct MovePlan {
  Vector start;              // device joints
  std::vector<Index> moved;  // device joints
  Vector end;                // of the moved joints
  Index log_steps = 1;
  Index hold_steps = 1;
  Index reference_steps = 1;
  Index rows = 0;
};

Index whole_steps(double seconds, double step, const char* argument, const char* what) {
  const double steps = seconds / step;
  const double whole = std::round(steps);
  require(whole >= 1.0 && std::fabs(steps - whole) < 1e-6 * whole, argument,
          sentence(6, what, " of ", 1e3 * seconds,
                   " ms must be a whole number of the plant's time "
                   "steps of ",
                   1e3 * step, " ms"));
  return static_cast<Index>(whole);
}

Vector start_of(const Protocol& p, const MobilisedPlant& plant) {
  const Index joints = plant.reference().size();
  if (p.start.size() > 0) {
    require(p.start.size() == joints, "start",
            sentence(6, "the start has ", p.start.size(), " angles, the device has ", joints,
                     " joints: ", join(plant.device_joints())));
    return p.start;
  }
  Vector start = plant.reference();
  const Matrix range = plant.device_range();
  start[joints - 1] =
      std::min(kStartDegrees * kDegree,
               range(joints - 1, 0) + 0.88 * (range(joints - 1, 1) - range(joints - 1, 0)));
  return start;
}

void check_in_range(const std::string& joint, double angle, const Matrix& range, Index j,
                    const char* argument, const std::string& what) {
  require(std::isfinite(angle), argument,
          "the " + what + " of joint '" + joint + "' is not finite");
  if (angle >= range(j, 0) && angle <= range(j, 1)) return;
  throw Error(Fault::kArgument, argument,
              "the " + what + " of joint '" + joint + "' is " + degrees_of(angle) +
                  " degrees, outside its range of " + degrees_of(range(j, 0)) + " to " +
                  degrees_of(range(j, 1)),
              "joint " + joint);
}

MovePlan course_of(const Protocol& p, const MobilisedPlant& plant) {
  MovePlan c;
  const std::vector<std::string>& joints = plant.device_joints();
  const Matrix range = plant.device_range();
  c.start = start_of(p, plant);
  for (Index j = 0; j < c.start.size(); ++j) {
    check_in_range(joints[static_cast<std::size_t>(j)], c.start[j], range, j, "start", "start");
  }
  std::vector<MovedJoint> moved = p.moved;
  if (moved.empty()) {
    const bool stops_short = p.motion.shape == MotionShape::kLogistic;
    moved.push_back({joints.back(), stops_short ? 0.0 : 10.0 * kDegree});
  }
  c.end.resize(static_cast<Index>(moved.size()));
  const Vector limit = plant.motor_limit();
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const Index j = index_in(joints, moved[i].name);
    require(j >= 0, "joint",
            "the device has no joint '" + moved[i].name + "'; its joints are: " + join(joints));
    require(std::find(c.moved.begin(), c.moved.end(), j) == c.moved.end(), "joint",
            "joint '" + moved[i].name + "' is moved twice");
    require(limit[j] > 0.0, "joint", "joint '" + moved[i].name + "' has no motor");
    check_in_range(moved[i].name, moved[i].end, range, j, "end", "end");
    c.moved.push_back(j);
    c.end[static_cast<Index>(i)] = moved[i].end;
  }
  const double h = plant.timestep();
  c.log_steps = whole_steps(1.0 / p.log_rate_hz, h, "log_rate_hz", "a period of the log");
  if (p.control.mode == TorqueUpdate::kHeld) {
    c.hold_steps = whole_steps(p.control.hold_s, h, "hold_s", "the hold of the torque");
  }
  if (p.control.reference_hold_s > 0.0) {
    c.reference_steps =
        whole_steps(p.control.reference_hold_s, h, "reference_hold_s", "the hold of the reference");
  }
  c.rows = static_cast<Index>(std::floor(p.motion.length_s() * p.log_rate_hz + 1e-6)) + 1;
  return c;
}

// How a run ends before its time.
struct Ended {
  RunStatus status;
  std::string reason;
};

// One simulation under its controller and its nerves.
class DrivenRun {
 public:
  DrivenRun(const MobilisedPlant& plant, const Protocol& protocol, const MovePlan& course,
            Token* token)
      : plant_(plant),
        p_(protocol),
        c_(course),
        token_(token),
        step_s_(plant.timestep()),
        limit_(plant.motor_limit()),
        integral_(Vector::Zero(course.start.size())),
        torque_(Vector::Zero(course.start.size())),
        begun_(std::chrono::steady_clock::now()) {
    const Vector damping = p_.control.mode == TorqueUpdate::kImplicitDamping
                               ? Vector(Vector::Constant(course.start.size(), p_.control.kd))
                               : Vector(Vector::Zero(course.start.size()));
    run_ = plant.start(p_.donned ? c_.start : plant.reference(), damping);
    angle_ = run_->device_angle();
    rate_ = run_->device_rate();
  }

  MobilisedRun& run() { return *run_; }
  const Vector& angle() const { return angle_; }
  const Vector& rate() const { return rate_; }
  double time() const { return static_cast<double>(steps_) * step_s_; }
  const Vector& levels() const { return levels_; }

  // The muscles are excited from here on.
  void wake() {
    nerves_ = std::make_unique<Nerves>(p_.excitation, plant_, run_->human_angle(), step_s_);
    levels_ = nerves_->levels();
    excitation_ = levels_;
  }

  // From here on the rates are limited: a step to the start may be fast.
  void begin_movement() { moving_ = true; }

  // With the motors off.
  void idle() {
    torque_.setZero();
    advance();
  }

  // The next step has a new torque.
  bool at_update() const { return steps_ % c_.hold_steps == 0; }

  void drive(const VectorRef& reference, const VectorRef& reference_rate) {
    if (at_update()) update(reference, reference_rate);
    advance();
  }

 private:
  void update(const VectorRef& reference, const VectorRef& reference_rate) {
    const MobilisationControl& g = p_.control;
    const Vector error = reference - angle_;
    integral_ += error * (static_cast<double>(c_.hold_steps) * step_s_);
    torque_ = g.kp * error + g.ki * integral_ + g.kd * reference_rate;
    if (g.mode != TorqueUpdate::kImplicitDamping) torque_ -= g.kd * rate_;
    if (g.weight) torque_ += plant_.nominal().tree().gravity_torque(angle_);
    torque_ = torque_.cwiseMin(limit_).cwiseMax(-limit_);
  }

  void advance() {
    if (steps_ % static_cast<Index>(kStepsBetweenLooks) == 0) look();
    run_->command(torque_, excitation_.size() > 0
                               ? excitation_
                               : Vector(Vector::Zero(static_cast<Index>(plant_.muscles().size()))));
    run_->step();
    ++steps_;
    if (nerves_) excitation_ = nerves_->excitation(*run_);
    angle_ = run_->device_angle();
    rate_ = run_->device_rate();
    check_motion();
  }

  void look() {
    if (token_ != nullptr) ulna::step(token_, token_->progress());
    if (p_.time_limit_s <= 0.0) return;
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begun_;
    if (spent.count() > p_.time_limit_s) {
      throw Ended{RunStatus::kTimeout, sentence(4, "computing took longer than ", p_.time_limit_s,
                                                " s; ", time(), " s were simulated by then")};
    }
  }

  void check_motion() {
    for (Index j = 0; j < angle_.size(); ++j) {
      const std::string& joint = plant_.device_joints()[static_cast<std::size_t>(j)];
      if (!std::isfinite(angle_[j]) || !std::isfinite(rate_[j])) {
        throw Ended{RunStatus::kNonfinite, sentence(4, "the motion of joint '", joint,
                                                    "' is not finite at ", time(), " s")};
      }
      if (moving_ && !p_.published_flags && std::fabs(rate_[j]) > p_.rate_limit) {
        throw Ended{RunStatus::kDiverged,
                    sentence(4, "joint '", joint, "' moves with ", rate_[j], " rad/s at ", time(),
                             " s, above the limit of ", p_.rate_limit,
                             " rad/s: the controller may be unstable on this arm")};
      }
    }
  }

  const MobilisedPlant& plant_;
  const Protocol& p_;
  const MovePlan& c_;
  Token* token_;
  double step_s_;
  Vector limit_, integral_, torque_;
  std::chrono::steady_clock::time_point begun_;
  std::unique_ptr<MobilisedRun> run_;
  std::unique_ptr<Nerves> nerves_;
  Vector angle_, rate_, excitation_, levels_;
  Index steps_ = 0;
  bool moving_ = false;
};

void settle(DrivenRun& driven, const Protocol& p, const MovePlan& c, const MobilisedPlant& plant) {
  const auto steps = static_cast<Index>(std::lround(p.settle_s / plant.timestep()));
  const Vector rest = Vector::Zero(c.start.size());
  for (Index i = 0; i < steps; ++i) {
    if (p.donned) {
      driven.drive(c.start, rest);
    } else {
      driven.idle();
    }
  }
}

// Throws Ended with the joint that is furthest from its place.
void reach_start(DrivenRun& driven, const Protocol& p, const MovePlan& c,
                 const MobilisedPlant& plant) {
  const double begun = driven.time();
  const Vector from = driven.angle();
  const ReferenceMotion way{.shape = MotionShape::kMinimumJerk,
                            .duration_s = std::max(p.approach_s, 0.1)};
  while (driven.time() - begun < p.start_limit_s) {
    const double t = driven.time() - begun;
    const bool still = t >= p.approach_s;
    const ReferenceMotion::Point s = still ? ReferenceMotion::Point{1.0, 0.0} : way.at(t);
    driven.drive(from + s.share * (c.start - from), s.rate * (c.start - from));
    if (!still || !driven.at_update()) continue;
    const Vector error = driven.angle() - c.start;
    if (error.cwiseAbs().maxCoeff() < p.start_angle &&
        driven.rate().cwiseAbs().maxCoeff() < p.start_rate) {
      return;
    }
  }
  const Vector error = (driven.angle() - c.start).cwiseAbs() / p.start_angle +
                       driven.rate().cwiseAbs() / p.start_rate;
  Index worst = 0;
  error.maxCoeff(&worst);
  throw Ended{RunStatus::kFailedInit,
              "the start was not reached within " + sentence(4, p.start_limit_s) + " s: joint '" +
                  plant.device_joints()[static_cast<std::size_t>(worst)] + "' stood at " +
                  degrees_of(driven.angle()[worst]) + " degrees with " +
                  degrees_of(driven.rate()[worst]) + " degrees/s, " + degrees_of(c.start[worst]) +
                  " degrees are wanted"};
}

// A controller that swings at its limits keeps the angles bounded but follows nothing.
void check_following(DrivenRun& driven, const Protocol& p, const MovePlan& c,
                     const MobilisedPlant& plant, const VectorRef& reference) {
  for (Index j = 0; j < reference.size(); ++j) {
    const double error = driven.angle()[j] - reference[j];
    if (std::fabs(error) <= p.follow_limit) continue;
    const bool moved = std::find(c.moved.begin(), c.moved.end(), j) != c.moved.end();
    throw Ended{RunStatus::kDiverged,
                "joint '" + plant.device_joints()[static_cast<std::size_t>(j)] + "' is " +
                    degrees_of(error) + " degrees away from where it should " +
                    (moved ? "be" : "stay") + " at " + sentence(4, driven.time()) +
                    " s: the motors are too weak or the controller is unstable "
                    "on this arm"};
  }
}

// As published: at an instant of the log, and in one direction.
void check_published(const DrivenRun& driven, const MovePlan& c, const MobilisedPlant& plant) {
  for (const Index j : c.moved) {
    if (!(driven.rate()[j] > kPublishedRate)) continue;
    throw Ended{RunStatus::kDiverged,
                "joint '" + plant.device_joints()[static_cast<std::size_t>(j)] + "' moves with " +
                    sentence(4, driven.rate()[j], " rad/s at ", driven.time(), " s, above ",
                             kPublishedRate, " rad/s: the published flag")};
  }
}

// A moved joint or the human joint that it turns beyond its range.
void check_limits(DrivenRun& driven, const Protocol& p, const MovePlan& c,
                  const MobilisedPlant& plant) {
  const auto check = [&](const std::string& joint, double angle, const Matrix& range, Index j) {
    if (angle >= range(j, 0) - p.limit_margin && angle <= range(j, 1) + p.limit_margin) return;
    throw Ended{RunStatus::kLimit, "joint '" + joint + "' left its range of " +
                                       degrees_of(range(j, 0)) + " to " + degrees_of(range(j, 1)) +
                                       " degrees: it stood at " + degrees_of(angle) +
                                       " degrees at " + sentence(4, driven.time()) + " s"};
  };
  const Vector human = driven.run().human_angle();
  for (const Index j : c.moved) {
    check(plant.device_joints()[static_cast<std::size_t>(j)], driven.angle()[j],
          plant.device_range(), j);
    const Index h = plant.counterparts()[static_cast<std::size_t>(j)];
    if (h < 0) continue;
    check(plant.human_joints()[static_cast<std::size_t>(h)], human[h], plant.human_range(), h);
  }
}

void move(DrivenRun& driven, const Protocol& p, const MovePlan& c, const MobilisedPlant& plant,
          Token* token, JointLog& log) {
  driven.begin_movement();
  const Vector from = driven.angle();
  Vector reference = c.start;
  Vector reference_rate = Vector::Zero(c.start.size());
  for (Index i = 0; i < (c.rows - 1) * c.log_steps + 1; ++i) {
    const Index held = i - i % c.reference_steps;
    const ReferenceMotion::Point s = p.motion.at(static_cast<double>(held) * plant.timestep());
    for (std::size_t k = 0; k < c.moved.size(); ++k) {
      const Index j = c.moved[k];
      const double way = c.end[static_cast<Index>(k)] - from[j];
      reference[j] = from[j] + s.share * way;
      reference_rate[j] = s.rate * way;
    }
    const bool logged = i % c.log_steps == 0;
    if (logged && p.published_flags) check_published(driven, c, plant);
    if (logged) {
      log.before_step(driven.run(), reference);
      const double rows = static_cast<double>(c.rows);
      ulna::step(token, static_cast<double>(i / c.log_steps) / rows);
    }
    driven.drive(reference, reference_rate);
    if (logged) log.after_step(driven.run());
    if (p.published_flags) continue;
    check_limits(driven, p, c, plant);
    check_following(driven, p, c, plant, reference);
  }
}

Ended ended_by(const Error& error) {
  switch (error.fault()) {
    case Fault::kAnalysis:
    case Fault::kInternal:
      return {RunStatus::kDiverged, error.what()};
    case Fault::kUnsupported:
      return {RunStatus::kLimit, error.what()};
    case Fault::kData:
      return {RunStatus::kNonfinite, error.what()};
    default:
      throw;  // not of the run: memory, cancelled, a wrong call
  }
}

}  // namespace

const char* word(RunStatus status) {
  switch (status) {
    case RunStatus::kOk:
      return "ok";
    case RunStatus::kFailedInit:
      return "failed_init";
    case RunStatus::kDiverged:
      return "diverged";
    case RunStatus::kLimit:
      return "limit";
    case RunStatus::kTimeout:
      return "timeout";
    case RunStatus::kNonfinite:
      return "nonfinite";
  }
  return "unknown";
}

Protocol Protocol::published() {
  Protocol p;
  p.donned = false;
  p.settle_s = 2.5;
  p.control.mode = TorqueUpdate::kHeld;
  p.control.reference_hold_s = 0.01;
  return p;
}

void Protocol::check(const MobilisedPlant& plant) const {
  const auto between = [](double value, double low, double high, const char* argument,
                          const char* what) {
    require(std::isfinite(value) && value >= low && value <= high, argument,
            sentence(6, what, " must be between ", low, " and ", high));
  };
  between(settle_s, 0.0, 600.0, "settle_s", "the time to settle in s");
  between(start_limit_s, 0.0, 3600.0, "start_limit_s", "the time to reach the start in s");
  between(start_angle, 1e-9, kPi, "start_angle", "the tolerance of the start in rad");
  between(start_rate, 1e-9, 100.0, "start_rate", "the tolerance of the start's rate in rad/s");
  between(approach_s, 0.0, 600.0, "approach_s", "the time of the approach in s");
  between(control.kp, 0.0, 1e6, "kp", "kp");
  between(control.ki, 0.0, 1e6, "ki", "ki");
  between(control.kd, 0.0, 1e6, "kd", "kd");
  between(control.hold_s, 1e-6, 1.0, "hold_s", "the hold of the torque in s");
  between(control.reference_hold_s, 0.0, 1.0, "reference_hold_s", "the hold of the reference in s");
  between(log_rate_hz, 1.0, 1e5, "log_rate_hz", "the rate of the log in Hz");
  between(rate_limit, 1e-3, 1e4, "rate_limit", "the limit of the rate in rad/s");
  between(follow_limit, 1e-6, 10.0, "follow_limit", "the limit of the tracking error in rad");
  between(limit_margin, 0.0, kPi, "limit_margin", "the margin of the limits in rad");
  between(time_limit_s, 0.0, 1e7, "time_limit_s", "the limit of the computing time in s");
  motion.check();
  excitation.check();
  const MovePlan course = course_of(*this, plant);
  require(course.rows <= 10'000'000, "motion", "the movement has more than ten million rows");
}

Mobilisation mobilise(const MobilisedPlant& plant, const Protocol& protocol, Token* token) {
  protocol.check(plant);
  const MovePlan course = course_of(protocol, plant);
  Mobilisation m;
  m.largest_slip = kNaN;
  JointLog log(plant, course.moved, protocol.log_rate_hz);
  std::optional<DrivenRun> driven;
  const auto keep = [&m](const Ended& ended) {
    m.status = ended.status;
    m.reason = ended.reason;
  };
  try {
    driven.emplace(plant, protocol, course, token);
    log.donned(driven->run());
    settle(*driven, protocol, course, plant);
    driven->wake();
    m.levels = driven->levels();
    reach_start(*driven, protocol, course, plant);
    m.start_s = driven->time();
    move(*driven, protocol, course, plant, token, log);
  } catch (const Ended& ended) {
    keep(ended);
  } catch (const Error& error) {
    keep(ended_by(error));
  }
  if (driven) m.simulated_s = driven->time();
  log.finish(protocol, m);
  if (m.status == RunStatus::kOk) step(token, 1.0);
  return m;
}

}  // namespace ulna::sim
