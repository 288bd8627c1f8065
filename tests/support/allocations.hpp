// Counts allocations of a piece of code: of C, of C++ and of Eigen, here and in shared libraries.
#pragma once

#include <functional>

namespace ulna::made {

// Calls of the allocator while `code` ran; -1 where a sanitizer has taken it over.
long allocations_of(const std::function<void()>& code);

}  // namespace ulna::made
