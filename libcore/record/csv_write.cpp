#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <system_error>

#include "base/error.hpp"
#include "record/csv.hpp"
#include "record/csv_notes.hpp"

namespace ulna {
namespace {

struct Close {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};

void append_number(std::string& out, double value) {
  if (value != value) {
    out += "nan";
    return;
  }
  char text[40];
  const auto result = std::to_chars(text, text + sizeof text, value);
  out.append(text, result.ptr);
}

std::string heading(const Channel& channel) {
  // Always a bracketed unit, so that a name such as "x_m" is not taken apart.
  std::string out = "\"";
  for (const char c : channel.name + " [" + channel.unit + "]") {
    out += c;
    if (c == '"') out += '"';
  }
  return out + "\"";
}

[[noreturn]] void refuse_write(const std::string& path, int code) {
  throw Error(Fault::kFile, "path",
              "\"" + path + "\" cannot be written: " + std::generic_category().message(code), path);
}

// A neighbour of the file that takes its place when it is whole: a full disk or a cancelled call
// leaves what was there before. Devices and pipes are written directly.
class WholeFile {
 public:
  explicit WholeFile(const std::string& path) : path_(path), written_(path) {
    std::error_code ignored;
    const std::filesystem::file_status status = std::filesystem::status(path, ignored);
    if (!std::filesystem::exists(status)) {
      written_ += ".part";
    } else if (std::filesystem::is_regular_file(status)) {
      // A link stays a link: what it names is replaced.
      path_ = std::filesystem::canonical(path, ignored).string();
      if (path_.empty()) path_ = path;
      written_ = path_ + ".part";
    }
    file_.reset(std::fopen(written_.c_str(), "wb"));
    if (file_ == nullptr) refuse_write(path, errno);
  }
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;
  ~WholeFile() {
    if (file_ == nullptr) return;
    file_.reset();
    if (written_ != path_) std::remove(written_.c_str());
  }

  void write(const std::string& text) {
    errno = 0;
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size())
      refuse_write(path_, errno);
  }
  void finish() {
    // The last bytes may fail only now.
    errno = 0;
    if (std::fflush(file_.get()) != 0) refuse_write(path_, errno);
    if (written_ != path_ && std::rename(written_.c_str(), path_.c_str()) != 0) {
      refuse_write(path_, errno);
    }
    file_.reset();
  }

 private:
  std::string path_;
  std::string written_;
  std::unique_ptr<std::FILE, Close> file_;
};

}  // namespace

void write_csv(const Record& record, const std::string& path, Token* token) {
  WholeFile file(path);
  std::string out = format_notes(record) + "time [s]";
  for (const Channel& channel : record.channels()) out.append(",").append(heading(channel));
  out += "\n";
  const Matrix& values = record.values();
  for (Index i = 0; i < record.rows(); ++i) {
    append_number(out, record.time()[static_cast<std::size_t>(i)]);
    for (Index c = 0; c < values.cols(); ++c) {
      out += ',';
      append_number(out, values(i, c));
    }
    out += '\n';
    if (out.size() < 65536 && i + 1 < record.rows()) continue;
    file.write(out);
    out.clear();
    step(token, static_cast<double>(i + 1) / static_cast<double>(record.rows()));
  }
  file.finish();
}

}  // namespace ulna
