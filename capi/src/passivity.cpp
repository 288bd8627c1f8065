#include <ulna/passivity.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "guard.hpp"
#include "handles.hpp"
#include "passivity/verdict.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

VerdictOptions verdict_options(const ulna_passivity_options* given) {
  const ulna_passivity_options o = read_options(given, "options");
  VerdictOptions out;
  // A negative value asks for the zero that a default of zero bytes cannot say.
  const auto set = [](double value, double& field) {
    if (value != 0.0) field = std::max(value, 0.0);
  };
  set(o.antisymmetry_threshold, out.antisymmetry_threshold);
  set(o.level, out.level);
  set(o.min_share, out.min_share);
  set(o.block_s, out.block_s);
  if (o.bootstrap != 0) out.bootstrap = o.bootstrap;
  require(out.bootstrap >= 50, "bootstrap", "at least 50 resamples are needed for an interval");
  out.seed = static_cast<std::uint64_t>(o.seed);
  return out;
}

int32_t verdict_constant(Answer answer) {
  switch (answer) {
    case Answer::kPassive:
      return ULNA_VERDICT_PASSIVE;
    case Answer::kNotPassive:
      return ULNA_VERDICT_NOT_PASSIVE;
    case Answer::kUndecided:
      break;
  }
  return ULNA_VERDICT_UNDECIDED;
}

ulna_passivity_margins margins_struct(const ModelMargins& m) {
  ulna_passivity_margins out = {};
  out.m_min = m.m_min;
  out.b_min = m.b_min;
  out.k_min = m.k_min;
  out.excess = m.excess;
  out.antisymmetry_m = m.antisymmetry_m;
  out.antisymmetry_k = m.antisymmetry_k;
  out.m_symmetric = m.m_symmetric ? 1 : 0;
  out.k_symmetric = m.k_symmetric ? 1 : 0;
  out.verdict = verdict_constant(m.answer);
  return out;
}

ulna_passivity_info verdict_struct(const Verdict& v) {
  ulna_passivity_info out = {};
  out.verdict = verdict_constant(v.answer);
  out.approach = v.approach == Approach::kModel ? ULNA_APPROACH_MODEL : ULNA_APPROACH_ENERGY;
  out.probability = v.probability;
  out.model_probability = v.model_probability;
  out.energy_probability = v.energy_probability;
  out.excess = v.model.b_min;
  std::copy_n(v.excess_interval, 2, out.excess_interval);
  std::copy_n(v.m_min_interval, 2, out.m_min_interval);
  std::copy_n(v.k_min_interval, 2, out.k_min_interval);
  out.energy_index = v.energy.delta;
  out.energy_index_time_s = v.energy.time_s;
  std::copy_n(v.energy_interval, 2, out.energy_interval);
  out.beta_j = v.beta_j;
  out.trials = static_cast<int64_t>(v.series.size());
  return out;
}

}  // namespace

ulna_status ulna_passivity_assess(const ulna_impedance* impedance,
                                  const ulna_passivity_options* options, ulna_token* token,
                                  ulna_passivity** out_passivity) {
  return guarded([&] {
    ulna_passivity*& out = deref(out_passivity, "out_passivity");
    auto handle = std::make_unique<ulna_passivity>(ulna_passivity{assess_passivity(
        deref(impedance, "impedance").estimate, verdict_options(options), token_of(token))});
    out = handle.release();
  });
}

void ulna_passivity_free(ulna_passivity* passivity) { delete passivity; }

ulna_status ulna_passivity_get_info(const ulna_passivity* passivity,
                                    ulna_passivity_info* out_info) {
  return guarded([&] {
    write_result(out_info, verdict_struct(deref(passivity, "passivity").verdict), "out_info");
  });
}

ulna_status ulna_passivity_get_margins(const ulna_passivity* passivity,
                                       ulna_passivity_margins* out_margins) {
  return guarded([&] {
    write_result(out_margins, margins_struct(deref(passivity, "passivity").verdict.model),
                 "out_margins");
  });
}

ulna_status ulna_passivity_get_text(const ulna_passivity* passivity, int32_t which, char* out_text,
                                    int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const Verdict& v = deref(passivity, "passivity").verdict;
    require(which == ULNA_PASSIVITY_TEXT_REASON || which == ULNA_PASSIVITY_TEXT_WOULD_CHANGE,
            "which", "which must be an ULNA_PASSIVITY_TEXT_ constant");
    write_text(which == ULNA_PASSIVITY_TEXT_REASON ? v.reason : v.would_change, out_text, capacity,
               out_size);
  });
}

ulna_status ulna_passivity_get_series(const ulna_passivity* passivity, int64_t trial,
                                      int32_t series, double* out, int64_t capacity,
                                      int64_t* out_count) {
  return guarded([&] {
    const Verdict& v = deref(passivity, "passivity").verdict;
    const auto trials = static_cast<int64_t>(v.series.size());
    require(trial >= 0 && trial < trials, "trial",
            "trial must be from 0 to " + std::to_string(trials - 1));
    const EnergySeries& s = v.series[static_cast<std::size_t>(trial)];
    const Vector* const values[] = {&s.time_s, &s.energy_j, &s.dissipation};
    require(series >= ULNA_ENERGY_TIME && series <= ULNA_ENERGY_MOTION, "series",
            "series must be an ULNA_ENERGY_ constant");
    write_array(values[series]->data(), values[series]->size(), out, capacity, out_count);
  });
}

ulna_status ulna_passivity_of_model(const ulna_view* m, const ulna_view* b, const ulna_view* k,
                                    const ulna_passivity_options* options,
                                    ulna_passivity_margins* out_margins) {
  return guarded([&] {
    const Matrix inertia = map_view(m, "m");
    require(inertia.rows() <= 6, "m", "matrices of at most 6 axes are judged");
    const ModelMargins margins = model_passivity(inertia, map_view(b, "b"), map_view(k, "k"),
                                                 verdict_options(options).antisymmetry_threshold);
    write_result(out_margins, margins_struct(margins), "out_margins");
  });
}

ulna_status ulna_passivity_of_energy(const ulna_view* force, const ulna_view* velocity,
                                     double rate_hz, double beta_j,
                                     const ulna_passivity_options* options, double* out_index,
                                     double* out_time_s, double* out_energy, int64_t capacity,
                                     int64_t* out_count) {
  return guarded([&] {
    const Matrix f = map_view(force, "force");
    const Matrix v = map_view(velocity, "velocity");
    require(f.allFinite() && v.allFinite(), "force", "force and velocity must hold finite numbers");
    require(beta_j <= 0.0, "beta_j", "beta_j must be minus a stored energy, at most 0");
    double& index_out = deref(out_index, "out_index");
    double& time_out = deref(out_time_s, "out_time_s");
    const EnergySeries series = absorbed_energy(f, v, rate_hz);
    const EnergyIndex index = energy_index(series, beta_j, verdict_options(options).min_share);
    write_array(series.energy_j.data(), series.energy_j.size(), out_energy, capacity, out_count);
    index_out = index.delta;
    time_out = index.time_s;
  });
}
