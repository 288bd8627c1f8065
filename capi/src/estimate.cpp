#include <ulna/estimate.h>

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <utility>

#include "arguments.hpp"
#include "body.hpp"
#include "estimate/identifiability.hpp"
#include "estimate/sensor_variances.hpp"
#include "guard.hpp"
#include "handles.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

const std::shared_ptr<const SensorSuite>& suite_of(const ulna_sensors* handle) {
  return deref(handle, "sensors").suite;
}

BodySensor sensor_of(const VectorRef& v, const std::string& name, const BodyTree& body) {
  const auto whole = [&](double value, Index count, const char* what) {
    require(value >= 0.0 && value < static_cast<double>(count) && value == std::floor(value),
            "sensors", "sensor '" + name + "' has a " + what + " that there is not");
    return static_cast<Index>(value);
  };
  BodySensor sensor;
  sensor.name = name;
  sensor.kind = static_cast<BodySensorKind>(whole(v[0], 9, "kind"));
  sensor.link = whole(v[1], body.size(), "link");
  sensor.frame = static_cast<SensorFrame>(whole(v[2], 3, "frame"));
  sensor.position = v.segment<3>(3);
  sensor.orientation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(v.data() + 6);
  Index count = 0;
  while (count < 6 && !std::isnan(v[15 + count])) ++count;
  sensor.deviation = v.segment(15, count);
  return sensor;
}

BodyPrior prior_of(const ulna_prior_options* options) {
  const ulna_prior_options o = read_options(options, "prior");
  BodyPrior p;
  p.base_acceleration = or_default(o.base_acceleration_m_s2, p.base_acceleration);
  p.base_angular_acceleration =
      or_default(o.base_angular_acceleration_rad_s2, p.base_angular_acceleration);
  p.joint_acceleration = or_default(o.joint_acceleration_rad_s2, p.joint_acceleration);
  p.force = or_default(o.force_n, p.force);
  p.moment = or_default(o.moment_nm, p.moment);
  p.untouched_force = or_default(o.untouched_force_n, p.untouched_force);
  p.untouched_moment = or_default(o.untouched_moment_nm, p.untouched_moment);
  return p;
}

struct Options {
  bool sparse = false;
  bool means_only = false;
  Index longest_gap = 12;
  TorqueOptions torque;
  ModelDeviation model;
  KeepOptions keep;
};

Options options_of(const ulna_torque_options* options) {
  const ulna_torque_options o = read_options(options, "options");
  Options r;
  r.sparse = kind_of<int>(o.solver, 2, "solver") == ULNA_SOLVER_SPARSE;
  r.torque.scheme = flag(o.stack, "stack") ? TorqueScheme::kStack : TorqueScheme::kOneShot;
  require(!r.sparse || r.torque.scheme == TorqueScheme::kOneShot, "stack",
          "the stack of tasks is for the closed form");
  r.torque.momentum_rate_force = or_default(o.momentum_rate_force_n, 1.0);
  r.torque.momentum_rate_moment = or_default(o.momentum_rate_moment_nm, 1.0);
  r.model = {or_none(o.model_force_n, r.model.force), or_none(o.model_moment_nm, r.model.moment),
             or_none(o.model_acceleration_m_s2, r.model.linear_acceleration),
             or_none(o.model_acceleration_rad_s2, r.model.angular_acceleration)};
  r.keep.deviations = !flag(o.means_only, "means_only");
  r.keep.wrenches = flag(o.wrenches, "wrenches");
  require(o.threads >= 0, "threads", "threads must not be negative");
  r.keep.threads = o.threads;
  require(o.longest_gap >= 0, "longest_gap", "the longest gap must not be negative");
  if (o.longest_gap > 0) r.longest_gap = o.longest_gap;
  if (flag(o.no_bridges, "no_bridges")) r.longest_gap = 0;
  return r;
}

BodyRecording recording_of(const ulna_body_motion* motion, const ulna_view* measured,
                           const SensorSuite& suite) {
  BodyFrames frames = read_motion(motion, suite.body(), false);
  BodyRecording r;
  r.measured = map_view(measured, "measured");
  r.angle = std::move(frames.angle);
  r.rate = std::move(frames.rate);
  r.position = std::move(frames.position);
  r.orientation = std::move(frames.orientation);
  r.angular_velocity = std::move(frames.angular_velocity);
  return r;
}

// An array of a result as rows; the tests of a frame are put side by side.
RowMajor array_of(const BodyTorques& t, int which) {
  switch (which) {
    case ULNA_TORQUES_TORQUE:
      return t.torque;
    case ULNA_TORQUES_TORQUE_DEVIATION:
      return t.torque_deviation;
    case ULNA_TORQUES_ACCELERATION:
      return t.joint_acceleration;
    case ULNA_TORQUES_RESIDUAL:
      return t.residual;
    case ULNA_TORQUES_RESIDUAL_DEVIATION:
      return t.residual_deviation;
    case ULNA_TORQUES_INNOVATION:
      return t.innovation;
    case ULNA_TORQUES_INNOVATION_DEVIATION:
      return t.innovation_deviation;
    case ULNA_TORQUES_EXTERNAL:
      return t.external;
    case ULNA_TORQUES_EXTERNAL_DEVIATION:
      return t.external_deviation;
    case ULNA_TORQUES_JOINT_WRENCH:
      return t.joint_wrench;
    case ULNA_TORQUES_JOINT_WRENCH_DEVIATION:
      return t.joint_wrench_deviation;
    default:
      break;
  }
  RowMajor tests = RowMajor::Constant(t.torque.rows(), 4, std::nan(""));
  for (Index i = 0; i < tests.rows(); ++i) {
    if (t.balance_nis.size() > 0) tests.row(i).head(2) << t.balance_nis[i], t.motion_nis[i];
    if (t.motion_freedom.size() > 0) tests(i, 2) = t.motion_freedom[i];
    tests(i, 3) = t.bridged[static_cast<std::size_t>(i)] != 0 ? 1.0 : 0.0;
  }
  return tests;
}

VarianceOptions variances_of(const ulna_variance_options* options) {
  const ulna_variance_options o = read_options(options, "options");
  VarianceOptions v;
  if (o.groups != nullptr) {
    for (const double g : entries_of(o.groups, "groups")) {
      require(std::isfinite(g) && g == std::floor(g) && std::fabs(g) < 1e9, "groups",
              "groups must be whole numbers");
      v.groups.push_back(static_cast<Index>(g));
    }
  }
  require(o.steps >= 0 && o.frames >= 0 && o.threads >= 0, "options",
          "steps, frames and threads must not be negative");
  if (o.steps > 0) v.steps = o.steps;
  if (o.frames > 0) v.frames = o.frames;
  v.tolerance = or_default(o.tolerance, v.tolerance);
  v.least = or_default(o.least, v.least);
  v.threads = o.threads;
  return v;
}

}  // namespace

ulna_status ulna_sensors_new(const ulna_body* body, const ulna_view* sensors,
                             const char* const* names, int64_t name_count,
                             const ulna_prior_options* prior, ulna_sensors** out_sensors) {
  return guarded([&] {
    auto& place = deref(out_sensors, "out_sensors");
    const auto& tree = deref(body, "body").tree;
    const Matrix values = map_view(sensors, "sensors");
    require(values.rows() == 0 || values.cols() == ULNA_SENSOR_VALUES, "sensors",
            "sensors must have " + std::to_string(ULNA_SENSOR_VALUES) + " columns");
    const auto all = name_list(names, name_count, "names");
    require(static_cast<Index>(all.size()) == values.rows(), "names", "there must be a name each");
    std::vector<BodySensor> made;
    for (Index i = 0; i < values.rows(); ++i) {
      const Vector row = values.row(i).transpose();
      made.push_back(sensor_of(row, all[static_cast<std::size_t>(i)], *tree));
    }
    place = new ulna_sensors{
        std::make_shared<const SensorSuite>(tree, std::move(made), prior_of(prior))};
  });
}

void ulna_sensors_free(ulna_sensors* sensors) { delete sensors; }

ulna_status ulna_sensors_row_names(const ulna_sensors* sensors, char* out_text, int64_t capacity,
                                   int64_t* out_size) {
  return guarded([&] {
    std::string text;
    for (const std::string& name : suite_of(sensors)->row_names()) {
      text += (text.empty() ? "" : "\n") + name;
    }
    write_text(text, out_text, capacity, out_size);
  });
}

ulna_status ulna_sensors_deviations(const ulna_sensors* sensors, double* out, int64_t capacity,
                                    int64_t* out_count) {
  return guarded([&] {
    const Vector d = suite_of(sensors)->deviations();
    write_array(d.data(), d.size(), out, capacity, out_count);
  });
}

ulna_status ulna_sensors_with_deviations(const ulna_sensors* sensors, const ulna_view* deviation,
                                         ulna_sensors** out_sensors) {
  return guarded([&] {
    auto& place = deref(out_sensors, "out_sensors");
    place = new ulna_sensors{std::make_shared<const SensorSuite>(
        suite_of(sensors)->with_deviations(entries_of(deviation, "deviation")))};
  });
}

ulna_status ulna_sensors_fit(const ulna_sensors* sensors, const ulna_body_motion* motion,
                             const ulna_view* measured, const ulna_variance_options* options,
                             ulna_token* token, double* out_log_likelihood, int32_t* out_converged,
                             double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const SensorSuite& suite = *suite_of(sensors);
    double& likelihood = deref(out_log_likelihood, "out_log_likelihood");
    int32_t& converged = deref(out_converged, "out_converged");
    if (out == nullptr && capacity == 0) {  // not twice the work for a count
      deref(out_count, "out_count") = 2 * suite.rows();
      return;
    }
    const SensorVariances v = sensor_variances(suite, recording_of(motion, measured, suite),
                                               variances_of(options), token_of(token));
    RowMajor rows(suite.rows(), 2);
    rows << v.deviation, v.freedom;
    write_array(rows.data(), rows.size(), out, capacity, out_count);
    likelihood = v.log_likelihood.back();
    converged = v.converged ? 1 : 0;
  });
}

ulna_status ulna_sensors_identify(const ulna_sensors* sensors, const ulna_body_motion* motion,
                                  const ulna_view* measured, ulna_identifiability* out_result,
                                  char* out_text, int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const SensorSuite& suite = *suite_of(sensors);
    deref(out_result, "out_result");
    const BodyFrames frames = read_motion(motion, suite.body(), true);
    require(frames.frames() > 0, "angle", "the motion has no frames");
    Vector y;
    if (measured != nullptr) y = entries_of(measured, "measured");
    const Identifiability f = identifiability(suite, frames.state(0), y);
    // Both outputs or none: the text's room is known before the result is written.
    int64_t size = 0;
    write_text(f.words, nullptr, 0, &size);
    deref(out_size, "out_size");
    const bool asks = out_text == nullptr && capacity == 0;
    if (asks || (out_text != nullptr && capacity >= size)) {
      write_result(out_result,
                   ulna_identifiability{0, f.wrench_unknowns, f.wrench_rank, f.force_unknowns,
                                        f.force_rank, f.motion_unknowns, f.motion_rank},
                   "out_result");
    }
    write_text(f.words, out_text, capacity, out_size);
  });
}

ulna_status ulna_torques_estimate(const ulna_sensors* sensors, const ulna_body_motion* motion,
                                  const ulna_view* measured, const ulna_torque_options* options,
                                  ulna_token* token, ulna_torques** out_torques) {
  return guarded([&] {
    auto& place = deref(out_torques, "out_torques");
    const auto& suite = suite_of(sensors);
    const Options o = options_of(options);
    const BodyRecording r = recording_of(motion, measured, *suite);
    place = new ulna_torques{
        o.sparse ? estimate_uncertain(suite, r, o.model, o.keep, o.longest_gap, token_of(token))
                 : estimate_recording(suite, r, o.torque, o.keep, o.longest_gap, token_of(token))};
  });
}

void ulna_torques_free(ulna_torques* torques) { delete torques; }

ulna_status ulna_torques_summarise(const ulna_torques* torques, ulna_torques_summary* out_summary) {
  return guarded([&] {
    const BodyTorques& t = deref(torques, "torques").torques;
    ulna_torques_summary s{};
    s.frames = t.torque.rows();
    s.unusable = t.unusable;
    for (const char b : t.bridged) s.bridged += b != 0 ? 1 : 0;
    s.log_likelihood = t.log_likelihood;
    write_result(out_summary, s, "out_summary");
  });
}

ulna_status ulna_torques_array(const ulna_torques* torques, int32_t which, double* out,
                               int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const BodyTorques& t = deref(torques, "torques").torques;
    const RowMajor rows = array_of(t, kind_of<int>(which, 12, "which"));
    write_array(rows.data(), rows.size(), out, capacity, out_count);
  });
}

ulna_status ulna_torque_stream_new(const ulna_sensors* sensors, const ulna_torque_options* options,
                                   ulna_torque_stream** out_stream) {
  return guarded([&] {
    auto& place = deref(out_stream, "out_stream");
    const auto& suite = suite_of(sensors);
    const Options o = options_of(options);
    auto stream = std::make_unique<ulna_torque_stream>();
    if (o.sparse) {
      stream->sparse = std::make_unique<MapEstimator>(suite, o.model);
    } else {
      stream->closed = std::make_unique<TorqueEstimator>(suite, o.torque);
    }
    stream->state.angle = stream->state.rate = Vector::Zero(suite->body().dofs());
    stream->measured = Vector::Zero(suite->rows());
    place = stream.release();
  });
}

void ulna_torque_stream_free(ulna_torque_stream* stream) { delete stream; }

namespace {

void set_state(ulna_torque_stream& s, const double* base, const double* angle, const double* rate,
               const double* measured) {
  s.state.position = Eigen::Map<const Vector3>(base);
  const Eigen::Quaterniond q(base[3], base[4], base[5], base[6]);
  s.state.orientation = q.normalized().toRotationMatrix();
  s.state.angular_velocity = Eigen::Map<const Vector3>(base + 7);
  s.state.angle = Eigen::Map<const Vector>(angle, s.state.angle.size());
  s.state.rate = Eigen::Map<const Vector>(rate, s.state.rate.size());
  s.measured = Eigen::Map<const Vector>(measured, s.measured.size());
}

void write_or_nan(const double* values, Index count, double* out) {
  if (out == nullptr) return;
  for (Index k = 0; k < count; ++k) out[k] = values == nullptr ? std::nan("") : values[k];
}

}  // namespace

ulna_status ulna_torque_stream_update(ulna_torque_stream* stream, const double* base,
                                      const double* angle, const double* rate,
                                      const double* measured, double* out_torque,
                                      double* out_deviation, double* out_residual) {
  return guarded([&] {
    ulna_torque_stream& s = deref(stream, "stream");
    const Index n = s.state.angle.size();
    deref(out_torque, "out_torque");
    set_state(s, &deref(base, "base"), &deref(angle, "angle"), &deref(rate, "rate"),
              &deref(measured, "measured"));
    if (s.sparse != nullptr) {
      write_or_nan(s.sparse->update(s.state, s.measured).torque.data(), n, out_torque);
      write_or_nan(nullptr, n, out_deviation);
      write_or_nan(nullptr, 6, out_residual);
      return;
    }
    const TorqueFrame& f = s.closed->update(s.state, s.measured, out_deviation != nullptr);
    write_or_nan(f.torque.data(), n, out_torque);
    write_or_nan(f.torque_deviation.data(), n, out_deviation);
    write_or_nan(f.residual.data(), 6, out_residual);
  });
}
