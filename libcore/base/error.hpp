// The one exception of the core. A fault says what the caller should do about it; the message is
// one sentence that can be shown to a person as it stands.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace ulna {

enum class Fault {
  kArgument,     // the call is wrong: change the argument
  kData,         // the numbers given cannot be used: change or clean the data
  kFile,         // the file cannot be opened, read or written
  kFormat,       // the file was read, but it does not hold what its kind promises
  kAnalysis,     // the data are sound, yet they do not determine what was asked for
  kBuffer,       // the caller's buffer is too small
  kCancelled,    // another thread asked the call to stop
  kMemory,       // not enough memory
  kUnsupported,  // this build cannot do it
  kInternal,     // a defect of the library
};

class Error : public std::runtime_error {
 public:
  // argument: name of the offending argument or option as the caller wrote it ("" when none).
  // detail: where in the data, in a form a program can read ("row 17", "channel F_x").
  Error(Fault fault, std::string argument, const std::string& message, std::string detail = {})
      : std::runtime_error(message),
        fault_(fault),
        argument_(std::move(argument)),
        detail_(std::move(detail)) {}

  Fault fault() const noexcept { return fault_; }
  const std::string& argument() const noexcept { return argument_; }
  const std::string& detail() const noexcept { return detail_; }

 private:
  Fault fault_;
  std::string argument_;
  std::string detail_;
};

inline void require(bool condition, const char* argument, const std::string& message) {
  if (!condition) throw Error(Fault::kArgument, argument, message);
}

}  // namespace ulna
