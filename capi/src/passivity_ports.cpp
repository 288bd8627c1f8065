// Indices of systems, two-ports and teleoperation: the second part of passivity.h.
#include <ulna/passivity.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "guard.hpp"
#include "handles.hpp"
#include "passivity/indices.hpp"
#include "passivity/teleoperation.hpp"
#include "passivity/two_port.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Vector vector_of(const ulna_view* view, const char* argument) {
  const StridedMap map = map_view(view, argument);
  require(map.cols() == 1 || map.rows() == 1, argument,
          std::string(argument) + " must be a vector");
  return map.cols() == 1 ? Vector(map.col(0)) : Vector(map.row(0).transpose());
}

// A negative value asks for the zero that a default of zero bytes cannot say.
double tolerance_of(double given) { return given == 0.0 ? 1e-9 : std::max(given, 0.0); }

std::optional<Band> band_of(double low, double high) {
  if (high == 0.0 && low == 0.0) return std::nullopt;
  return Band{low, high};
}

IndexOptions index_options(const ulna_port_options* given) {
  const ulna_port_options o = read_options(given, "options");
  IndexOptions out;
  out.band = band_of(o.band_low_rad_s, o.band_high_rad_s);
  out.tolerance = tolerance_of(o.tolerance);
  if (o.direction == nullptr) return out;
  out.direction = vector_of(o.direction, "direction");
  require(out.direction.size() > 0, "direction", "the direction is empty");
  return out;
}

TwoPortOptions two_port_options(const ulna_two_port_options* given) {
  const ulna_two_port_options o = read_options(given, "options");
  TwoPortOptions out;
  out.shortage = o.shortage;
  out.port = o.port == 0 ? 2 : o.port;
  out.band = band_of(o.band_low_rad_s, o.band_high_rad_s);
  out.tolerance = tolerance_of(o.tolerance);
  return out;
}

int32_t verdict_constant(Answer answer) {
  if (answer == Answer::kPassive) return ULNA_VERDICT_PASSIVE;
  return answer == Answer::kNotPassive ? ULNA_VERDICT_NOT_PASSIVE : ULNA_VERDICT_UNDECIDED;
}

template <std::size_t size>
void copy_words(const std::string& words, char (&out)[size]) {
  const std::size_t count = std::min(words.size(), size - 1);
  std::memcpy(out, words.data(), count);
}

ulna_port_indices indices_struct(const PassivityIndices& i) {
  ulna_port_indices out = {};
  out.verdict = verdict_constant(i.answer);
  out.input = i.input.value;
  out.input_frequency_rad_s = i.input.omega;
  out.output = i.output.value;
  out.output_frequency_rad_s = i.output.omega;
  out.relative = i.relative.value;
  out.relative_frequency_rad_s = i.relative.omega;
  copy_words(i.reason, out.reason);
  copy_words(i.notes, out.notes);
  return out;
}

ulna_two_port_stability stability_struct(const TwoPortStability& s) {
  ulna_two_port_stability out = {};
  out.verdict = verdict_constant(s.answer);
  out.margin = s.margin.value;
  out.margin_frequency_rad_s = s.margin.omega;
  out.shortage = s.shortage.value;
  out.shortage_frequency_rad_s = s.shortage.omega;
  out.opposite = s.opposite.value;
  out.opposite_frequency_rad_s = s.opposite.omega;
  out.own_real = s.own_real.value;
  out.own_real_frequency_rad_s = s.own_real.omega;
  out.far_real = s.far_real.value;
  out.far_real_frequency_rad_s = s.far_real.omega;
  copy_words(s.reason, out.reason);
  return out;
}

void write_rows(const Matrix& m, double* out, int64_t capacity, int64_t* out_count) {
  const RowMajor rows = m;
  write_array(rows.data(), rows.size(), out, capacity, out_count);
}

}  // namespace

ulna_status ulna_passivity_of_system(const ulna_system* system, const ulna_port_options* options,
                                     ulna_port_indices* out_indices) {
  return guarded([&] {
    const System& s = deref(system, "system").system;
    write_result(out_indices, indices_struct(passivity_indices(s, index_options(options))),
                 "out_indices");
  });
}

ulna_status ulna_passivity_curves(const ulna_system* system, const ulna_port_options* options,
                                  const ulna_view* omega_rad_s, double* out, int64_t capacity,
                                  int64_t* out_count) {
  return guarded([&] {
    const System& s = deref(system, "system").system;
    const Vector omega = vector_of(omega_rad_s, "omega_rad_s");
    write_rows(index_curves(s, omega, index_options(options)), out, capacity, out_count);
  });
}

ulna_status ulna_two_port_assess(const ulna_system* system, const ulna_two_port_options* options,
                                 ulna_two_port_stability* out_stability) {
  return guarded([&] {
    const System& s = deref(system, "system").system;
    write_result(out_stability, stability_struct(two_port_stability(s, two_port_options(options))),
                 "out_stability");
  });
}

ulna_status ulna_two_port_curves(const ulna_system* system, const ulna_two_port_options* options,
                                 const ulna_view* omega_rad_s, double* out, int64_t capacity,
                                 int64_t* out_count) {
  return guarded([&] {
    const System& s = deref(system, "system").system;
    const Vector omega = vector_of(omega_rad_s, "omega_rad_s");
    write_rows(two_port_curves(s, omega, two_port_options(options)), out, capacity, out_count);
  });
}

ulna_status ulna_teleoperation_gain(const ulna_position_force* loop, double excess_n_s_m,
                                    const ulna_view* delay_s, double* out, int64_t capacity,
                                    int64_t* out_count) {
  return guarded([&] {
    deref(loop, "loop");
    const ulna_position_force o = read_options(loop, "loop");
    const Vector gain = allowed_gain({o.master_damping_n_s_m, o.slave_damping_n_s_m,
                                      o.coupling_damping_n_s_m, o.coupling_stiffness_n_m},
                                     excess_n_s_m, vector_of(delay_s, "delay_s"));
    write_array(gain.data(), gain.size(), out, capacity, out_count);
  });
}

ulna_status ulna_teleoperation_stiffness(double device_damping_n_s_m, double wall_damping_n_s_m,
                                         double excess_n_s_m, const ulna_view* delay_s, double* out,
                                         int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Vector stiffness = allowed_stiffness(device_damping_n_s_m, wall_damping_n_s_m,
                                               excess_n_s_m, vector_of(delay_s, "delay_s"));
    write_array(stiffness.data(), stiffness.size(), out, capacity, out_count);
  });
}
