// Where perturbations begin.
#pragma once

#include <vector>

#include "base/types.hpp"
#include "ident/prepare.hpp"
#include "record/record.hpp"

namespace ulna {

// A perturbation: rows of the record.
struct Onset {
  int trial = 0;
  Index row = 0;  // first row that has left its rest
  Index end = 0;  // one past the last row that belongs to it
};

// Times given (s, in the record's clock): each lasts to the next less rest_s, at most longest_s.
// Throws Error (kArgument) for times outside of the record or out of order.
std::vector<Onset> given_onsets(const Record& record, const std::vector<double>& times_s,
                                double rest_s, double longest_s);

// Found: one in each segment where trials hold several, else everywhere that the reference leaves a
// rest of rest_s. The signal is the reference, or without one (only in segments) the position; it
// has left its rest when it is a thousandth of its range, and six standard deviations of its rest,
// away, and the onset is where it then came from, a millionth or three deviations away. Throws
// Error (kData) when there is nothing to find them from, or none is found.
std::vector<Onset> find_onsets(const Record& record, const Roles& roles, double rest_s,
                               double longest_s);

}  // namespace ulna
