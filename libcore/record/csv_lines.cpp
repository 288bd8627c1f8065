#include "record/csv_lines.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "base/error.hpp"

namespace ulna {
namespace {
constexpr std::size_t kBuffer = std::size_t{1} << 20;
constexpr std::size_t kLongestLine = std::size_t{1} << 24;
}  // namespace

LineReader::LineReader(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw Error(Fault::kFile, "path", "\"" + path + "\" is a folder: give a file in it", path);
  }
  file_.reset(std::fopen(path.c_str(), "rb"));
  if (file_ == nullptr) {
    throw Error(Fault::kFile, "path",
                "\"" + path + "\" cannot be opened: " + std::generic_category().message(errno),
                path);
  }
  const std::uintmax_t size = std::filesystem::file_size(path, ignored);
  total_ = ignored ? 0 : static_cast<std::uint64_t>(size);
  buffer_.resize(kBuffer);
  start_ = begin_ = at_ = end_ = buffer_.data();
  at_end_ = false;
  refill();
}

LineReader::LineReader(const char* data, std::size_t size)
    : start_(data), begin_(data), at_(data), end_(data + size), total_(size) {}

double LineReader::progress() const noexcept {
  if (total_ == 0) return 0.0;
  return std::min(1.0, static_cast<double>(consumed()) / static_cast<double>(total_));
}

// Moves what is left to the front and fills up; a line longer than the buffer makes it grow.
bool LineReader::refill() {
  if (at_end_) return false;
  const std::size_t left = static_cast<std::size_t>(end_ - at_);
  before_ += static_cast<std::uint64_t>(at_ - start_);
  std::memmove(buffer_.data(), at_, left);
  if (left == buffer_.size()) {
    if (left >= kLongestLine) {
      throw Error(Fault::kFormat, "path",
                  "a line is longer than 16 MiB: the file is no table of rows and columns");
    }
    buffer_.resize(2 * buffer_.size());
  }
  const std::size_t got = std::fread(buffer_.data() + left, 1, buffer_.size() - left, file_.get());
  if (got < buffer_.size() - left) {
    if (std::ferror(file_.get()) != 0)
      throw Error(Fault::kFile, "path", "the file cannot be read to its end");
    at_end_ = true;
  }
  start_ = begin_ = at_ = buffer_.data();
  end_ = at_ + left + got;
  return got > 0;
}

bool LineReader::next(FileLine& line) {
  std::size_t searched = 0;
  while (true) {
    const std::size_t left = static_cast<std::size_t>(end_ - at_);
    const void* found =
        left > searched ? std::memchr(at_ + searched, end_of_line_, left - searched) : nullptr;
    if (found != nullptr) {
      const char* stop = static_cast<const char*>(found);
      line = {std::string_view(at_, static_cast<std::size_t>(stop - at_)), true};
      at_ = stop + 1;
      break;
    }
    searched = left;
    if (refill()) continue;
    if (at_ == end_) return false;
    line = {std::string_view(at_, static_cast<std::size_t>(end_ - at_)), false};
    at_ = end_;
    break;
  }
  if (!line.text.empty() && line.text.back() == '\r') line.text.remove_suffix(1);
  return true;
}

}  // namespace ulna
