// The results of a study on disk, safe against any kill: a folder with an immutable plan and one
// append-only file for each writer.
//
//   plan.json          the plan, any text; its SHA-256 names the study
//   <writer>.journal   a header, then records
//
// Header: "ULNAJRN1", the plan's digest (32 bytes), rows, outputs (int64 each), checksum.
// Record: "ULNR", bytes before the checksum (uint32), row (int64), status, size of the message
// (int32 each), wall_s, outputs (double each), message, zeros up to a multiple of 8, checksum.
// Little endian; the checksum is SipHash-2-4 keyed by the digest, of all that precedes it.
//
// A record leaves in one write with O_APPEND: a killed process loses nothing that append() returned
// from, a failing machine at most what was appended since the last sync(). A damaged stretch (the
// end of a write that was cut off) is skipped to the next record with a good checksum. A row is
// done when a good record exists. A transient status gives way to any other; two others of one row
// must agree bit for bit, since a row is a pure function of the plan.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/types.hpp"
#include "study/checksum.hpp"

namespace ulna {

inline constexpr std::int32_t kNotRun = -1;

// Statuses whose cause may be the machine and not the row.
bool is_transient(std::int32_t status) noexcept;

struct JournalSpec {
  std::string folder;
  std::string plan;
  Index rows = 0;
  Index outputs = 1;
  std::string writer;   // name of the own file, without its ending; empty: read only
  double sync_s = 1.0;  // append() syncs when the last sync is longer ago; 0: every record
};

class Journal {
 public:
  // Makes the folder and the plan when there are none; refuses another plan. Reads every writer.
  explicit Journal(const JournalSpec& spec);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // Adds the result of a row: `values` has outputs numbers. Refuses a row whose final result
  // differs.
  void append(Index row, std::int32_t status, double wall_s, const double* values,
              const std::string& message);
  void sync();

  const std::string& hash() const noexcept { return hash_; }
  Index rows() const noexcept { return spec_.rows; }
  Index outputs() const noexcept { return spec_.outputs; }
  Index records() const noexcept { return records_; }
  Index damaged_bytes() const noexcept { return damaged_; }
  // Copies, since another thread may append.
  std::vector<std::int32_t> status() const;  // kNotRun where a row has no record
  Vector wall_s() const;                     // NaN there
  Matrix values() const;                     // rows x outputs, NaN there
  std::string message(Index row) const;

 private:
  void read_file(const std::string& path);
  bool take(Index row, std::int32_t status, double wall_s, const double* values,
            std::string message, const std::string& place);
  void open_own();
  void make_plan();
  void sync_locked();

  JournalSpec spec_;
  Digest digest_;
  std::string hash_;
  std::string own_path_;
  int own_ = -1;
  Index own_size_ = 0;
  double last_sync_s_ = 0.0;
  Index records_ = 0;
  Index damaged_ = 0;
  std::vector<std::int32_t> status_;
  std::vector<double> wall_s_;
  std::vector<double> values_;
  std::map<Index, std::string> messages_;
  mutable std::mutex mutex_;
};

}  // namespace ulna
