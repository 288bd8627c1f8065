// Parts of records: trials between gaps and missing values, chosen rows and trials, segments around
// triggers, several records as one. Values are never changed; each step adds a line of provenance.
#pragma once

#include <vector>

#include "record/record.hpp"

namespace ulna {

struct SplitOptions {
  double gap_steps = 1.5;  // a step above this many median steps ends a trial
  Index min_rows = 100;    // shorter pieces are left out (their rows stay in the record)
  bool at_nan = true;      // a missing value in a position, force or reference ends a trial
};

// The same rows with one trial for every piece, and one segment for every trial. Throws Error kData
// when no piece is long enough.
Record split(const Record& record, const SplitOptions& options = {});

// Rows [begin, end): trials and segments are cut to them.
Record select_rows(const Record& record, Index begin, Index end);

// The trials of these numbers, in the order of the record.
Record select_trials(const Record& record, const std::vector<Index>& trials);

// One segment for every onset (s, on the record's clock) with a row at or after it in a trial, from
// before_s before to after_s after it. Throws Error when an onset or its segment lies outside of
// every trial.
Record with_segments(const Record& record, const std::vector<double>& onsets_s, double before_s,
                     double after_s);

// One record with the trials of all. Names, units, roles and frames of the channels must agree;
// rates must agree within 0.1 %.
Record join(const std::vector<Record>& records);

}  // namespace ulna
