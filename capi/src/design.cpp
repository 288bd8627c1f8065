#include <ulna/design.h>

#include <algorithm>
#include <memory>
#include <sstream>
#include <utility>

#include "arguments.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "ident/excitation_record.hpp"
#include "record/look.hpp"
#include "signal/binary_sequence.hpp"
#include "signal/finite.hpp"
#include "signal/multisine.hpp"
#include "signal/steps.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

Drive drive_of(int32_t drive) {
  require(drive == ULNA_DRIVE_POSITION || drive == ULNA_DRIVE_FORCE, "drive",
          "drive must be ULNA_DRIVE_POSITION or ULNA_DRIVE_FORCE");
  return drive == ULNA_DRIVE_FORCE ? Drive::kForce : Drive::kPosition;
}

Vector column_of(const ulna_view* view, const char* argument) {
  const StridedMap map = map_view(view, argument);
  require(map.cols() == 1, argument, std::string(argument) + " must have one column");
  return map;
}

Phases phases_of(int32_t phases) {
  switch (phases) {
    case ULNA_PHASES_OPTIMISED:
      return Phases::kOptimised;
    case ULNA_PHASES_RANDOM:
      return Phases::kRandom;
    case ULNA_PHASES_SCHROEDER:
      return Phases::kSchroeder;
    default:
      throw Error(Fault::kArgument, "phases", "phases must be an ULNA_PHASES_ constant");
  }
}

MultisineSpec multisine_spec(int32_t drive, const ulna_view* amplitude,
                             const ulna_multisine_options* given) {
  const ulna_multisine_options o = read_options(given, "options");
  MultisineSpec out;
  out.drive = drive_of(drive);
  out.amplitude = column_of(amplitude, "amplitude");
  out.rms = o.rms != 0;
  out.rate_hz = or_default(o.rate_hz, out.rate_hz);
  out.duration_s = or_default(o.duration_s, out.duration_s);
  out.low_hz = o.low_hz;
  out.high_hz = or_default(o.high_hz, out.high_hz);
  if (o.lines != 0) out.lines = o.lines;
  if (o.lines_hz != nullptr) {
    out.lines_hz = map_view(o.lines_hz, "lines_hz");
    require(out.lines_hz.size() > 0, "lines_hz", "lines_hz holds no line");
  }
  out.shared = o.shared != 0;
  out.period_s = o.period_s;
  out.slope = o.slope;
  out.fade_s = o.fade_s;
  out.phases = phases_of(o.phases);
  if (o.starts != 0) out.starts = std::max<int32_t>(0, o.starts);
  out.seed = static_cast<std::uint64_t>(o.seed);
  return out;
}

StepsSpec steps_spec(int32_t drive, double size, const ulna_steps_options* given) {
  const ulna_steps_options o = read_options(given, "options");
  StepsSpec out;
  out.drive = drive_of(drive);
  out.size = size;
  out.rate_hz = or_default(o.rate_hz, out.rate_hz);
  out.filter.damping_ratio = or_default(o.damping_ratio, out.filter.damping_ratio);
  out.filter.natural_rad_s = or_default(o.natural_rad_s, out.filter.natural_rad_s);
  const auto range = [](const double(&from)[2], double& low, double& high) {
    if (from[0] == 0.0 && from[1] == 0.0) return;
    low = from[0];
    high = from[1];
  };
  range(o.hold_s, out.hold_low_s, out.hold_high_s);
  range(o.wait_s, out.wait_low_s, out.wait_high_s);
  out.return_s = or_default(o.return_s, out.return_s);
  out.rest_s = or_none(o.rest_s, out.rest_s);
  if (o.directions != nullptr) {
    out.vectors = map_view(o.directions, "directions");
    require(out.vectors.size() > 0, "directions", "directions holds no row");
  }
  if (o.axes != 0) out.axes = o.axes;
  if (o.direction_count != 0 || out.axes == 1) {
    out.directions = o.direction_count != 0 ? o.direction_count : 2;
  }
  if (o.repeats != 0) out.repeats = o.repeats;
  out.seed = static_cast<std::uint64_t>(o.seed);
  return out;
}

BinarySpec binary_spec(int32_t drive, const ulna_view* amplitude,
                       const ulna_binary_options* given) {
  const ulna_binary_options o = read_options(given, "options");
  BinarySpec out;
  out.drive = drive_of(drive);
  out.amplitude = column_of(amplitude, "amplitude");
  out.rate_hz = or_default(o.rate_hz, out.rate_hz);
  out.duration_s = or_default(o.duration_s, out.duration_s);
  out.clock_s = or_default(o.clock_s, out.clock_s);
  out.return_s = or_none(o.return_s, out.return_s);
  out.filtered = !(o.damping_ratio < 0.0);
  if (out.filtered) out.filter.damping_ratio = or_default(o.damping_ratio, 0.1);
  out.filter.natural_rad_s = or_default(o.natural_rad_s, out.filter.natural_rad_s);
  out.seed = static_cast<std::uint64_t>(o.seed);
  return out;
}

void give(ulna_design** out, Excitation excitation) {
  ulna_design*& place = deref(out, "out_design");
  place = new ulna_design{std::move(excitation)};
}

void give(ulna_record** out, Record record) {
  ulna_record*& place = deref(out, "out_record");
  std::vector<Finding> findings = look(record);
  place = new ulna_record{std::move(record), std::move(findings), {}, false};
}

Matrix segments_table(const Excitation& e) {
  Matrix out(static_cast<Index>(e.segments.size()), 2);
  for (Index i = 0; i < out.rows(); ++i) {
    const RowRange& range = e.segments[static_cast<std::size_t>(i)];
    out.row(i) << static_cast<double>(range.begin), static_cast<double>(range.end);
  }
  return out;
}

Matrix lines_table(const Excitation& e) {
  Matrix out(static_cast<Index>(e.lines.size()), 4);
  for (Index i = 0; i < out.rows(); ++i) {
    const Line& line = e.lines[static_cast<std::size_t>(i)];
    out.row(i) << static_cast<double>(line.axis), line.freq_hz, line.amplitude, line.phase_rad;
  }
  return out;
}

Matrix events_table(const Excitation& e) {
  Matrix out(static_cast<Index>(e.events.size()), 3 + e.axes());
  for (Index i = 0; i < out.rows(); ++i) {
    const StepEvent& event = e.events[static_cast<std::size_t>(i)];
    out.row(i) << event.onset_s, event.hold_s, static_cast<double>(event.direction),
        event.size.transpose();
  }
  return out;
}

Matrix design_values(const Excitation& e, int32_t quantity) {
  switch (quantity) {
    case ULNA_DESIGN_VALUE:
      return e.value;
    case ULNA_DESIGN_RATE:
      return e.rate;
    case ULNA_DESIGN_ACCELERATION:
      return e.acceleration;
    case ULNA_DESIGN_SEGMENTS:
      return segments_table(e);
    case ULNA_DESIGN_LINES:
      return lines_table(e);
    case ULNA_DESIGN_EVENTS:
      return events_table(e);
    case ULNA_DESIGN_PEAK:
      return extent_of(e).peak;
    case ULNA_DESIGN_RMS:
      return extent_of(e).rms;
    case ULNA_DESIGN_CREST:
      return extent_of(e).crest;
    default:
      throw Error(Fault::kArgument, "quantity", "quantity must be an ULNA_DESIGN_ constant");
  }
}

std::string lines_of_text(const std::vector<std::string>& sentences) {
  std::string out;
  for (const std::string& s : sentences) out += (out.empty() ? "" : "\n") + s;
  return out;
}

std::vector<std::string> names_of(const char* axes) {
  std::vector<std::string> names;
  std::istringstream text(&deref(axes, "axes"));
  for (std::string name; std::getline(text, name, ',');) names.push_back(name);
  return names;
}

std::vector<RowRange> ranges_of(const int64_t* segments, int64_t count) {
  require(count >= 0, "segment_count", "segment_count must not be negative");
  std::vector<RowRange> out;
  if (segments == nullptr) return out;
  for (int64_t i = 0; i < count; ++i) out.push_back({segments[2 * i], segments[2 * i + 1]});
  return out;
}

}  // namespace

ulna_status ulna_design_multisine(int32_t drive, const ulna_view* amplitude,
                                  const ulna_multisine_options* options, ulna_token* token,
                                  ulna_design** out_design) {
  return guarded([&] {
    deref(out_design, "out_design");
    give(out_design, multisine(multisine_spec(drive, amplitude, options), token_of(token)));
  });
}

ulna_status ulna_design_steps(int32_t drive, double size, const ulna_steps_options* options,
                              ulna_token* token, ulna_design** out_design) {
  return guarded([&] {
    deref(out_design, "out_design");
    give(out_design, steps(steps_spec(drive, size, options), token_of(token)));
  });
}

ulna_status ulna_design_binary(int32_t drive, const ulna_view* amplitude,
                               const ulna_binary_options* options, ulna_token* token,
                               ulna_design** out_design) {
  return guarded([&] {
    deref(out_design, "out_design");
    give(out_design, random_binary(binary_spec(drive, amplitude, options), token_of(token)));
  });
}

ulna_status ulna_design_new(int32_t drive, const ulna_view* reference, const ulna_view* velocity,
                            const ulna_view* acceleration, double rate_hz, const int64_t* segments,
                            int64_t segment_count, const char* provenance,
                            ulna_design** out_design) {
  return guarded([&] {
    deref(out_design, "out_design");
    const auto optional = [](const ulna_view* view, const char* argument) -> Matrix {
      return view == nullptr ? Matrix() : Matrix(map_view(view, argument));
    };
    Excitation made =
        excitation_of(drive_of(drive), rate_hz, map_view(reference, "reference"),
                      ranges_of(segments, segment_count), optional(velocity, "velocity"),
                      optional(acceleration, "acceleration"));
    if (provenance != nullptr) made.provenance = provenance;
    give(out_design, std::move(made));
  });
}

ulna_status ulna_design_scale(const ulna_design* design, double factor, ulna_design** out_design) {
  return guarded([&] { give(out_design, scaled(deref(design, "design").excitation, factor)); });
}

void ulna_design_free(ulna_design* design) { delete design; }

ulna_status ulna_design_get_info(const ulna_design* design, ulna_design_info* out_info) {
  return guarded([&] {
    const Excitation& e = deref(design, "design").excitation;
    ulna_design_info info = {};
    info.rows = e.rows();
    info.axes = e.axes();
    info.segments = static_cast<int64_t>(e.segments.size());
    info.lines = static_cast<int64_t>(e.lines.size());
    info.events = static_cast<int64_t>(e.events.size());
    info.rate_hz = e.rate_hz;
    info.period_s = e.period_s;
    info.drive = e.drive == Drive::kForce ? ULNA_DRIVE_FORCE : ULNA_DRIVE_POSITION;
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_design_get_values(const ulna_design* design, int32_t quantity, double* out,
                                   int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Matrix values = design_values(deref(design, "design").excitation, quantity);
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}

ulna_status ulna_design_get_text(const ulna_design* design, int32_t which, char* out_text,
                                 int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    const Excitation& e = deref(design, "design").excitation;
    require(which == ULNA_DESIGN_TEXT_NOTES || which == ULNA_DESIGN_TEXT_PROVENANCE, "which",
            "which must be an ULNA_DESIGN_TEXT_ constant");
    write_text(which == ULNA_DESIGN_TEXT_NOTES ? lines_of_text(e.notes) : e.provenance, out_text,
               capacity, out_size);
  });
}

ulna_status ulna_design_to_record(const ulna_design* design, const char* axes, int32_t rotational,
                                  int32_t derivatives, ulna_record** out_record) {
  return guarded([&] {
    give(out_record, record_of(deref(design, "design").excitation, names_of(axes), rotational != 0,
                               derivatives != 0));
  });
}

ulna_status ulna_design_mark(const ulna_design* design, const ulna_record* record, double start_s,
                             ulna_record** out_record) {
  return guarded([&] {
    give(out_record, with_segments_of(deref(record, "record").record,
                                      deref(design, "design").excitation, start_s));
  });
}

ulna_status ulna_step_response(const ulna_view* time, double damping_ratio, double natural_rad_s,
                               double* out, int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Vector t = column_of(time, "time");
    require_finite(t, "time");
    const SecondOrder filter{damping_ratio, natural_rad_s};
    check_second_order(filter);
    Matrix table(t.size(), 3);
    for (Index i = 0; i < t.size(); ++i) {
      const SignalPoint p = step_response(filter, t[i]);
      table.row(i) << p.value, p.rate, p.acceleration;
    }
    write_array(table.data(), table.size(), out, capacity, out_count);
  });
}

ulna_status ulna_step_facts(double damping_ratio, double natural_rad_s, double* out_overshoot,
                            double* out_peak_time_s, double* out_settling_s) {
  return guarded([&] {
    const StepFacts facts = step_facts({damping_ratio, natural_rad_s});
    double& overshoot = deref(out_overshoot, "out_overshoot");
    double& peak = deref(out_peak_time_s, "out_peak_time_s");
    double& settling = deref(out_settling_s, "out_settling_s");
    overshoot = facts.overshoot;
    peak = facts.peak_time_s;
    settling = facts.settling_s;
  });
}
