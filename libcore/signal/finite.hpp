// Filters spread one NaN over a whole record, so every entry of this module refuses it first.
#pragma once

#include "base/types.hpp"

namespace ulna {

// Throws Error (kData, detail "row R, channel C", both from 0) at the first NaN or infinite value;
// the rows of values count from first_row.
void require_finite(MatrixRef values, const char* argument, Index first_row = 0);

}  // namespace ulna
