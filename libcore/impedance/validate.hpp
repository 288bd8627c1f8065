// How much of the force a fit accounts for.
#pragma once

#include <cstdint>
#include <vector>

#include "ident/design.hpp"

namespace ulna {

// VAF per axis, percent, (3.10) of Dyck 2013, and where `interval` is given its 95 % interval, 2 x
// n, by resampling blocks of one second; NaN where there is too little data.
void validate(const Design& design, const std::vector<Span>& spans, const Matrix& theta,
              double rate_hz, std::uint64_t seed, int threads, Vector& vaf, Matrix* interval);

}  // namespace ulna
