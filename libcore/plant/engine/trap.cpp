#include "plant/engine/trap.hpp"

#include <csetjmp>
#include <cstdio>

// Exported by libmujoco and used by its own binding, but in none of its installed headers.
extern "C" {
using EngineHandler = void (*)(const char*);
EngineHandler _mjPRIVATE__get_tls_error_fn(void);
void _mjPRIVATE__set_tls_error_fn(EngineHandler handler);
EngineHandler _mjPRIVATE__get_tls_warning_fn(void);
void _mjPRIVATE__set_tls_warning_fn(EngineHandler handler);
}

namespace ulna::engine {
namespace {

constexpr std::size_t kTextSize = 1000;  // the engine's own buffers

struct Trap {
  std::jmp_buf back;
  char text[kTextSize];
};

// The handlers get no argument of ours, so what they need is found through the thread.
thread_local Trap* current_trap = nullptr;
thread_local char warning_text[kTextSize] = "";

void on_error(const char* text) {
  std::snprintf(current_trap->text, kTextSize, "%s", text);
  std::longjmp(current_trap->back, 1);
}

void on_warning(const char* text) { std::snprintf(warning_text, kTextSize, "%s", text); }

// Only plain data in this frame: a jump into it must not skip anything.
bool enter(void (*call)(void*), void* data, Trap& trap) {
  if (setjmp(trap.back) != 0) return false;
  call(data);
  return true;
}

// Sets the handlers of this thread and puts the former ones back.
class Handlers {
 public:
  explicit Handlers(Trap& trap) : former_trap_(current_trap) {
    current_trap = &trap;
    _mjPRIVATE__set_tls_error_fn(on_error);
    _mjPRIVATE__set_tls_warning_fn(on_warning);
  }
  ~Handlers() {
    _mjPRIVATE__set_tls_warning_fn(former_warning_);
    _mjPRIVATE__set_tls_error_fn(former_error_);
    current_trap = former_trap_;
  }
  Handlers(const Handlers&) = delete;
  Handlers& operator=(const Handlers&) = delete;

 private:
  Trap* former_trap_;
  EngineHandler former_error_ = _mjPRIVATE__get_tls_error_fn();
  EngineHandler former_warning_ = _mjPRIVATE__get_tls_warning_fn();
};

}  // namespace

bool run_contained(void (*call)(void*), void* data, std::string& reason) {
  Trap trap;
  trap.text[0] = '\0';
  warning_text[0] = '\0';
  const Handlers handlers(trap);
  const bool fine = enter(call, data, trap);
  if (!fine) reason = trap.text;
  return fine;
}

std::string last_warning() { return warning_text; }

}  // namespace ulna::engine
