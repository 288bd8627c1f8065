#include <ulna/frf.h>

#include <algorithm>
#include <vector>

#include "guard.hpp"
#include "handles.hpp"
#include "signal/closed_loop_response.hpp"
#include "signal/local_polynomial.hpp"
#include "signal/periodic_response.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

constexpr Index kDefaultSegment = 1024;

struct Request {
  ulna_frf_options options;
  std::vector<RowRange> ranges;
  double confidence = 0.95;
};

Request request_of(const ulna_frf_options* given) {
  Request out{read_options(given, "options"), {}, 0.95};
  if (out.options.confidence != 0.0) out.confidence = out.options.confidence;
  if (out.options.ranges == nullptr) return out;
  require(out.options.range_count > 0, "range_count", "range_count must be positive");
  for (int64_t i = 0; i < out.options.range_count; ++i) {
    out.ranges.push_back({out.options.ranges[2 * i], out.options.ranges[2 * i + 1]});
  }
  return out;
}

LocalPolynomial local_of(const ulna_frf_options& o) {
  LocalPolynomial out;
  if (o.order != 0) out.order = o.order;
  out.half_width = o.half_width;
  out.stride = o.stride;
  return out;
}

// Signals side by side, and which columns are which.
struct Channels {
  Matrix signals;
  std::vector<std::vector<Index>> groups;
};

Channels channels_of(const std::vector<const ulna_view*>& views,
                     const std::vector<const char*>& names) {
  Index columns = 0;
  for (std::size_t i = 0; i < views.size(); ++i) columns += map_view(views[i], names[i]).cols();
  Channels out;
  Index next = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const StridedMap map = map_view(views[i], names[i]);
    if (i == 0) out.signals.resize(map.rows(), columns);
    require(map.rows() == out.signals.rows(), names[i],
            std::string(names[i]) + " has " + std::to_string(map.rows()) + " rows and " + names[0] +
                " " + std::to_string(out.signals.rows()));
    out.signals.middleCols(next, map.cols()) = map;
    out.groups.emplace_back();
    for (Index c = 0; c < map.cols(); ++c) out.groups.back().push_back(next + c);
    next += map.cols();
  }
  return out;
}

Matrix table_of(const FrequencyResponse& r, Index more = 0) {
  const Index inputs = r.h.front().cols();
  const Index count = r.h.front().size();
  Matrix table(r.freq_hz.size(), 1 + 3 * count + more);
  table.col(0) = r.freq_hz;
  for (Index f = 0; f < table.rows(); ++f) {
    const auto bin = static_cast<std::size_t>(f);
    for (Index k = 0; k < count; ++k) {
      const auto value = r.h[bin](k / inputs, k % inputs);
      table(f, 1 + 3 * k) = value.real();
      table(f, 2 + 3 * k) = value.imag();
      table(f, 3 + 3 * k) = r.radius[bin](k / inputs, k % inputs);
    }
  }
  return table;
}

// Answers a question for the count before any work is done.
bool only_count(int64_t count, const double* out, int64_t capacity, int64_t* out_count) {
  if (out != nullptr || capacity != 0) return false;
  deref(out_count, "out_count") = count;
  return true;
}

}  // namespace

ulna_status ulna_frf_closed_loop(const ulna_view* references, const ulna_view* inputs,
                                 const ulna_view* outputs, double rate_hz,
                                 const ulna_frf_options* options, ulna_token* token, double* out,
                                 int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Request r = request_of(options);
    const Channels c =
        channels_of({references, inputs, outputs}, {"references", "inputs", "outputs"});
    const Index rows = c.signals.rows();
    const Index segment =
        r.options.segment == 0 ? std::min(kDefaultSegment, rows) : r.options.segment;
    require(segment >= 2 && segment <= rows, "segment",
            "a segment must have at least 2 samples and fit into the record");
    const auto pairs = static_cast<int64_t>(c.groups[1].size() * c.groups[2].size());
    if (only_count((segment / 2 + 1) * (1 + 3 * pairs), out, capacity, out_count)) return;
    const Spectra spectra = welch(c.signals, rate_hz, segment, r.ranges, token_of(token));
    const Matrix table = table_of(
        closed_loop_response(spectra, c.groups[0], c.groups[1], c.groups[2], r.confidence));
    write_array(table.data(), table.size(), out, capacity, out_count);
  });
}

ulna_status ulna_frf_periodic(const ulna_view* inputs, const ulna_view* outputs, double rate_hz,
                              const ulna_frf_options* options, ulna_token* token, double* out,
                              int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Request r = request_of(options);
    const Matrix u = map_view(inputs, "inputs");
    const Matrix y = map_view(outputs, "outputs");
    check_period(r.options.period, u.rows());
    const int64_t pairs = u.cols() * y.cols();
    if (only_count((r.options.period / 2 + 1) * (1 + 3 * pairs), out, capacity, out_count)) return;
    const Index skip = r.options.skip == 0 ? 1 : std::max<Index>(0, r.options.skip);
    const Matrix table = table_of(periodic_response(u, y, rate_hz, r.options.period, skip, r.ranges,
                                                    r.confidence, token_of(token)));
    write_array(table.data(), table.size(), out, capacity, out_count);
  });
}

ulna_status ulna_frf_local(const ulna_view* inputs, const ulna_view* outputs, double rate_hz,
                           const ulna_frf_options* options, ulna_token* token, double* out,
                           int64_t capacity, int64_t* out_count) {
  return guarded([&] {
    const Request r = request_of(options);
    const Matrix u = map_view(inputs, "inputs");
    const Matrix y = map_view(outputs, "outputs");
    LocalPolynomial local = local_of(r.options);
    const Index bins = local_frequencies(u.rows(), u.cols(), rate_hz, r.ranges, local).size();
    const int64_t columns = 1 + 3 * u.cols() * y.cols() + 2 * y.cols();
    if (only_count(bins * columns, out, capacity, out_count)) return;
    const LocalResponse l =
        local_response(u, y, rate_hz, r.ranges, local, r.confidence, token_of(token));
    Matrix table = table_of(l.response, 2 * y.cols());
    table.rightCols(2 * y.cols()) << l.coherence.raw, l.coherence.corrected;
    write_array(table.data(), table.size(), out, capacity, out_count);
  });
}
