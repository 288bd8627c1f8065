// The reader of text tables on arbitrary bytes: it reads a record or refuses, and touches nothing
// outside of a buffer of exactly the input's size.
#include <ulna/record.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::unique_ptr<char[]> exact(new char[size]);
  std::copy(data, data + size, exact.get());
  // With and without a clock, so that texts without a time column get further than the heading.
  for (const double rate_hz : {0.0, 1000.0}) {
    ulna_read_options options = {};
    options.struct_size = sizeof options;
    options.rate_hz = rate_hz;
    ulna_record* record = nullptr;
    const ulna_status status = ulna_record_read_csv_memory(
        exact.get(), static_cast<std::int64_t>(size), &options, nullptr, &record);
    if (status == ULNA_ERROR_INTERNAL) std::abort();
    if ((status == ULNA_OK) != (record != nullptr)) std::abort();
    ulna_record_free(record);
  }
  return 0;
}
