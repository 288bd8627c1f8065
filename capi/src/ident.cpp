#include "ident.hpp"

#include "guard.hpp"
#include "handles.hpp"
#include "ident/consistency.hpp"
#include "ident/prepared_record.hpp"
#include "record/look.hpp"

namespace ulna::capi {

PrepareRequest prepare_request(const ulna_prepare_options* given) {
  const ulna_prepare_options o = read_options(given, "options");
  require(o.pad == ULNA_PAD_POLE_RADIUS || o.pad == ULNA_PAD_SCIPY, "pad",
          "pad must be ULNA_PAD_POLE_RADIUS or ULNA_PAD_SCIPY");
  PrepareRequest out;
  out.options.window = o.window;
  out.options.order = o.order;
  out.options.lowpass_order = o.lowpass_order;
  out.options.lowpass_hz = o.lowpass_hz;
  out.options.corrected = o.corrected != 0;
  out.options.plain_savgol = o.plain_savgol != 0;
  out.options.zero_phase.pad = o.pad == ULNA_PAD_SCIPY ? Pad::kScipy : Pad::kPoleRadius;
  if (o.pad_epsilon != 0.0) out.options.zero_phase.epsilon = o.pad_epsilon;
  const auto word = [](const char* text) { return std::string(text == nullptr ? "" : text); };
  out.position = word(o.position);
  out.force = word(o.force);
  out.reference = word(o.reference);
  out.threads = o.threads;
  return out;
}

ulna_prepare_report prepare_report(const Prepared& prepared) {
  return prepare_report(prepared.report, derivative_consistency(prepared));
}

ulna_prepare_report prepare_report(const PrepareReport& report,
                                   const DerivativeConsistency& consistency) {
  ulna_prepare_report out = {};
  out.rate_hz = report.rate_hz;
  out.lowpass_hz = report.lowpass_hz;
  out.effective_cutoff_hz = report.effective_cutoff_hz;
  out.motion_band_hz = report.motion_band_hz;
  out.dropped_rows = report.dropped_rows;
  out.pad_rows = report.pad_rows;
  out.transient_rows = report.transient_rows;
  out.window = report.window;
  out.order = report.order;
  out.lowpass_order = report.lowpass_order;
  out.lowpass_chosen = report.lowpass_chosen ? 1 : 0;
  out.short_trials = report.short_trials ? 1 : 0;
  out.velocity_consistency = consistency.velocity;
  out.position_consistency = consistency.position;
  return out;
}

}  // namespace ulna::capi

using namespace ulna;
using namespace ulna::capi;

ulna_status ulna_prepare(const ulna_record* record, const ulna_prepare_options* options,
                         ulna_token* token, ulna_record** out_record,
                         ulna_prepare_report* out_report) {
  return guarded([&] {
    const Record& source = deref(record, "record").record;
    ulna_record*& out = deref(out_record, "out_record");
    const PrepareRequest request = prepare_request(options);
    const Roles roles = find_roles(source, request.position, request.force, request.reference);
    const Prepared prepared =
        prepare(source, roles, request.options, request.threads, token_of(token));
    Record result = prepared_record(source, prepared);
    auto findings = look(result);
    auto handle = std::make_unique<ulna_record>(
        ulna_record{std::move(result), std::move(findings), {}, false});
    if (out_report != nullptr) write_result(out_report, prepare_report(prepared), "out_report");
    out = handle.release();
  });
}
