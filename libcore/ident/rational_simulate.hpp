// Output of a rational model for sampled inputs, exact for the hold.
#pragma once

#include <vector>

#include "ident/hold.hpp"
#include "ident/rational.hpp"

namespace ulna {

// At rest, with zero input, before the first row. inputs: rows x inputs; delay_s: one an input.
// Throws Error for shapes that differ and values that are not finite.
Vector simulate_rational(const Rational& model, const std::vector<double>& delay_s, Hold hold,
                         MatrixRef inputs, double rate_hz);

}  // namespace ulna
