#include "study/journal.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

static_assert(std::endian::native == std::endian::little, "journals are little endian");

namespace fs = std::filesystem;

constexpr char kFileMark[] = "ULNAJRN1";
constexpr char kRecordMark[] = "ULNR";
constexpr std::size_t kHeaderSize = 8 + 32 + 16 + 8;
constexpr std::size_t kFixed = 8 + 4 + 4 + 8;  // row, status, message size, wall_s
constexpr std::size_t kMaxMessage = 4096;
constexpr Index kJournalRows = Index{1} << 32;
// As the study numbers them: timeout and crashed.
constexpr std::int32_t kTimeout = 4;
constexpr std::int32_t kCrashed = 7;

[[noreturn]] void fail_at(const std::string& what, const std::string& path, int error) {
  throw Error(Fault::kFile, "folder", what + " " + path + ": " + std::strerror(error), path);
}

void put_bytes(std::string& to, const void* bytes, std::size_t size) {
  to.append(static_cast<const char*>(bytes), size);
}

template <class T>
T get_number(const char* from) {
  T out;
  std::memcpy(&out, from, sizeof out);
  return out;
}

double steady_now_s() {
  const auto since = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(since).count();
}

// All of it or nothing: what a full disk cut off is taken back.
void write_whole(int file, const std::string& bytes, Index size_before, const std::string& path) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::write(file, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      const int error = count < 0 ? errno : ENOSPC;
      // A failure here leaves a torn record, which readers skip.
      if (done > 0 && ::ftruncate(file, static_cast<off_t>(size_before)) != 0) errno = error;
      fail_at("a result cannot be written to", path, error);
    }
    done += static_cast<std::size_t>(count);
  }
}

std::string journal_header(const Digest& digest, Index rows, Index outputs) {
  std::string out(kFileMark, 8);
  put_bytes(out, digest.data(), digest.size());
  const std::int64_t size[] = {rows, outputs};
  put_bytes(out, size, sizeof size);
  const std::uint64_t sum = siphash(digest, out.data(), out.size());
  put_bytes(out, &sum, sizeof sum);
  return out;
}

std::string read_journal_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) fail_at("cannot open", path, errno);
  std::string out((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (in.bad()) fail_at("cannot read", path, EIO);
  return out;
}

bool good_writer_name(const std::string& writer) {
  return writer.size() <= 100 && std::all_of(writer.begin(), writer.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '-' || c == '_' || c == '.';
         });
}

}  // namespace

bool is_transient(std::int32_t status) noexcept { return status == kTimeout || status == kCrashed; }

Journal::Journal(const JournalSpec& spec) : spec_(spec), digest_(sha256(spec.plan)) {
  require(!spec.folder.empty(), "folder", "a journal needs a folder");
  require(spec.rows >= 1 && spec.rows <= kJournalRows, "rows", "rows must be from 1 to 2^32");
  require(spec.outputs >= 1 && spec.outputs <= 1000000, "outputs",
          "outputs must be from 1 to a million");
  require(good_writer_name(spec.writer), "writer",
          "the name of a writer may hold letters, digits, '-', '_' and '.' only");
  require(spec.sync_s >= 0.0, "sync_s", "sync_s must be at least 0");
  hash_ = hex(digest_);
  const auto rows = static_cast<std::size_t>(spec.rows);
  status_.assign(rows, kNotRun);
  wall_s_.assign(rows, kNaN);
  values_.assign(rows * static_cast<std::size_t>(spec.outputs), kNaN);
  make_plan();
  std::vector<std::string> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(spec.folder, error)) {
    if (entry.path().extension() == ".journal") files.push_back(entry.path().string());
  }
  if (error) fail_at("cannot list", spec.folder, error.value());
  // The own file is locked before it is read: nobody else appends to it from then on.
  if (!spec.writer.empty()) open_own();
  try {
    std::sort(files.begin(), files.end());
    for (const std::string& file : files) read_file(file);
  } catch (...) {
    if (own_ >= 0) ::close(own_);
    throw;
  }
}

Journal::~Journal() {
  if (own_ < 0) return;
  ::fdatasync(own_);
  ::close(own_);
}

void Journal::make_plan() {
  std::error_code error;
  const std::string path = (fs::path(spec_.folder) / "plan.json").string();
  if (!fs::exists(path, error)) {
    if (spec_.writer.empty()) fail_at("there is no study in", spec_.folder, ENOENT);
    fs::create_directories(spec_.folder, error);
    if (error) fail_at("cannot make", spec_.folder, error.value());
    // Whole or not at all: under another name first. A writer that comes first wins; the plans are
    // compared below.
    std::string other = path + ".XXXXXX";
    const int file = ::mkstemp(other.data());
    if (file < 0) fail_at("cannot write into", spec_.folder, errno);
    try {
      write_whole(file, spec_.plan, 0, other);
      if (::fchmod(file, 0644) != 0 || ::fsync(file) != 0) fail_at("cannot write", other, errno);
    } catch (...) {
      ::close(file);
      ::unlink(other.c_str());
      throw;
    }
    ::close(file);
    const int linked = ::link(other.c_str(), path.c_str());
    const int reason = errno;
    ::unlink(other.c_str());
    if (linked != 0 && reason != EEXIST) fail_at("cannot write", path, reason);
  }
  if (sha256(read_journal_file(path)) != digest_) {
    throw Error(Fault::kData, "folder",
                spec_.folder +
                    " holds the results of another plan: use another folder, or go back to the "
                    "study it was made with (its plan.json)",
                path);
  }
}

void Journal::open_own() {
  own_path_ = (fs::path(spec_.folder) / (spec_.writer + ".journal")).string();
  own_ = ::open(own_path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (own_ < 0) fail_at("cannot open", own_path_, errno);
  try {
    if (::flock(own_, LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK) fail_at("cannot lock", own_path_, errno);
      throw Error(Fault::kFile, "writer",
                  "another process writes to " + own_path_ +
                      ": wait for it, or give this one a writer of its own",
                  own_path_);
    }
    struct stat about;
    if (::fstat(own_, &about) != 0) fail_at("cannot read", own_path_, errno);
    own_size_ = static_cast<Index>(about.st_size);
    if (own_size_ < static_cast<Index>(kHeaderSize)) {
      // New, or killed within its first write.
      if (own_size_ > 0 && ::ftruncate(own_, 0) != 0) fail_at("cannot write", own_path_, errno);
      const std::string bytes = journal_header(digest_, spec_.rows, spec_.outputs);
      write_whole(own_, bytes, 0, own_path_);
      own_size_ = static_cast<Index>(bytes.size());
    }
  } catch (...) {
    ::close(own_);
    own_ = -1;
    throw;
  }
  last_sync_s_ = steady_now_s();
}

void Journal::read_file(const std::string& path) {
  const std::string bytes = read_journal_file(path);
  if (bytes.size() < kHeaderSize) {
    damaged_ += static_cast<Index>(bytes.size());
    return;
  }
  if (bytes.compare(0, kHeaderSize, journal_header(digest_, spec_.rows, spec_.outputs)) != 0) {
    throw Error(Fault::kFormat, "folder",
                path +
                    " is no journal of this plan, or its first bytes are damaged: move it away "
                    "to go on without its results",
                path);
  }
  const auto outputs = static_cast<std::size_t>(spec_.outputs);
  const std::size_t least = kFixed + 8 * outputs + 8;
  std::size_t at = kHeaderSize;
  while (at < bytes.size()) {
    const char* p = bytes.data() + at;
    const std::size_t left = bytes.size() - at;
    std::size_t size = 0;
    bool good = left >= 8 && std::memcmp(p, kRecordMark, 4) == 0;
    if (good) {
      size = get_number<std::uint32_t>(p + 4);
      good = size >= least && size <= least + kMaxMessage + 8 && left >= 8 + size &&
             siphash(digest_, p, size) == get_number<std::uint64_t>(p + size);
    }
    if (!good) {
      // Up to the next mark; what was skipped is counted and nothing else is done about it.
      const std::size_t next = bytes.find(kRecordMark, at + 1, 4);
      const std::size_t to = next == std::string::npos ? bytes.size() : next;
      damaged_ += static_cast<Index>(to - at);
      at = to;
      continue;
    }
    const auto row = static_cast<Index>(get_number<std::int64_t>(p + 8));
    const auto message = static_cast<std::size_t>(get_number<std::int32_t>(p + 20));
    std::vector<double> values(outputs);
    std::memcpy(values.data(), p + 8 + kFixed, 8 * outputs);
    if (row < 0 || row >= spec_.rows || message > kMaxMessage || least + message > size) {
      throw Error(Fault::kFormat, "folder",
                  path + " holds a record of a newer kind: read it with a newer release", path);
    }
    take(row, get_number<std::int32_t>(p + 16), get_number<double>(p + 24), values.data(),
         std::string(p + 8 + kFixed + 8 * outputs, message), path);
    ++records_;
    at += 8 + size;
  }
}

// Whether the record changed what is known of its row.
bool Journal::take(Index row, std::int32_t status, double wall_s, const double* values,
                   std::string message, const std::string& place) {
  const auto at = static_cast<std::size_t>(row);
  const auto outputs = static_cast<std::size_t>(spec_.outputs);
  std::int32_t& known = status_[at];
  if (known != kNotRun && !is_transient(known)) {
    if (is_transient(status)) return false;
    if (status != known || std::memcmp(values, &values_[at * outputs], 8 * outputs) != 0) {
      throw Error(Fault::kData, "row",
                  sentence(17, "run ", row, " has two different results, the second in ", place,
                           ": the function is not a pure function of its row, or it was changed"),
                  sentence(17, "row ", row));
    }
    return false;
  }
  known = status;
  wall_s_[at] = wall_s;
  std::copy_n(values, outputs, values_.begin() + static_cast<std::ptrdiff_t>(at * outputs));
  if (message.empty()) {
    messages_.erase(row);
  } else {
    messages_[row] = std::move(message);
  }
  return true;
}

void Journal::append(Index row, std::int32_t status, double wall_s, const double* values,
                     const std::string& message) {
  require(row >= 0 && row < spec_.rows, "row",
          sentence(17, "row is ", row, "; rows are 0 to ", spec_.rows - 1));
  require(status >= 0 && status < 1024, "status", "status must be from 0 to 1023");
  const std::lock_guard lock(mutex_);
  require(own_ >= 0, "writer", "this journal was opened to be read: give it a writer");
  const std::string words = message.substr(0, kMaxMessage);
  std::string rest;
  const std::int64_t number = row;
  const std::int32_t small[] = {status, static_cast<std::int32_t>(words.size())};
  put_bytes(rest, &number, sizeof number);
  put_bytes(rest, small, sizeof small);
  put_bytes(rest, &wall_s, sizeof wall_s);
  put_bytes(rest, values, 8 * static_cast<std::size_t>(spec_.outputs));
  rest += words;
  while (rest.size() % 8 != 0) rest += '\0';
  std::string bytes(kRecordMark, 4);
  const auto size = static_cast<std::uint32_t>(rest.size() + 8);
  put_bytes(bytes, &size, sizeof size);
  bytes += rest;
  const std::uint64_t sum = siphash(digest_, bytes.data(), size);
  put_bytes(bytes, &sum, sizeof sum);
  if (!take(row, status, wall_s, values, words, own_path_)) return;
  try {
    write_whole(own_, bytes, own_size_, own_path_);
  } catch (...) {
    status_[static_cast<std::size_t>(row)] = kNotRun;
    throw;
  }
  own_size_ += static_cast<Index>(bytes.size());
  ++records_;
  if (steady_now_s() - last_sync_s_ >= spec_.sync_s) sync_locked();
}

void Journal::sync() {
  const std::lock_guard lock(mutex_);
  if (own_ >= 0) sync_locked();
}

void Journal::sync_locked() {
  if (::fdatasync(own_) != 0) fail_at("cannot sync", own_path_, errno);
  last_sync_s_ = steady_now_s();
}

std::vector<std::int32_t> Journal::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

Vector Journal::wall_s() const {
  const std::lock_guard lock(mutex_);
  return Eigen::Map<const Vector>(wall_s_.data(), spec_.rows);
}

Matrix Journal::values() const {
  const std::lock_guard lock(mutex_);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(values_.data(), spec_.rows, spec_.outputs);
}

std::string Journal::message(Index row) const {
  require(row >= 0 && row < spec_.rows, "row",
          sentence(17, "row is ", row, "; rows are 0 to ", spec_.rows - 1));
  const std::lock_guard lock(mutex_);
  const auto found = messages_.find(row);
  return found == messages_.end() ? std::string() : found->second;
}

}  // namespace ulna
