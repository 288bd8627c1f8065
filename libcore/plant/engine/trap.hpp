// Contains the engine's fatal errors. MuJoCo reports what it cannot go on from by calling a handler
// that must not return, and ends the process where there is none.
//
// The handler here jumps back to the frame that entered the engine (setjmp, longjmp), which is what
// the engine's own compiler does. An exception must not be thrown through the engine: its C code is
// compiled without the promise that frames can be unwound. The jump skips no destructors, because
// between the two frames there is only C. It is set per thread, through the functions that the
// engine's own Python binding uses, so that no process-wide handler of the application is touched.
// What the engine was working on is left half done: such a run may only be freed.
#pragma once

#include <string>

namespace ulna::engine {

// Calls `call(data)`; false when the engine gave up, with its words in `reason`. `call` must keep
// no object with a destructor in its frame. Warnings are kept for last_warning() and never printed.
bool run_contained(void (*call)(void*), void* data, std::string& reason);

template <class Call>
bool contained(Call& call, std::string& reason) {
  return run_contained([](void* data) { (*static_cast<Call*>(data))(); }, &call, reason);
}

// The engine's last warning in the last contained call of this thread; "" where there was none.
std::string last_warning();

}  // namespace ulna::engine
