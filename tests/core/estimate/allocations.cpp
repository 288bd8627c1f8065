#include "allocations.hpp"

#include <atomic>
#include <cstddef>

namespace {
std::atomic<bool> counting{false};
std::atomic<long> count{0};
}  // namespace

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__)
// The C library's own name of its allocator.
extern "C" void* __libc_malloc(std::size_t size);  // NOLINT
extern "C" void* malloc(std::size_t size) {
  if (counting.load(std::memory_order_relaxed)) count.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
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
