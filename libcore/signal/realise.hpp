// From rational functions to state space and back, and the zeros of a state space.
#pragma once

#include <optional>

#include "signal/system.hpp"

namespace ulna {

// A realisation in controllable (or observable) companion blocks, their frequencies in units of
// scale_rad_s; a column (or row, whichever gives fewer states) with one denominator is one block.
// The polynomial part of improper entries is a chain of differentiators in E.
StateSpace realise(const TransferMatrix& h, double scale_rad_s);

// E x' = A x + B u with u unknown and y given: the pencil whose finite eigenvalues are the zeros.
std::optional<std::vector<Complex>> pencil_zeros(const StateSpace& square);

}  // namespace ulna
