#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
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

}  // namespace

void write_csv(const Record& record, const std::string& path, Token* token) {
  std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "wb"));
  const auto refuse = [&](int code) {
    throw Error(Fault::kFile, "path",
                "\"" + path + "\" cannot be written: " + std::generic_category().message(code),
                path);
  };
  if (file == nullptr) refuse(errno);
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
    errno = 0;
    if (std::fwrite(out.data(), 1, out.size(), file.get()) != out.size()) refuse(errno);
    out.clear();
    step(token, static_cast<double>(i + 1) / static_cast<double>(record.rows()));
  }
  // The last bytes may fail only now.
  errno = 0;
  if (std::fflush(file.get()) != 0) refuse(errno);
}

}  // namespace ulna
