#include <ulna/signal.h>

#include <algorithm>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "signal/butterworth.hpp"
#include "signal/finite.hpp"
#include "signal/resample.hpp"
#include "signal/response.hpp"
#include "signal/savgol.hpp"
#include "signal/spectrum.hpp"
#include "signal/zero_phase.hpp"

namespace ulna::capi {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr Index kDefaultSegment = 1024;

StridedMap map_vector(const ulna_view* view, const char* argument) {
  const StridedMap map = map_view(view, argument);
  require(map.cols() == 1, argument, std::string(argument) + " must have one column");
  return map;
}

Sos sos_of(const ulna_view* view) {
  Sos sos{Matrix(map_view(view, "sos"))};
  check_sos(sos);
  return sos;
}

// Answers a question for the count, or refuses a buffer that is too small, before any work is done.
bool only_count(int64_t count, const void* out, int64_t capacity, int64_t* out_count) {
  deref(out_count, "out_count");
  if (out != nullptr && capacity >= count) return false;
  if (out == nullptr && capacity == 0) {
    *out_count = count;
    return true;
  }
  deref(static_cast<const char*>(out), "out");
  throw Error(Fault::kBuffer, "capacity",
              "the buffer holds " + std::to_string(capacity) + " values, " + std::to_string(count) +
                  " are needed");
}

void write_matrix(const Matrix& m, double* out, int64_t capacity, int64_t* out_count) {
  write_array(m.data(), m.size(), out, capacity, out_count);
}

ZeroPhase zero_phase_of(const ulna_zero_phase_options* options) {
  const ulna_zero_phase_options o = read_options(options, "options");
  require(o.pad == ULNA_PAD_POLE_RADIUS || o.pad == ULNA_PAD_SCIPY, "pad",
          "pad is " + std::to_string(o.pad) + ": it must be 0 (pole radius) or 1 (as SciPy)");
  ZeroPhase result;
  result.pad = o.pad == ULNA_PAD_SCIPY ? Pad::kScipy : Pad::kPoleRadius;
  if (o.epsilon != 0.0) result.epsilon = o.epsilon;
  return result;
}

struct SpectrumPlan {
  Index segment;
  std::vector<RowRange> ranges;
  double confidence;
};

SpectrumPlan plan_of(const ulna_spectrum_options* options, Index rows) {
  const ulna_spectrum_options o = read_options(options, "options");
  SpectrumPlan plan{o.segment == 0 ? std::min(kDefaultSegment, rows) : o.segment, {}, 0.95};
  if (o.confidence != 0.0) plan.confidence = o.confidence;
  require(plan.segment <= rows || o.segment == 0, "segment",
          "the segment has " + std::to_string(plan.segment) + " samples and the signals " +
              std::to_string(rows) + ": use a shorter segment");
  if (o.ranges == nullptr) return plan;
  require(o.range_count >= 0, "range_count", "range_count must not be negative");
  for (int64_t i = 0; i < o.range_count; ++i) {
    plan.ranges.push_back({o.ranges[2 * i], o.ranges[2 * i + 1]});
  }
  return plan;
}

// Inputs and outputs side by side, and which columns are which.
struct Ports {
  Matrix signals;
  std::vector<Index> inputs, outputs;
};

Ports ports_of(const ulna_view* inputs, const ulna_view* outputs) {
  const StridedMap in = map_view(inputs, "inputs");
  const StridedMap out = map_view(outputs, "outputs");
  require(in.rows() == out.rows(), "outputs",
          "the inputs have " + std::to_string(in.rows()) + " rows and the outputs " +
              std::to_string(out.rows()));
  Ports ports{Matrix(in.rows(), in.cols() + out.cols()), {}, {}};
  ports.signals << in, out;
  for (Index c = 0; c < in.cols(); ++c) ports.inputs.push_back(c);
  for (Index c = 0; c < out.cols(); ++c) ports.outputs.push_back(in.cols() + c);
  return ports;
}

Matrix table_of(const Spectra& s) {
  const Index n = s.s.front().rows();
  Matrix table(s.freq_hz.size(), 1 + 2 * n * n);
  table.col(0) = s.freq_hz;
  for (Index f = 0; f < table.rows(); ++f) {
    for (Index k = 0; k < n * n; ++k) {
      const auto value = s.s[static_cast<std::size_t>(f)](k / n, k % n);
      table(f, 1 + 2 * k) = value.real();
      table(f, 2 + 2 * k) = value.imag();
    }
  }
  return table;
}

Matrix table_of(const FrequencyResponse& r) {
  const Index inputs = r.h.front().cols();
  const Index count = r.h.front().size();
  Matrix table(r.freq_hz.size(), 1 + 3 * count);
  table.col(0) = r.freq_hz;
  for (Index f = 0; f < table.rows(); ++f) {
    for (Index k = 0; k < count; ++k) {
      const auto value = r.h[static_cast<std::size_t>(f)](k / inputs, k % inputs);
      table(f, 1 + 3 * k) = value.real();
      table(f, 2 + 3 * k) = value.imag();
      table(f, 3 + 3 * k) = r.radius[static_cast<std::size_t>(f)](k / inputs, k % inputs);
    }
  }
  return table;
}

Matrix table_of(const Coherence& c) {
  Matrix table(c.freq_hz.size(), 1 + 2 * c.raw.cols());
  table << c.freq_hz, c.raw, c.corrected;
  return table;
}

ResampleOptions resample_of(const ulna_resample_options* options) {
  const ulna_resample_options o = read_options(options, "options");
  ResampleOptions result;
  if (o.max_gap_steps != 0.0) result.max_gap_steps = o.max_gap_steps;
  if (o.tolerance != 0.0) result.tolerance = o.tolerance;
  require(o.max_iterations >= 0 && o.max_iterations <= 1000000, "max_iterations",
          "max_iterations must be from 0 (the default) to 1000000");
  if (o.max_iterations != 0) result.max_iterations = static_cast<int>(o.max_iterations);
  return result;
}

Matrix savgol_all(const StridedMap& y, const SavgolSpec& spec, int derivative, double rate_hz) {
  const Index outputs = derivative + 1;
  require_finite(y, "y");  // here, where the channel is known
  Matrix out(y.rows(), outputs * y.cols());
  for (Index c = 0; c < y.cols(); ++c) {
    savgol_apply(spec, rate_hz, y.col(c), derivative, out.middleCols(c * outputs, outputs));
  }
  return out;
}

}  // namespace
}  // namespace ulna::capi

using namespace ulna;
using namespace ulna::capi;

ulna_status ulna_savgol_kernels(int32_t window, int32_t order, int32_t max_derivative,
                                double rate_hz, double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    write_matrix(savgol_kernels({window, order}, max_derivative, rate_hz), out, capacity,
                 out_count);
  });
}

ulna_status ulna_savgol_cutoff(int32_t window, int32_t order, double* out_fraction) {
  return guarded([&] { deref(out_fraction, "out_fraction") = savgol_cutoff({window, order}); });
}

ulna_status ulna_savgol_apply(const ulna_view* y, int32_t window, int32_t order,
                              int32_t max_derivative, double rate_hz, double* out, int64_t capacity,
                              int64_t* out_count) {
  return guarded([&] {
    const StridedMap map = map_view(y, "y");
    check_savgol({window, order}, max_derivative);
    if (only_count(map.size() * (max_derivative + 1), out, capacity, out_count)) return;
    write_matrix(savgol_all(map, {window, order}, max_derivative, rate_hz), out, capacity,
                 out_count);
  });
}

ulna_status ulna_butterworth_design(int32_t order, double cutoff_hz, double rate_hz, double* out,
                                    int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const RowMajor sections = butterworth_lowpass(order, cutoff_hz, rate_hz).sections;
    write_array(sections.data(), sections.size(), out, capacity, out_count);
  });
}

ulna_status ulna_butterworth_two_pass_cutoff(int32_t order, double cutoff_hz, double rate_hz,
                                             double* out_hz) {
  return guarded([&] { deref(out_hz, "out_hz") = two_pass_cutoff(order, cutoff_hz, rate_hz); });
}

ulna_status ulna_butterworth_corrected_cutoff(int32_t order, double wanted_hz, double rate_hz,
                                              double* out_hz) {
  return guarded([&] { deref(out_hz, "out_hz") = corrected_cutoff(order, wanted_hz, rate_hz); });
}

ulna_status ulna_sos_settle(const ulna_view* sos, double epsilon, int64_t* out_samples) {
  return guarded([&] { deref(out_samples, "out_samples") = settle_samples(sos_of(sos), epsilon); });
}

ulna_status ulna_sos_pad(const ulna_view* sos, const ulna_zero_phase_options* options, int64_t rows,
                         int64_t* out_samples) {
  return guarded([&] {
    const ZeroPhase zero_phase = zero_phase_of(options);
    const Sos filter = sos_of(sos);
    deref(out_samples, "out_samples") = rows < 0 ? pad_samples(filter, zero_phase)
                                                 : effective_pad_samples(filter, zero_phase, rows);
  });
}

ulna_status ulna_sos_filter(const ulna_view* y, const ulna_view* sos,
                            const ulna_zero_phase_options* options, double* out, int64_t capacity,
                            int64_t* out_count) {
  return guarded([&] {
    const StridedMap map = map_view(y, "y");
    const Sos filter = sos_of(sos);
    const ZeroPhase zero_phase = zero_phase_of(options);
    if (only_count(map.size(), out, capacity, out_count)) return;
    Matrix signals = map;
    filter_zero_phase(filter, zero_phase, signals);
    write_matrix(signals, out, capacity, out_count);
  });
}

ulna_status ulna_smoother_response(int32_t window, int32_t order, const ulna_view* sos,
                                   double rate_hz, const ulna_view* freq_hz, int32_t relative,
                                   double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Vector freq = map_vector(freq_hz, "freq_hz");
    const Sos filter = sos == nullptr ? Sos{} : sos_of(sos);
    const auto calculate = relative != 0 ? smoother_response : smoother_gain;
    write_matrix(calculate({window, order}, sos == nullptr ? nullptr : &filter, rate_hz, freq), out,
                 capacity, out_count);
  });
}

ulna_status ulna_spectrum_plan(int64_t rows, const ulna_spectrum_options* options,
                               ulna_spectrum_info* out_info) {
  return guarded([&] {
    require(rows >= 0, "rows", "rows must not be negative");
    const SpectrumPlan plan = plan_of(options, rows);
    const Averaging averaging = welch_averaging(rows, plan.segment, plan.ranges);
    ulna_spectrum_info info = {};
    info.bins = plan.segment / 2 + 1;
    info.averages = averaging.averages;
    info.effective_averages = averaging.effective;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_spectrum_estimate(const ulna_view* signals, double rate_hz,
                                   const ulna_spectrum_options* options, ulna_token* token,
                                   double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const StridedMap map = map_view(signals, "signals");
    const SpectrumPlan plan = plan_of(options, map.rows());
    const int64_t columns = 1 + 2 * map.cols() * map.cols();
    if (only_count((plan.segment / 2 + 1) * columns, out, capacity, out_count)) return;
    const Spectra spectra = welch(map, rate_hz, plan.segment, plan.ranges, token_of(token));
    write_matrix(table_of(spectra), out, capacity, out_count);
  });
}

ulna_status ulna_coherence_estimate(const ulna_view* inputs, const ulna_view* outputs,
                                    double rate_hz, const ulna_spectrum_options* options,
                                    ulna_token* token, double* out, int64_t capacity,
                                    int64_t* out_count) {
  return guarded([&] {
    const Ports p = ports_of(inputs, outputs);
    const SpectrumPlan plan = plan_of(options, p.signals.rows());
    const int64_t columns = 1 + 2 * static_cast<int64_t>(p.outputs.size());
    if (only_count((plan.segment / 2 + 1) * columns, out, capacity, out_count)) return;
    const Spectra spectra = welch(p.signals, rate_hz, plan.segment, plan.ranges, token_of(token));
    write_matrix(table_of(multiple_coherence(spectra, p.inputs, p.outputs)), out, capacity,
                 out_count);
  });
}

ulna_status ulna_response_estimate(const ulna_view* inputs, const ulna_view* outputs,
                                   double rate_hz, const ulna_spectrum_options* options,
                                   ulna_token* token, double* out, int64_t capacity,
                                   int64_t* out_count) {
  return guarded([&] {
    const Ports p = ports_of(inputs, outputs);
    const SpectrumPlan plan = plan_of(options, p.signals.rows());
    const int64_t columns = 1 + 3 * static_cast<int64_t>(p.inputs.size() * p.outputs.size());
    if (only_count((plan.segment / 2 + 1) * columns, out, capacity, out_count)) return;
    const Spectra spectra = welch(p.signals, rate_hz, plan.segment, plan.ranges, token_of(token));
    const FrequencyResponse r = frequency_response(spectra, p.inputs, p.outputs, plan.confidence);
    write_matrix(table_of(r), out, capacity, out_count);
  });
}

ulna_status ulna_clock_check(const ulna_view* times_s, ulna_clock* out_clock) {
  return guarded([&] {
    const Jitter j = check_clock(Vector(map_vector(times_s, "times_s")));
    ulna_clock clock = {};
    clock.median_step_s = j.median_step_s;
    clock.jitter_rms = j.rms_fraction;
    clock.jitter_max = j.max_fraction;
    clock.worst_row = j.worst_row;
    clock.gap_count = j.gaps;
    clock.first_gap_row = j.first_gap_row;
    clock.largest_gap_row = j.largest_gap_row;
    clock.largest_gap_s = j.largest_gap_s;
    write_result(out_clock, clock, "out_clock");
  });
}

ulna_status ulna_clock_gaps(const ulna_view* times_s, int64_t* out, int64_t capacity,
                            int64_t* out_count) {
  return guarded([&] {
    const Jitter j = check_clock(Vector(map_vector(times_s, "times_s")));
    if (only_count(j.gaps, out, capacity, out_count)) return;
    std::copy(j.gap_rows.begin(), j.gap_rows.end(), out);
    *out_count = j.gaps;
  });
}

ulna_status ulna_clock_resample(const ulna_view* times_s, const ulna_view* y, double t0_s,
                                double rate_hz, int64_t n, const ulna_resample_options* options,
                                ulna_token* token, double* out, int64_t capacity,
                                int64_t* out_count) {
  return guarded([&] {
    const Vector times = map_vector(times_s, "times_s");
    const StridedMap map = map_view(y, "y");
    const ResampleOptions o = resample_of(options);
    require(n >= 0 && n < (int64_t{1} << 40), "n",
            "the number of samples is negative or too large");
    if (only_count(n * map.cols(), out, capacity, out_count)) return;
    write_matrix(resample_columns(times, map, t0_s, rate_hz, n, o, token_of(token)), out, capacity,
                 out_count);
  });
}
