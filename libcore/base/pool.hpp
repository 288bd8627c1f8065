// The one place that starts threads. Work items are independent and write to their own slot, so a
// result never depends on the number of threads; reductions are done by the caller in index order.
#pragma once

#include <cstddef>
#include <functional>

#include "base/token.hpp"

namespace ulna {

// Runs task(i) for i in [0, count) on `threads` threads (0: one per processor). The first exception
// by index is rethrown once all threads have stopped.
void parallel_for(std::ptrdiff_t count, int threads,
                  const std::function<void(std::ptrdiff_t)>& task, Token* token = nullptr);

}  // namespace ulna
