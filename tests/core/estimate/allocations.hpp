// Counts allocations of a piece of code, of C++ and of Eigen alike.
#pragma once

#include <functional>

namespace ulna::made {

// Calls of malloc while `code` ran; -1 where a sanitizer has taken malloc over.
long allocations_of(const std::function<void()>& code);

}  // namespace ulna::made
