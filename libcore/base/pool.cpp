#include "base/pool.hpp"

#include <algorithm>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace ulna {

void parallel_for(std::ptrdiff_t count, int threads,
                  const std::function<void(std::ptrdiff_t)>& task, Token* token) {
  if (count <= 0) return;
  const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  threads = threads <= 0 ? processors : std::min(threads, 8 * processors);
  threads = static_cast<int>(std::min<std::ptrdiff_t>(threads, count));

  std::atomic<std::ptrdiff_t> next{0};
  std::atomic<std::ptrdiff_t> finished{0};
  std::atomic<bool> stop{false};
  std::mutex mutex;
  std::exception_ptr failure;
  std::ptrdiff_t failed_at = count;

  const auto work = [&] {
    while (!stop.load(std::memory_order_relaxed)) {
      const std::ptrdiff_t i = next.fetch_add(1);
      if (i >= count) return;
      try {
        step(token, static_cast<double>(finished.load()) / static_cast<double>(count));
        task(i);
        finished.fetch_add(1);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (i < failed_at) {
          failed_at = i;
          failure = std::current_exception();
        }
        stop.store(true);
      }
    }
  };

  {
    // Joined by the destructor, also when starting a later thread throws.
    std::vector<std::jthread> helpers;
    helpers.reserve(static_cast<std::size_t>(threads - 1));
    for (int k = 1; k < threads; ++k) helpers.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace ulna
