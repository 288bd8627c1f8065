// Progress out, cancellation in: the only channel between a long call and the thread that watches
// it.
#pragma once

#include <atomic>

#include "base/error.hpp"

namespace ulna {

class Token {
 public:
  Token() = default;
  // Of a part of the work: cancelled with the whole, its progress is its own.
  explicit Token(const Token* whole) : whole_(whole) {}

  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const noexcept {
    return cancelled_.load(std::memory_order_relaxed) || (whole_ != nullptr && whole_->cancelled());
  }

  double progress() const noexcept { return progress_.load(std::memory_order_relaxed); }
  void set_progress(double fraction) noexcept {
    progress_.store(fraction, std::memory_order_relaxed);
  }

 private:
  const Token* whole_ = nullptr;
  std::atomic<bool> cancelled_{false};
  std::atomic<double> progress_{0.0};
};

// Called at least every 50 ms by long loops. A null token never cancels.
inline void step(Token* token, double fraction) {
  if (token == nullptr) return;
  token->set_progress(fraction);
  if (token->cancelled()) throw Error(Fault::kCancelled, "token", "the call was cancelled");
}

}  // namespace ulna
