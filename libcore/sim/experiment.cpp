#include "sim/experiment.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "base/words.hpp"
#include "sim/loop.hpp"
#include "sim/streams.hpp"

namespace ulna::sim {
namespace {

constexpr const char* kAxis[2] = {"x", "y"};

double quantised(double value, double resolution) {
  return resolution > 0.0 ? resolution * std::round(value / resolution) : value;
}

// The reference between its rows, and its slope: central differences, as the command is known
// ahead.
class Reference {
 public:
  Reference(const Experiment& e, Index per_row) : e_(e), per_row_(per_row) {}

  Vector2 value(Index step) const {
    const Index row = step / per_row_;
    const double part = static_cast<double>(step % per_row_) / static_cast<double>(per_row_);
    return (1.0 - part) * at(row) + part * at(row + 1);
  }
  Vector2 rate(Index step) const {
    const Index row = step / per_row_;
    const double part = static_cast<double>(step % per_row_) / static_cast<double>(per_row_);
    return (1.0 - part) * slope(row) + part * slope(row + 1);
  }

 private:
  Vector2 at(Index row) const {
    const Index last = e_.reference.rows() - 1;
    Vector2 out = Vector2::Zero();
    out.head(e_.axes()) = e_.reference.row(std::clamp<Index>(row, 0, last)).transpose();
    return out;
  }
  Vector2 slope(Index row) const { return 0.5 * e_.rate_hz * (at(row + 1) - at(row - 1)); }

  const Experiment& e_;
  Index per_row_;
};

// Instants at the rows of the record; the force also in between and before, for its delay.
struct Course {
  std::vector<Instant> rows;
  std::vector<Vector2> force;  // at every instant of the control, settling included
  Index settle = 0;            // instants before the first row
  Index per_row = 1;
  Index limited = 0;
};

Course run_loop(const Experiment& e, std::uint64_t seed, std::uint64_t run, Token* token) {
  Loop loop(e, seed, run);
  Course course;
  course.per_row = static_cast<Index>(std::lround(control_rate(e) / e.rate_hz));
  course.settle = static_cast<Index>(std::lround(e.settle_s * control_rate(e)));
  const Reference reference(e, course.per_row);
  const Index rows = e.reference.rows();
  const Index steps = course.settle + (rows - 1) * course.per_row + 1;
  course.rows.reserve(static_cast<std::size_t>(rows));
  course.force.reserve(static_cast<std::size_t>(steps));
  for (Index i = 0; i < steps; ++i) {
    if (i % 1000 == 0) {
      step(token, static_cast<double>(i) / static_cast<double>(steps));
    }
    const Index at = std::max<Index>(0, i - course.settle);
    const bool settling = i < course.settle;
    const Instant now =
        loop.advance(reference.value(at), settling ? Vector2(Vector2::Zero()) : reference.rate(at));
    course.force.push_back(now.force);
    if (!settling && at % course.per_row == 0) course.rows.push_back(now);
  }
  course.limited = loop.limited();
  return course;
}

// The force of delay_s ago, linear between instants.
Vector2 late_force(const Course& course, Index row, double delay_steps) {
  const double at =
      std::max(0.0, static_cast<double>(course.settle + row * course.per_row) - delay_steps);
  const auto before = static_cast<std::size_t>(at);
  const double part = at - std::floor(at);
  if (part == 0.0) return course.force[before];
  return (1.0 - part) * course.force[before] + part * course.force[before + 1];
}

// Columns of the record, filled in the order in which they are declared.
class Columns {
 public:
  Columns(Index rows, std::string frame) : rows_(rows), frame_(std::move(frame)) {}

  Index add(std::string name, const char* unit, Role role, int axis) {
    Channel channel;
    channel.name = std::move(name);
    channel.unit = unit;
    channel.frame = frame_;
    channel.role = role;
    channel.axis = axis;
    channels_.push_back(std::move(channel));
    values_.emplace_back(rows_);
    return static_cast<Index>(values_.size()) - 1;
  }
  // The first of `n` columns, name(axis) each.
  template <class Name>
  Index add_axes(Index n, const char* unit, Role role, const Name& name) {
    const auto first = static_cast<Index>(values_.size());
    for (int a = 0; a < static_cast<int>(n); ++a) {
      add(name(a), unit, role, role == Role::kOther ? 0 : a);
    }
    return first;
  }
  double& at(Index column, Index row) { return values_[static_cast<std::size_t>(column)][row]; }

  Record::Parts parts() {
    Record::Parts parts;
    parts.values.resize(rows_, static_cast<Index>(values_.size()));
    for (std::size_t c = 0; c < values_.size(); ++c) {
      parts.values.col(static_cast<Index>(c)) = values_[c];
    }
    parts.channels = std::move(channels_);
    return parts;
  }

 private:
  Index rows_;
  std::string frame_;
  std::vector<Channel> channels_;
  std::vector<Vector> values_;
};

class Recorder {
 public:
  Recorder(const Experiment& e, const Course& course, std::uint64_t seed, std::uint64_t run)
      : e_(e),
        course_(course),
        n_(e.axes()),
        columns_(e.reference.rows(), e.frame),
        position_noise_(random_of(seed, run, Stream::kPosition)),
        force_noise_(random_of(seed, run, Stream::kForce)),
        acceleration_noise_(random_of(seed, run, Stream::kAccelerometer)) {}

  Record::Parts parts() {
    declare();
    for (Index i = 0; i < e_.reference.rows(); ++i) fill(i);
    return columns_.parts();
  }

 private:
  void declare() {
    const bool position = e_.controller.mode == ControlMode::kPosition;
    const auto axis = [](int a) { return std::string(kAxis[a]); };
    const auto named = [&](const char* before, const char* after) {
      return [=](int a) { return std::string(before) + kAxis[a] + after; };
    };
    position_ = columns_.add_axes(n_, "m", Role::kPosition, axis);
    force_ = columns_.add_axes(n_, "N", Role::kForce, named("F_", ""));
    reference_ = position ? columns_.add_axes(n_, "m", Role::kReference, named("", "_ref"))
                          : columns_.add_axes(n_, "N", Role::kReference, named("F_", "_ref"));
    if (e_.extras.acceleration) {
      acceleration_ = columns_.add_axes(n_, "m/s^2", Role::kOther, named("a_", ""));
    }
    if (e_.extras.robot) {
      const auto joint = [](const char* of) {
        return [=](int a) { return std::string(of) + std::to_string(a + 1); };
      };
      const bool turns = !e_.robot->has_independent_axes();
      angle_ = columns_.add_axes(n_, turns ? "rad" : "m", Role::kOther, joint("q_"));
      torque_ = columns_.add_axes(n_, turns ? "Nm" : "N", Role::kOther, joint("tau_"));
    }
    if (e_.extras.truth) {
      truth_ = columns_.add_axes(n_, "m", Role::kOther, named("", "_true"));
      columns_.add_axes(n_, "m/s", Role::kOther, named("v_", "_true"));
      columns_.add_axes(n_, "m/s^2", Role::kOther, named("a_", "_true"));
      columns_.add_axes(n_, "N", Role::kOther, named("F_", "_true"));
      columns_.add_axes(n_, "N", Role::kOther, named("F_", "_cns"));
      columns_.add_axes(n_, "N", Role::kOther, named("F_", "_tremor"));
      columns_.add("cocontraction", "1", Role::kOther, 0);
    }
  }

  void fill(Index i) {
    const Instant& now = course_.rows[static_cast<std::size_t>(i)];
    const Sensors& s = e_.sensors;
    const bool position = e_.controller.mode == ControlMode::kPosition;
    const Vector2 force = late_force(course_, i, s.force_delay_s * control_rate(e_));
    Vector2 error = Vector2::Zero();  // of the measured position
    for (Index a = 0; a < n_; ++a) {
      const double x = quantised(now.position[a] + noise(position_noise_, s.position_noise_m),
                                 s.position_resolution_m);
      error[a] = x - now.position[a];
      columns_.at(position_ + a, i) = x;
      columns_.at(force_ + a, i) =
          quantised(force[a] + noise(force_noise_, s.force_noise_n), s.force_resolution_n);
      columns_.at(reference_ + a, i) = e_.reference(i, a) + (position ? e_.centre[a] : 0.0);
    }
    for (Index a = 0; acceleration_ && a < n_; ++a) {
      columns_.at(*acceleration_ + a, i) =
          quantised(now.acceleration[a] + noise(acceleration_noise_, s.acceleration_noise_m_s2),
                    s.acceleration_resolution_m_s2);
    }
    if (angle_) fill_robot(i, now, error);
    if (truth_) fill_truth(i, now);
  }

  // The encoders sit at the joints: their error is that of the position.
  void fill_robot(Index i, const Instant& now, const Vector2& error) {
    const Eigen::Rotation2Dd turn(e_.controller.base_angle_rad);
    const Matrix2 jacobian =
        turn.toRotationMatrix() * e_.robot->at(now.angle, Vector2::Zero()).jacobian;
    const Vector2 angle = now.angle + jacobian.inverse() * error;
    for (Index a = 0; a < n_; ++a) {
      columns_.at(*angle_ + a, i) = angle[a];
      columns_.at(*torque_ + a, i) = now.torque[a];
    }
  }

  void fill_truth(Index i, const Instant& now) {
    Index column = *truth_;
    for (const Vector2* v :
         {&now.position, &now.velocity, &now.acceleration, &now.force, &now.cns, &now.tremor}) {
      for (Index a = 0; a < n_; ++a) columns_.at(column++, i) = (*v)[a];
    }
    columns_.at(column, i) = now.cocontraction;
  }

  static double noise(Random& random, double rms) {
    return rms > 0.0 ? rms * random.normal() : 0.0;
  }

  const Experiment& e_;
  const Course& course_;
  Index n_;
  Columns columns_;
  Random position_noise_, force_noise_, acceleration_noise_;
  Index position_ = 0, force_ = 0, reference_ = 0;
  std::optional<Index> acceleration_, angle_, torque_, truth_;
};

Record record_of(const Experiment& e, const Course& course, std::uint64_t seed, std::uint64_t run) {
  Record::Parts parts = Recorder(e, course, seed, run).parts();
  parts.rate_hz = e.rate_hz;
  for (const auto& [begin, end] : e.segments) parts.segments.push_back({begin, end, 0});
  parts.provenance = provenance_of(e);
  parts.provenance.push_back(sentence(12, "simulated with seed ", seed, ", run ", run));
  if (course.limited > 0) {
    parts.provenance.push_back(sentence(6, "simulated: the commanded force met its limit of ",
                                        e.controller.force_limit_n, " N at ", course.limited,
                                        " of ", course.force.size(), " instants"));
  }
  return Record::make(std::move(parts));
}

// A loop that lives at the limit of its force swings there for ever.
void check_limited(const Experiment& e, const Course& course) {
  constexpr double kMost = 0.1;
  const double share =
      static_cast<double>(course.limited) / static_cast<double>(course.force.size());
  if (share <= kMost) return;
  throw Error(Fault::kAnalysis, "force_limit_n",
              sentence(3, "the commanded force met its limit of ", e.controller.force_limit_n,
                       " N at ", 100.0 * share,
                       " % of the instants: the loop is unstable, or the limit too low for the "
                       "reference"));
}

Record run_checked(const Experiment& e, std::uint64_t seed, std::uint64_t run, Token* token) {
  const Course course = run_loop(e, seed, run, token);
  check_limited(e, course);
  return record_of(e, course, seed, run);
}

}  // namespace

Record simulate(const Experiment& experiment, std::uint64_t seed, std::uint64_t run, Token* token) {
  check_experiment(experiment);
  check_stability(experiment, token);
  return run_checked(experiment, seed, run, token);
}

std::vector<Record> simulate_batch(const Experiment& experiment, std::uint64_t seed, Index count,
                                   int threads, Token* token) {
  require(count >= 1 && count <= 1000000, "runs", "runs must be from 1 to 1000000");
  check_experiment(experiment);
  check_stability(experiment, token);
  std::vector<std::optional<Record>> made(static_cast<std::size_t>(count));
  parallel_for(
      count, threads,
      [&](std::ptrdiff_t i) {
        Token part(token);  // the pool reports the progress
        made[static_cast<std::size_t>(i)] =
            run_checked(experiment, seed, static_cast<std::uint64_t>(i), &part);
      },
      token);
  std::vector<Record> records;
  records.reserve(made.size());
  for (std::optional<Record>& record : made) records.push_back(std::move(*record));
  return records;
}

}  // namespace ulna::sim
