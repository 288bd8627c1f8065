// A random sequence of two values on every axis, through an underdamped filter. Dyck 2013, 4.4.2:
// +-2 N along one axis for 50 s.
#pragma once

#include <cstdint>

#include "base/token.hpp"
#include "signal/excitation.hpp"

namespace ulna {

struct BinarySpec {
  Drive drive = Drive::kForce;
  Vector amplitude;  // per axis: the input is +amplitude or -amplitude
  SecondOrder filter;
  bool filtered = true;  // false: the values themselves, with steps
  double rate_hz = 1000.0;
  double duration_s = 50.0;  // of the whole design, the way back included
  double clock_s = 0.5;      // the sign is drawn anew this often
  double return_s = 1.0;     // gently back to 0 at the end; 0: the sequence fills the duration
  std::uint64_t seed = 0;
};

// The segment is the sequence without the way back. Each axis has signs of its own.
Excitation random_binary(const BinarySpec& spec, Token* token = nullptr);

}  // namespace ulna
