// Designs and records: a design as a table for a robot's controller, and its perturbations as the
// segments of what was recorded with it.
#pragma once

#include <string>
#include <vector>

#include "record/record.hpp"
#include "signal/excitation.hpp"

namespace ulna {

// Channels "<axis>_ref" (m or, when rotational, rad) or "F_<axis>_ref" (N or Nm) in the role of the
// reference, with `derivatives` also "..._rate" and "..._acceleration"; segments are the design's.
// names: one an axis. Throws Error (kArgument).
Record record_of(const Excitation& excitation, const std::vector<std::string>& names,
                 bool rotational, bool derivatives);

// The record with the design's segments in every trial; the design starts start_s after the first
// row of each. Throws Error (kData) when a trial ends before the design's last segment does.
Record with_segments_of(const Record& record, const Excitation& excitation, double start_s);

}  // namespace ulna
