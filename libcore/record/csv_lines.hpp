// Lines of a text in a file or in memory, without copying those in memory.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace ulna {

struct FileLine {
  std::string_view text;    // without its end; valid until the next call
  bool terminated = false;  // false only for a last line without an end of line
};

class LineReader {
 public:
  explicit LineReader(const std::string& path);  // throws Error kFile
  LineReader(const char* data, std::size_t size);

  // The beginning of the text, at most 1 MiB; to be asked before the first next().
  std::string_view head() const noexcept {
    return {begin_, static_cast<std::size_t>(end_ - begin_)};
  }
  bool head_is_all() const noexcept { return file_ == nullptr || at_end_; }

  void use_end(char end) noexcept { end_of_line_ = end; }
  bool next(FileLine& line);

  std::uint64_t consumed() const noexcept {
    return before_ + static_cast<std::uint64_t>(at_ - start_);
  }
  double progress() const noexcept;

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };
  bool refill();

  std::unique_ptr<std::FILE, Close> file_;
  std::vector<char> buffer_;
  const char* start_ = nullptr;  // of the buffer or of the memory
  const char* begin_ = nullptr;  // of the head
  const char* at_ = nullptr;
  const char* end_ = nullptr;
  std::uint64_t before_ = 0;
  std::uint64_t total_ = 0;
  bool at_end_ = true;
  char end_of_line_ = '\n';
};

}  // namespace ulna
