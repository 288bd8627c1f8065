// A look at the data before anyone computes with them: clock, missing values, saturation, units.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "record/record.hpp"

namespace ulna {

// Codes: "short", "rate", "gap", "jitter" (clock); "nan", "constant", "zero", "saturated",
// "quantised", "unit" (channels). In order of clock, then channels. Changes nothing.
std::vector<Finding> look(const Record& record, Token* token = nullptr);

}  // namespace ulna
