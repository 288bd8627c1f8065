// Prepared signals as a record: what an analysis saw, to look at, export or feed to another tool.
#pragma once

#include "ident/prepare.hpp"
#include "record/record.hpp"

namespace ulna {

// Channels: every position and reference c with c_rate and c_acceleration, and every force.
Record prepared_record(const Record& source, const Prepared& prepared);

}  // namespace ulna
