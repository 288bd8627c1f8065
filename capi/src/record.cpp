#include <ulna/record.h>

#include <algorithm>
#include <memory>

#include "finding.hpp"
#include "guard.hpp"
#include "handles.hpp"
#include "ident/regularise.hpp"
#include "record/csv.hpp"
#include "record/look.hpp"
#include "record/split.hpp"
#include "record/units.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

template <std::size_t N>
std::string take(const char (&text)[N], const char* argument) {
  const void* end = std::memchr(text, 0, N);
  require(end != nullptr, argument, std::string(argument) + " holds a text without its end");
  return std::string(text);
}

std::string text_or_empty(const char* text) { return text == nullptr ? std::string() : text; }

Role role_of(int32_t role, const char* argument) {
  require(role >= ULNA_ROLE_OTHER && role <= ULNA_ROLE_REFERENCE, argument,
          "a role is ULNA_ROLE_OTHER, _POSITION, _FORCE or _REFERENCE");
  return static_cast<Role>(role);
}

ChannelRule rule_of(const ulna_channel_rule& in) {
  ChannelRule rule;
  rule.source = take(in.source, "rules");
  rule.name = take(in.name, "rules");
  rule.unit = take(in.unit, "rules");
  rule.frame = take(in.frame, "rules");
  require(in.reserved == 0, "rules", "the reserved member of a rule must be zero");
  rule.sign = in.sign == 0 ? 1 : in.sign;
  if (in.role == ULNA_ROLE_NONE) rule.role = Role::kOther;
  if (in.role != ULNA_ROLE_NONE && in.role != ULNA_ROLE_OTHER)
    rule.role = role_of(in.role, "rules");
  require(in.axis >= 0, "rules", "the axis of a rule counts from 1; 0 is \"from the name\"");
  if (in.axis > 0) rule.axis = in.axis - 1;
  return rule;
}

char character(int32_t code, const char* argument) {
  require(code >= 0 && code < 128, argument, std::string(argument) + " must be an ASCII character");
  return static_cast<char>(code);
}

CsvOptions csv_options(const ulna_read_options* options) {
  const ulna_read_options in = read_options(options, "options");
  CsvOptions out;
  out.delimiter = character(in.delimiter, "delimiter");
  out.decimal = character(in.decimal, "decimal");
  out.skip_rows = in.skip_rows;
  require(in.header >= ULNA_HEADER_DETECT && in.header <= ULNA_HEADER_ABSENT, "header",
          "header must be ULNA_HEADER_DETECT, _PRESENT or _ABSENT");
  out.header = static_cast<Header>(in.header);
  out.name = text_or_empty(in.name);
  out.map.rate_hz = in.rate_hz;
  out.map.time_column = text_or_empty(in.time_column);
  out.map.time_unit = text_or_empty(in.time_unit);
  require(in.rule_count >= 0 && (in.rules != nullptr || in.rule_count == 0), "rules",
          "rules must hold rule_count rules");
  for (int64_t i = 0; i < in.rule_count; ++i) out.map.channels.push_back(rule_of(in.rules[i]));
  return out;
}

using Handle = std::unique_ptr<ulna_record>;

void give(ulna_record** out_record, Handle made) {
  ulna_record*& out = deref(out_record, "out_record");
  out = made.release();
}

Handle handle_of(ReadResult&& read, bool is_text) {
  return Handle(new ulna_record{std::move(read.record), std::move(read.findings),
                                std::move(read.source), is_text});
}

// A record made from another keeps how its source was read; what there is to find is found anew.
Handle derived(const ulna_record& from, Record&& record) {
  std::vector<Finding> findings;
  static constexpr std::string_view kOfReader[] = {"unit_missing", "unit_unknown", "role",
                                                   "truncated", "skipped"};
  for (const Finding& f : from.findings) {
    if (std::find(std::begin(kOfReader), std::end(kOfReader), f.code) != std::end(kOfReader)) {
      findings.push_back(f);
    }
  }
  const std::vector<Finding> seen = look(record);
  findings.insert(findings.end(), seen.begin(), seen.end());
  return Handle(new ulna_record{std::move(record), std::move(findings), from.source, from.is_text});
}

template <class T>
const T& item(const std::vector<T>& all, int64_t index) {
  require(index >= 0 && index < static_cast<int64_t>(all.size()), "index",
          "index " + std::to_string(index) + " is out of range: there are " +
              std::to_string(all.size()));
  return all[static_cast<std::size_t>(index)];
}

Channel channel_of(const ulna_channel& in) {
  require(in.struct_size == static_cast<int64_t>(sizeof in), "channels",
          "struct_size of every channel must be sizeof(ulna_channel)");
  Channel out;
  out.name = take(in.name, "channels");
  out.unit = take(in.unit, "channels");
  out.frame = take(in.frame, "channels");
  out.source_name = take(in.source_name, "channels");
  out.source_unit = take(in.source_unit, "channels");
  out.sign = in.sign == 0 ? 1 : in.sign;
  out.role = role_of(in.role, "channels");
  out.axis = in.axis;
  return out;
}

ulna_channel channel_struct(const Channel& in) {
  ulna_channel out = {};
  put(out.name, in.name);
  put(out.unit, in.unit);
  put(out.frame, in.frame);
  put(out.source_name, in.source_name);
  put(out.source_unit, in.source_unit);
  out.sign = in.sign;
  out.role = static_cast<int32_t>(in.role);
  out.axis = in.axis;
  return out;
}

template <class T>
void require_items(const T* items, int64_t count, const char* argument) {
  require(count >= 0 && (items != nullptr || count == 0), argument,
          std::string(argument) + " must hold as many items as its count says");
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t stop = std::min(text.find('\n', at), text.size());
    lines.push_back(text.substr(at, stop - at));
    at = stop + 1;
  }
  return lines;
}

Record::Parts record_parts(const ulna_record_parts& in) {
  Record::Parts out;
  out.values = map_view(in.values, "values");
  if (in.time != nullptr) {
    const StridedMap time = map_view(in.time, "time");
    require(time.cols() == 1, "time", "time must have one column");
    for (Index i = 0; i < time.rows(); ++i) out.time.push_back(time(i, 0));
  }
  out.rate_hz = in.rate_hz;
  require_items(in.channels, in.channel_count, "channels");
  require_items(in.trials, in.trial_count, "trials");
  require_items(in.segments, in.segment_count, "segments");
  for (int64_t i = 0; i < in.channel_count; ++i) out.channels.push_back(channel_of(in.channels[i]));
  for (int64_t i = 0; i < in.trial_count; ++i)
    out.trials.push_back({in.trials[i].begin, in.trials[i].end});
  for (int64_t i = 0; i < in.segment_count; ++i) {
    const ulna_segment& s = in.segments[i];
    require(s.trial >= 0 && s.trial < INT32_MAX, "segments", "a segment belongs to no trial");
    out.segments.push_back({s.begin, s.end, static_cast<int>(s.trial)});
  }
  out.provenance = lines_of(text_or_empty(in.provenance));
  return out;
}

void write_indices(const std::vector<Index>& values, int64_t* out, int64_t capacity,
                   int64_t* out_count) {
  deref(out_count, "out_count");
  const auto count = static_cast<int64_t>(values.size());
  if (out != nullptr || capacity != 0) {
    deref(out, "out");
    if (capacity < count) {
      throw Error(Fault::kBuffer, "capacity",
                  "the buffer holds " + std::to_string(capacity) + " values, " +
                      std::to_string(count) + " are needed");
    }
    std::copy(values.begin(), values.end(), out);
  }
  *out_count = count;
}

}  // namespace

ulna_status ulna_record_read_csv(const char* path, const ulna_read_options* options,
                                 ulna_token* token, ulna_record** out_record) {
  return guarded([&] {
    deref(path, "path");
    give(out_record, handle_of(read_csv(path, csv_options(options), token_of(token)), true));
  });
}

ulna_status ulna_record_read_csv_memory(const char* data, int64_t size,
                                        const ulna_read_options* options, ulna_token* token,
                                        ulna_record** out_record) {
  return guarded([&] {
    deref(out_record, "out_record");
    require(size >= 0 && (data != nullptr || size == 0), "data", "data must hold size bytes");
    give(out_record, handle_of(read_csv_memory(data, static_cast<std::size_t>(size),
                                               csv_options(options), token_of(token)),
                               true));
  });
}

ulna_status ulna_record_from_columns(const ulna_view* values, const char* const* headings,
                                     int64_t heading_count, const ulna_read_options* options,
                                     ulna_token* token, ulna_record** out_record) {
  return guarded([&] {
    require_items(headings, heading_count, "headings");
    std::vector<std::string> names;
    for (int64_t i = 0; i < heading_count; ++i) names.emplace_back(&deref(headings[i], "headings"));
    const Matrix columns = map_view(values, "values");
    give(out_record,
         handle_of(from_columns(columns, names, csv_options(options), token_of(token)), false));
  });
}

ulna_status ulna_record_new(const ulna_record_parts* parts, ulna_record** out_record) {
  return guarded([&] {
    deref(parts, "parts");
    Record record = Record::make(record_parts(read_options(parts, "parts")));
    std::vector<Finding> findings = look(record);
    give(out_record, Handle(new ulna_record{std::move(record), std::move(findings), {}, false}));
  });
}

void ulna_record_free(ulna_record* record) { delete record; }

ulna_status ulna_record_get_info(const ulna_record* record, ulna_record_info* out_info) {
  return guarded([&] {
    const Record& r = deref(record, "record").record;
    ulna_record_info info = {};
    info.rows = r.rows();
    info.channels = r.channel_count();
    info.trials = static_cast<int64_t>(r.trials().size());
    info.segments = static_cast<int64_t>(r.segments().size());
    info.findings = static_cast<int64_t>(record->findings.size());
    info.provenance = static_cast<int64_t>(r.provenance().size());
    info.rate_hz = r.rate_hz();
    Index rows = 0;
    for (const Trial& trial : r.trials()) rows += trial.end - trial.begin;
    info.duration_s = static_cast<double>(rows) / r.rate_hz();
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_record_get_source(const ulna_record* record, ulna_record_source* out_source) {
  return guarded([&] {
    const Source& in = deref(record, "record").source;
    ulna_record_source source = {};
    source.skip_rows = in.skip_rows;
    source.delimiter = record->is_text ? in.delimiter : 0;
    source.decimal = record->is_text ? in.decimal : 0;
    source.header = in.header ? ULNA_HEADER_PRESENT : ULNA_HEADER_ABSENT;
    put(source.time_column, in.time_column);
    put(source.time_unit, in.time_unit);
    write_result(out_source, source, "out_source");
  });
}

ulna_status ulna_record_get_channel(const ulna_record* record, int64_t index,
                                    ulna_channel* out_channel) {
  return guarded([&] {
    const Channel& channel = item(deref(record, "record").record.channels(), index);
    write_result(out_channel, channel_struct(channel), "out_channel");
  });
}

ulna_status ulna_record_get_trial(const ulna_record* record, int64_t index, ulna_trial* out_trial) {
  return guarded([&] {
    const Trial& trial = item(deref(record, "record").record.trials(), index);
    deref(out_trial, "out_trial") = {trial.begin, trial.end};
  });
}

ulna_status ulna_record_get_segment(const ulna_record* record, int64_t index,
                                    ulna_segment* out_segment) {
  return guarded([&] {
    const Segment& s = item(deref(record, "record").record.segments(), index);
    deref(out_segment, "out_segment") = {s.begin, s.end, s.trial};
  });
}

ulna_status ulna_record_get_finding(const ulna_record* record, int64_t index,
                                    ulna_finding* out_finding) {
  return guarded([&] {
    const Finding& in = item(deref(record, "record").findings, index);
    write_result(out_finding, finding_struct(in), "out_finding");
  });
}

ulna_status ulna_record_provenance(const ulna_record* record, char* out_text, int64_t capacity,
                                   int64_t* out_size) {
  return guarded([&] {
    std::string text;
    for (const std::string& line : deref(record, "record").record.provenance()) {
      text += (text.empty() ? "" : "\n") + line;
    }
    write_text(text, out_text, capacity, out_size);
  });
}

ulna_status ulna_record_values(const ulna_record* record, const double** out_data) {
  return guarded(
      [&] { deref(out_data, "out_data") = deref(record, "record").record.values().data(); });
}

ulna_status ulna_record_time(const ulna_record* record, const double** out_data) {
  return guarded(
      [&] { deref(out_data, "out_data") = deref(record, "record").record.time().data(); });
}

ulna_status ulna_record_with_role(const ulna_record* record, int32_t role, int64_t* out,
                                  int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Record& r = deref(record, "record").record;
    write_indices(r.with_role(role_of(role, "role")), out, capacity, out_count);
  });
}

ulna_status ulna_record_resolve(const ulna_record* record, const char* word, int64_t* out,
                                int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Record& r = deref(record, "record").record;
    write_indices(r.resolve(&deref(word, "word")), out, capacity, out_count);
  });
}

ulna_status ulna_record_split(const ulna_record* record, double gap_steps, int64_t min_rows,
                              ulna_record** out_record) {
  return guarded([&] {
    SplitOptions options;
    if (gap_steps != 0.0) options.gap_steps = gap_steps;
    if (min_rows != 0) options.min_rows = min_rows;
    const ulna_record& from = deref(record, "record");
    give(out_record, derived(from, split(from.record, options)));
  });
}

ulna_status ulna_record_select_rows(const ulna_record* record, int64_t begin, int64_t end,
                                    ulna_record** out_record) {
  return guarded([&] {
    const ulna_record& from = deref(record, "record");
    give(out_record, derived(from, select_rows(from.record, begin, end)));
  });
}

ulna_status ulna_record_select_trials(const ulna_record* record, const int64_t* trials,
                                      int64_t count, ulna_record** out_record) {
  return guarded([&] {
    const ulna_record& from = deref(record, "record");
    require_items(trials, count, "trials");
    const std::vector<Index> wanted(trials, trials + count);
    give(out_record, derived(from, select_trials(from.record, wanted)));
  });
}

ulna_status ulna_record_with_segments(const ulna_record* record, const ulna_view* onsets,
                                      double before_s, double after_s, ulna_record** out_record) {
  return guarded([&] {
    const ulna_record& from = deref(record, "record");
    const StridedMap view = map_view(onsets, "onsets");
    require(view.cols() == 1, "onsets", "onsets must have one column");
    std::vector<double> times;
    for (Index i = 0; i < view.rows(); ++i) times.push_back(view(i, 0));
    give(out_record, derived(from, with_segments(from.record, times, before_s, after_s)));
  });
}

ulna_status ulna_record_join(const ulna_record* const* records, int64_t count,
                             ulna_record** out_record) {
  return guarded([&] {
    require_items(records, count, "records");
    std::vector<Record> all;
    for (int64_t i = 0; i < count; ++i) all.push_back(deref(records[i], "records").record);
    Record joined = join(all);
    give(out_record, derived(*records[0], std::move(joined)));
  });
}

ulna_status ulna_record_regularise(const ulna_record* record, double rate_hz, ulna_token* token,
                                   ulna_record** out_record) {
  return guarded([&] {
    const ulna_record& from = deref(record, "record");
    give(out_record, derived(from, regularise(from.record, rate_hz, token_of(token))));
  });
}

ulna_status ulna_record_write_csv(const ulna_record* record, const char* path, ulna_token* token) {
  return guarded(
      [&] { write_csv(deref(record, "record").record, &deref(path, "path"), token_of(token)); });
}

ulna_status ulna_unit_parse(const char* unit, double* out_factor, char* out_text, int64_t capacity,
                            int64_t* out_size) {
  return guarded([&] {
    const std::string text = &deref(unit, "unit");
    const std::optional<Unit> parsed = parse_unit(text);
    require(
        parsed.has_value(), "unit",
        std::string("\"").append(text, 0, 40) + "\" is no known unit; known are " + known_units());
    double& factor = deref(out_factor, "out_factor");
    write_text(parsed->si, out_text, capacity, out_size);
    factor = parsed->factor;
  });
}
