#include <ulna/base.h>

#include <algorithm>
#include <cmath>
#include <new>

#include "guard.hpp"
#include "handles.hpp"

namespace ulna::capi {
namespace {

// Trivial, so that recording an error cannot allocate or fail.
thread_local ulna_error last_error = {};

template <std::size_t N>
void copy_text(char (&out)[N], std::string_view text) noexcept {
  std::size_t size = std::min(text.size(), N - 1);
  // Never cut in the middle of a UTF-8 sequence.
  if (size < text.size()) {
    while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xC0u) == 0x80u) --size;
  }
  std::memcpy(out, text.data(), size);
  std::memset(out + size, 0, N - size);
}

ulna_status status_of(Fault fault) noexcept {
  switch (fault) {
    case Fault::kArgument:
      return ULNA_ERROR_ARGUMENT;
    case Fault::kData:
      return ULNA_ERROR_DATA;
    case Fault::kFile:
      return ULNA_ERROR_FILE;
    case Fault::kFormat:
      return ULNA_ERROR_FORMAT;
    case Fault::kAnalysis:
      return ULNA_ERROR_ANALYSIS;
    case Fault::kBuffer:
      return ULNA_ERROR_BUFFER;
    case Fault::kCancelled:
      return ULNA_ERROR_CANCELLED;
    case Fault::kMemory:
      return ULNA_ERROR_MEMORY;
    case Fault::kUnsupported:
      return ULNA_ERROR_UNSUPPORTED;
    case Fault::kInternal:
      return ULNA_ERROR_INTERNAL;
  }
  return ULNA_ERROR_INTERNAL;
}

}  // namespace

ulna_status set_last_error(Fault fault, std::string_view argument, std::string_view message,
                           std::string_view detail) noexcept {
  last_error.struct_size = sizeof last_error;
  last_error.status = status_of(fault);
  copy_text(last_error.argument, argument);
  copy_text(last_error.detail, detail);
  copy_text(last_error.message, message);
  return last_error.status;
}

ulna_status set_last_error_from_current_exception() noexcept {
  try {
    throw;
  } catch (const Error& error) {
    return set_last_error(error.fault(), error.argument(), error.what(), error.detail());
  } catch (const std::bad_alloc&) {
    return set_last_error(Fault::kMemory, {}, "not enough memory", {});
  } catch (const std::exception& error) {
    return set_last_error(Fault::kInternal, {}, error.what(), {});
  } catch (...) {
    return set_last_error(Fault::kInternal, {}, "an unknown exception was thrown", {});
  }
}

StridedMap map_view(const ulna_view* view, const char* argument) {
  const ulna_view& v = deref(view, argument);
  const std::string name(argument);
  require(v.rows >= 0 && v.cols >= 0, argument, name + " has a negative number of rows or columns");
  require(v.data != nullptr || v.rows == 0 || v.cols == 0, argument, name + " has no data");
  return StridedMap(v.data, v.rows, v.cols, {v.col_stride, v.row_stride});
}

void check_options_size(const void* options, int64_t struct_size, std::size_t known,
                        const char* argument) {
  const std::string name(argument);
  require(struct_size >= static_cast<int64_t>(sizeof struct_size) && struct_size <= 65536, argument,
          name + ".struct_size is not a size: set it to sizeof the struct");
  const auto* bytes = static_cast<const unsigned char*>(options);
  for (std::size_t i = known; i < static_cast<std::size_t>(struct_size); ++i) {
    require(bytes[i] == 0, argument, name + " uses an option that this release does not know");
  }
}

void copy_result(void* out, const void* result, std::size_t known, const char* argument) {
  int64_t size = 0;
  std::memcpy(&size, out, sizeof size);
  require(size >= static_cast<int64_t>(sizeof size) && size <= 65536, argument,
          std::string(argument) + ".struct_size is not a size: set it to sizeof the struct");
  const std::size_t wanted = static_cast<std::size_t>(size);
  std::memcpy(out, result, std::min(wanted, known));
  if (wanted > known) std::memset(static_cast<char*>(out) + known, 0, wanted - known);
}

void write_array(const double* values, int64_t count, double* out, int64_t capacity,
                 int64_t* out_count) {
  deref(out_count, "out_count");
  if (out != nullptr || capacity != 0) {
    deref(out, "out");
    if (capacity < count) {
      throw Error(Fault::kBuffer, "capacity",
                  "the buffer holds " + std::to_string(capacity) + " values, " +
                      std::to_string(count) + " are needed");
    }
    std::copy_n(values, count, out);
  }
  *out_count = count;
}

void write_text(const std::string& text, char* out, int64_t capacity, int64_t* out_size) {
  deref(out_size, "out_size");
  const int64_t size = static_cast<int64_t>(text.size()) + 1;
  if (out != nullptr || capacity != 0) {
    deref(out, "out");
    if (capacity < size) {
      throw Error(Fault::kBuffer, "capacity",
                  "the buffer holds " + std::to_string(capacity) + " bytes, " +
                      std::to_string(size) + " are needed");
    }
    std::memcpy(out, text.c_str(), static_cast<std::size_t>(size));
  }
  *out_size = size;
}

}  // namespace ulna::capi

using namespace ulna;
using namespace ulna::capi;

ulna_status ulna_error_last(ulna_error* out_error) {
  // Not guarded: a failure here must not overwrite the record that is asked for.
  if (out_error == nullptr || out_error->struct_size < static_cast<int64_t>(sizeof(int64_t))) {
    return ULNA_ERROR_ARGUMENT;
  }
  const int64_t size = out_error->struct_size;
  std::memcpy(out_error, &last_error,
              static_cast<std::size_t>(std::min<int64_t>(size, sizeof last_error)));
  out_error->struct_size = size;
  return ULNA_OK;
}

const char* ulna_status_name(ulna_status status) {
  switch (status) {
    case ULNA_OK:
      return "ULNA_OK";
    case ULNA_ERROR_ARGUMENT:
      return "ULNA_ERROR_ARGUMENT";
    case ULNA_ERROR_DATA:
      return "ULNA_ERROR_DATA";
    case ULNA_ERROR_FILE:
      return "ULNA_ERROR_FILE";
    case ULNA_ERROR_FORMAT:
      return "ULNA_ERROR_FORMAT";
    case ULNA_ERROR_ANALYSIS:
      return "ULNA_ERROR_ANALYSIS";
    case ULNA_ERROR_BUFFER:
      return "ULNA_ERROR_BUFFER";
    case ULNA_ERROR_CANCELLED:
      return "ULNA_ERROR_CANCELLED";
    case ULNA_ERROR_MEMORY:
      return "ULNA_ERROR_MEMORY";
    case ULNA_ERROR_UNSUPPORTED:
      return "ULNA_ERROR_UNSUPPORTED";
    case ULNA_ERROR_INTERNAL:
      return "ULNA_ERROR_INTERNAL";
    default:
      return nullptr;
  }
}

int32_t ulna_interface_number(void) { return ULNA_INTERFACE; }
const char* ulna_release(void) { return ULNA_RELEASE_TEXT; }
const char* ulna_build(void) { return ULNA_BUILD_TEXT; }

ulna_status ulna_token_new(ulna_token** out_token) {
  return guarded([&] {
    ulna_token*& out = deref(out_token, "out_token");  // before there is anything to leak
    out = new ulna_token;
  });
}

void ulna_token_free(ulna_token* token) { delete token; }

ulna_status ulna_token_cancel(ulna_token* token) {
  return guarded([&] { deref(token, "token").token.cancel(); });
}

ulna_status ulna_token_progress(const ulna_token* token, double* out_fraction) {
  return guarded(
      [&] { deref(out_fraction, "out_fraction") = deref(token, "token").token.progress(); });
}
