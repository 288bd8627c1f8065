// Where exceptions stop. Every function of the interface is `return guarded([&] { ... });`.
#pragma once

#include <ulna/base.h>

#include <cstddef>
#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/error.hpp"
#include "base/types.hpp"

namespace ulna::capi {

ulna_status set_last_error(Fault fault, std::string_view argument, std::string_view message,
                           std::string_view detail) noexcept;
ulna_status set_last_error_from_current_exception() noexcept;

template <class Body>
ulna_status guarded(Body&& body) noexcept {
  try {
    std::forward<Body>(body)();
    return ULNA_OK;
  } catch (...) {
    return set_last_error_from_current_exception();
  }
}

// A handle argument or output pointer that must not be NULL.
template <class T>
T& deref(T* pointer, const char* argument) {
  if (pointer == nullptr) {
    throw Error(Fault::kArgument, argument, std::string(argument) + " must not be NULL");
  }
  return *pointer;
}

using StridedMap = Eigen::Map<const Matrix, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;

// A borrowed view as an Eigen expression; refuses NULL data and negative sizes.
StridedMap map_view(const ulna_view* view, const char* argument);

// Options as the caller's build knows them, widened to ours: absent bytes are zero, unknown
// non-zero bytes are refused.
void check_options_size(const void* options, int64_t struct_size, std::size_t known,
                        const char* argument);

template <class Options>
Options read_options(const Options* options, const char* argument) {
  Options result;
  std::memset(&result, 0, sizeof result);
  if (options == nullptr) return result;
  check_options_size(options, options->struct_size, sizeof(Options), argument);
  const std::size_t size = static_cast<std::size_t>(options->struct_size);
  std::memcpy(&result, options, size < sizeof result ? size : sizeof result);
  if constexpr (requires { result.reserved; }) {
    require(result.reserved == 0, argument,
            std::string(argument) + " has a reserved member that is not zero");
  }
  return result;
}

// Results as large as the caller's build knows them. `struct_size` is set by the caller.
void copy_result(void* out, const void* result, std::size_t known, const char* argument);

template <class Result>
void write_result(Result* out, Result result, const char* argument) {
  result.struct_size = deref(out, argument).struct_size;
  copy_result(out, &result, sizeof(Result), argument);
}

// Arrays and text out: capacity 0 with a NULL buffer asks for the count only.
void write_array(const double* values, int64_t count, double* out, int64_t capacity,
                 int64_t* out_count);
void write_text(const std::string& text, char* out, int64_t capacity, int64_t* out_size);

}  // namespace ulna::capi
