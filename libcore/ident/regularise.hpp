// A record with an even clock, from one whose time stamps jitter.
#pragma once

#include "base/token.hpp"
#include "record/record.hpp"

namespace ulna {

// Every trial on its own even grid from its first stamp, at rate_hz (0: the record's), all channels
// through the same band-limited resampler (signal/resample.hpp). Channels of the role other that
// hold missing values, and switches, are not band-limited: they take the nearest sample. Refuses
// gaps and missing values in positions, forces and references, with the row.
Record regularise(const Record& record, double rate_hz = 0.0, Token* token = nullptr);

}  // namespace ulna
