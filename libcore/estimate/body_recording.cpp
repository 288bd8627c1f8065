#include "estimate/body_recording.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

constexpr Index kChunk = 256;  // frames: a few milliseconds

void check_shape(const Matrix& m, Index rows, Index columns, const char* argument, bool optional) {
  if (optional && m.size() == 0) return;
  require(m.rows() == rows && m.cols() == columns, argument,
          sentence(10, argument, " is ", m.rows(), " x ", m.cols(), ", it must be ", rows, " x ",
                   columns));
}

bool has_state(const BodyRecording& r, Index i) {
  return r.angle.row(i).allFinite() && r.rate.row(i).allFinite() &&
         (r.position.size() == 0 || r.position.row(i).allFinite()) &&
         (r.orientation.size() == 0 || r.orientation.row(i).allFinite()) &&
         (r.angular_velocity.size() == 0 || r.angular_velocity.row(i).allFinite());
}

// Where a frame takes its state from: between two frames that have one; the same frame twice for
// one that has its own.
struct Between {
  Index before = -1, after = -1;
};

std::vector<Between> find_states(const BodyRecording& r, Index longest_gap) {
  std::vector<Between> between(static_cast<std::size_t>(r.frames()));
  Index last = -1;
  for (Index i = 0; i < r.frames(); ++i) {
    if (!has_state(r, i)) continue;
    between[static_cast<std::size_t>(i)] = {i, i};
    if (last >= 0 && i - last - 1 <= longest_gap) {
      for (Index k = last + 1; k < i; ++k) between[static_cast<std::size_t>(k)] = {last, i};
    }
    last = i;
  }
  return between;
}

// The state on the line between two frames.
void blend(const BodyRecording& r, Index frame, const Between& at, BodyState& state,
           BodyState& other) {
  state_of(r, at.before, state);
  if (at.after == at.before) return;
  state_of(r, at.after, other);
  const double s =
      static_cast<double>(frame - at.before) / static_cast<double>(at.after - at.before);
  state.angle += s * (other.angle - state.angle);
  state.rate += s * (other.rate - state.rate);
  state.position += s * (other.position - state.position);
  state.angular_velocity += s * (other.angular_velocity - state.angular_velocity);
  state.orientation = Eigen::Quaterniond(state.orientation)
                          .slerp(s, Eigen::Quaterniond(other.orientation))
                          .toRotationMatrix();
}

struct Rows {
  const SensorSuite& suite;
  // A bridged frame's accelerations of hinges would be derivatives over a gap.
  void drop_hinges(Vector& y) const {
    for (Index s = 0; s < suite.size(); ++s) {
      if (suite.sensor(s).kind == BodySensorKind::kJointAcceleration) y[suite.row(s)] = kNaN;
    }
  }
};

void size_results(BodyTorques& out, const SensorSuite& suite, Index frames,
                  const KeepOptions& keep) {
  const Index n = suite.body().dofs();
  const Index wrenches = 6 * suite.body().size();
  out.torque.resize(frames, n);
  out.joint_acceleration.resize(frames, n);
  out.residual.resize(frames, 6);
  out.residual_deviation.resize(frames, 6);
  out.balance_nis.resize(frames);
  out.motion_nis.resize(frames);
  out.bridged.assign(static_cast<std::size_t>(frames), 0);
  if (keep.deviations) {
    out.torque_deviation.resize(frames, n);
    out.motion_freedom.resize(frames);
    out.innovation.resize(frames, suite.rows());
    out.innovation_deviation.resize(frames, suite.rows());
  }
  if (keep.wrenches) {
    out.external.resize(frames, wrenches);
    out.joint_wrench.resize(frames, wrenches);
    if (keep.deviations) {
      out.external_deviation.resize(frames, wrenches);
      out.joint_wrench_deviation.resize(frames, wrenches);
    }
  }
}

Eigen::Map<const Eigen::RowVectorXd> flat(const Matrix& m) { return {m.data(), m.size()}; }

void store(const TorqueFrame& f, Index i, const KeepOptions& keep, BodyTorques& out) {
  out.torque.row(i) = f.torque.transpose();
  out.joint_acceleration.row(i) = f.joint_acceleration.transpose();
  out.residual.row(i) = f.residual.transpose();
  out.residual_deviation.row(i) = f.residual_covariance.diagonal().cwiseSqrt().transpose();
  out.balance_nis[i] = f.balance_nis;
  out.motion_nis[i] = f.motion_nis;
  if (keep.wrenches) {
    out.external.row(i) = flat(f.external);
    out.joint_wrench.row(i) = flat(f.joint_wrench);
  }
  if (!keep.deviations) return;
  out.torque_deviation.row(i) = f.torque_deviation.transpose();
  out.motion_freedom[i] = f.motion_freedom;
  out.innovation.row(i) = f.innovation.transpose();
  out.innovation_deviation.row(i) = f.innovation_deviation.transpose();
  if (!keep.wrenches) return;
  out.external_deviation.row(i) = flat(f.external_deviation);
  out.joint_wrench_deviation.row(i) = flat(f.joint_wrench_deviation);
}

}  // namespace

void state_of(const BodyRecording& r, Index frame, BodyState& state) {
  state.angle = r.angle.row(frame).transpose();
  state.rate = r.rate.row(frame).transpose();
  state.position.setZero();
  state.orientation.setIdentity();
  state.angular_velocity.setZero();
  if (r.position.size() > 0) state.position = r.position.row(frame).transpose();
  if (r.angular_velocity.size() > 0) {
    state.angular_velocity = r.angular_velocity.row(frame).transpose();
  }
  if (r.orientation.size() == 0) return;
  const auto q = r.orientation.row(frame);
  state.orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

void check_recording(const SensorSuite& suite, const BodyRecording& r) {
  const Index frames = r.frames();
  const Index n = suite.body().dofs();
  check_shape(r.angle, frames, n, "angle", false);
  check_shape(r.rate, frames, n, "rate", false);
  check_shape(r.measured, frames, suite.rows(), "measured", suite.rows() == 0);
  check_shape(r.position, frames, 3, "position", true);
  check_shape(r.orientation, frames, 4, "orientation", true);
  check_shape(r.angular_velocity, frames, 3, "angular_velocity", true);
  for (Index i = 0; r.orientation.size() > 0 && i < frames; ++i) {
    const double norm = r.orientation.row(i).norm();
    // Quaternions of files have as few as three digits.
    if (!std::isfinite(norm) || std::fabs(norm - 1.0) < 1e-2) continue;
    throw Error(Fault::kData, "orientation",
                sentence(6, "the orientation of frame ", i, " has length ", norm,
                         "; a unit quaternion w x y z is needed"),
                "frame " + std::to_string(i));
  }
}

namespace {

// All frames in chunks, each with a solver of its own: use(solver, state, y, frame, chunk).
template <class Make, class Use>
void for_each_frame(const SensorSuite& suite, const BodyRecording& recording,
                    const std::vector<Between>& states, int threads, Token* token, Make make,
                    Use use) {
  const Index frames = recording.frames();
  const Rows rows{suite};
  parallel_for((frames + kChunk - 1) / kChunk, threads,
               [&](std::ptrdiff_t chunk) {
                 auto solver = make();
                 BodyState state, other;
                 Vector y(suite.rows());
                 for (Index i = chunk * kChunk; i < std::min<Index>(frames, (chunk + 1) * kChunk);
                      ++i) {
                   const Between& at = states[static_cast<std::size_t>(i)];
                   if (suite.rows() > 0) y = recording.measured.row(i).transpose();
                   if (at.before < 0) {
                     state_of(recording, i, state);
                   } else {
                     blend(recording, i, at, state, other);
                     if (at.after != at.before) rows.drop_hinges(y);
                   }
                   use(solver, state, y, i, static_cast<std::size_t>(chunk));
                 }
               },
               token);
}

void count_bridges(const std::vector<Between>& states, BodyTorques& out) {
  for (std::size_t i = 0; i < states.size(); ++i) {
    out.bridged[i] = states[i].before != states[i].after ? 1 : 0;
    out.unusable += states[i].before < 0 ? 1 : 0;
  }
}

void check_call(const SensorSuite& suite, const BodyRecording& recording, Index longest_gap) {
  require(longest_gap >= 0, "longest_gap", "the longest gap must not be negative");
  check_recording(suite, recording);
}

}  // namespace

BodyTorques estimate_recording(std::shared_ptr<const SensorSuite> suite,
                               const BodyRecording& recording, const TorqueOptions& options,
                               const KeepOptions& keep, Index longest_gap, Token* token) {
  check_call(*suite, recording, longest_gap);
  static_cast<void>(TorqueEstimator(suite, options));  // refuses options before the work
  const Index frames = recording.frames();
  BodyTorques out;
  size_results(out, *suite, frames, keep);
  const std::vector<Between> states = find_states(recording, longest_gap);
  count_bridges(states, out);
  std::vector<double> likelihood(static_cast<std::size_t>((frames + kChunk - 1) / kChunk), 0.0);
  for_each_frame(
      *suite, recording, states, keep.threads, token,
      [&] { return TorqueEstimator(suite, options); },
      [&](TorqueEstimator& estimator, const BodyState& state, const Vector& y, Index i,
          std::size_t chunk) {
        const TorqueFrame& f = estimator.update(state, y, keep.deviations);
        if (f.usable) likelihood[chunk] += f.log_likelihood;
        store(f, i, keep, out);
      });
  for (const double l : likelihood) out.log_likelihood += l;
  return out;
}

BodyTorques estimate_uncertain(std::shared_ptr<const SensorSuite> suite,
                               const BodyRecording& recording, const ModelDeviation& model,
                               const KeepOptions& keep, Index longest_gap, Token* token) {
  check_call(*suite, recording, longest_gap);
  static_cast<void>(MapEstimator(suite, model));
  BodyTorques out;
  const Index frames = recording.frames();
  const Index n = suite->body().dofs();
  const Index wrenches = keep.wrenches ? 6 * suite->body().size() : 0;
  out.torque.resize(frames, n);
  out.joint_acceleration.resize(frames, n);
  out.external.resize(keep.wrenches ? frames : 0, wrenches);
  out.joint_wrench.resize(keep.wrenches ? frames : 0, wrenches);
  out.bridged.assign(static_cast<std::size_t>(frames), 0);
  out.log_likelihood = kNaN;
  const std::vector<Between> states = find_states(recording, longest_gap);
  count_bridges(states, out);
  for_each_frame(
      *suite, recording, states, keep.threads, token, [&] { return MapEstimator(suite, model); },
      [&](MapEstimator& estimator, const BodyState& state, const Vector& y, Index i, std::size_t) {
        const MapFrame& f = estimator.update(state, y);
        out.torque.row(i) = f.torque.transpose();
        out.joint_acceleration.row(i) = f.joint_acceleration.transpose();
        if (!keep.wrenches) return;
        out.external.row(i) = flat(f.external);
        out.joint_wrench.row(i) = flat(f.joint_wrench);
      });
  return out;
}

}  // namespace ulna
