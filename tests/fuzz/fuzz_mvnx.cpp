// The frames of an MVNX file on arbitrary bytes: they are read or refused, whole and in pieces
// alike, and nothing outside of a buffer of exactly the input's size is touched.
#include <ulna/mvnx.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>

namespace {

constexpr std::int64_t kRefused = -1;

// Frames that were read, or kRefused.
std::int64_t frames_of(const std::uint8_t* data, std::size_t size, std::size_t piece) {
  const char* elements[] = {"orientation", "position"};
  ulna_mvnx_frames* frames = nullptr;
  if (ulna_mvnx_frames_new("input", elements, 2, 1, &frames) != ULNA_OK) std::abort();
  std::int64_t count = 0;
  for (std::size_t at = 0; at < size && count != kRefused; at += piece) {
    const std::size_t length = std::min(piece, size - at);
    const std::unique_ptr<char[]> exact(new char[length]);
    std::copy_n(data + at, length, exact.get());
    std::int64_t used = 0;
    std::int32_t done = 0;
    const ulna_status status =
        ulna_mvnx_frames_push(frames, exact.get(), static_cast<std::int64_t>(length), &used, &done);
    if (status != ULNA_OK && status != ULNA_ERROR_FORMAT) std::abort();
    if (status != ULNA_OK) count = kRefused;
    if (done != 0) break;
  }
  std::int64_t line = 0;
  if (count != kRefused && ulna_mvnx_frames_size(frames, &count, &line) != ULNA_OK) std::abort();
  ulna_mvnx_frames_free(frames);
  return count;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::int64_t whole = frames_of(data, size, std::max<std::size_t>(size, 1));
  if (frames_of(data, size, 13) != whole) std::abort();
  return 0;
}
