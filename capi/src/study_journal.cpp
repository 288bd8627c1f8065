// The journal of a study; declared in study.h.
#include <ulna/study.h>

#include <algorithm>
#include <memory>

#include "guard.hpp"
#include "handles.hpp"
#include "study.hpp"
#include "study/journal.hpp"

using namespace ulna;
using namespace ulna::capi;

namespace {

JournalSpec journal_spec(const char* folder, const char* plan, const char* writer,
                         const ulna_journal_options* given) {
  const ulna_journal_options o = read_options(given, "options");
  JournalSpec out;
  out.folder = &deref(folder, "folder");
  out.plan = &deref(plan, "plan");
  if (writer != nullptr) {
    out.writer = writer;
    require(!out.writer.empty(), "writer", "a writer needs a name; NULL only reads");
  }
  out.rows = o.rows;
  if (o.outputs != 0) out.outputs = o.outputs;
  if (o.sync_s != 0.0) out.sync_s = std::max(0.0, o.sync_s);
  return out;
}

}  // namespace

ulna_status ulna_journal_open(const char* folder, const char* plan, const char* writer,
                              const ulna_journal_options* options, ulna_journal** out_journal) {
  return guarded([&] {
    ulna_journal*& out = deref(out_journal, "out_journal");
    auto handle = std::make_unique<ulna_journal>();
    handle->journal = std::make_unique<Journal>(journal_spec(folder, plan, writer, options));
    out = handle.release();
  });
}

void ulna_journal_free(ulna_journal* journal) { delete journal; }

ulna_status ulna_journal_append(ulna_journal* journal, int64_t row, int32_t status, double wall_s,
                                const double* values, const char* message) {
  return guarded([&] {
    deref(journal, "journal")
        .journal->append(row, status, wall_s, &deref(values, "values"),
                         message == nullptr ? "" : message);
  });
}

ulna_status ulna_journal_sync(ulna_journal* journal) {
  return guarded([&] { deref(journal, "journal").journal->sync(); });
}

ulna_status ulna_journal_get_info(const ulna_journal* journal, ulna_journal_info* out_info) {
  return guarded([&] {
    const Journal& j = *deref(journal, "journal").journal;
    ulna_journal_info info = {};
    info.rows = j.rows();
    info.outputs = j.outputs();
    info.records = j.records();
    info.damaged_bytes = j.damaged_bytes();
    j.hash().copy(info.hash, sizeof info.hash - 1);
    write_result(out_info, info, "out_info");
  });
}

ulna_status ulna_journal_get_status(const ulna_journal* journal, int32_t* out, int64_t capacity,
                                    int64_t* out_count) {
  return guarded([&] {
    const std::vector<std::int32_t> status = deref(journal, "journal").journal->status();
    const auto size = static_cast<int64_t>(status.size());
    if (study_count_only(size, out, capacity, out_count)) return;
    std::copy(status.begin(), status.end(), out);
    *out_count = size;
  });
}

ulna_status ulna_journal_get_times(const ulna_journal* journal, double* out, int64_t capacity,
                                   int64_t* out_count) {
  return guarded([&] {
    const Vector times = deref(journal, "journal").journal->wall_s();
    write_array(times.data(), times.size(), out, capacity, out_count);
  });
}

ulna_status ulna_journal_get_values(const ulna_journal* journal, double* out, int64_t capacity,
                                    int64_t* out_count) {
  return guarded([&] {
    const PointRows values = deref(journal, "journal").journal->values();
    write_array(values.data(), values.size(), out, capacity, out_count);
  });
}

ulna_status ulna_journal_get_message(const ulna_journal* journal, int64_t row, char* out_text,
                                     int64_t capacity, int64_t* out_size) {
  return guarded([&] {
    write_text(deref(journal, "journal").journal->message(row), out_text, capacity, out_size);
  });
}
