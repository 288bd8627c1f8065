#include "allocations.hpp"

#include <atomic>
#include <cstddef>

namespace {
std::atomic<bool> counting{false};
std::atomic<long> count{0};
}  // namespace

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__)
namespace {
void note() noexcept {
  if (counting.load(std::memory_order_relaxed)) count.fetch_add(1, std::memory_order_relaxed);
}
}  // namespace

// The C library's own names of its allocator. Those that a program shows stand before those of
// every library that it loads.
#define ULNA_SHOWN __attribute__((visibility("default")))
extern "C" {
void* __libc_malloc(std::size_t size);                           // NOLINT
void* __libc_calloc(std::size_t items, std::size_t size);        // NOLINT
void* __libc_realloc(void* old, std::size_t size);               // NOLINT
void* __libc_memalign(std::size_t alignment, std::size_t size);  // NOLINT

ULNA_SHOWN void* malloc(std::size_t size) {
  note();
  return __libc_malloc(size);
}
ULNA_SHOWN void* calloc(std::size_t items, std::size_t size) {
  note();
  return __libc_calloc(items, size);
}
ULNA_SHOWN void* realloc(void* old, std::size_t size) {
  note();
  return __libc_realloc(old, size);
}
ULNA_SHOWN void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
}
#define ULNA_COUNTS_ALLOCATIONS 1
#else
#define ULNA_COUNTS_ALLOCATIONS 0
#endif

namespace ulna::made {

long allocations_of(const std::function<void()>& code) {
  count = 0;
  counting = true;
  code();
  counting = false;
  return ULNA_COUNTS_ALLOCATIONS != 0 ? count.load() : -1;
}

}  // namespace ulna::made
