// Which rows identify and which validate.
#pragma once

#include <vector>

#include "ident/design.hpp"
#include "ident/prepare.hpp"
#include "record/record.hpp"

namespace ulna {

struct Split {
  std::vector<Span> train, held_out, all;
  double train_s = 0.0;
  bool segmented = false;
};

// train_s 0: the first half of the segments of a trial that has several, else the first 40 s, at
// most 80 %, of the rows in use.
Split split_rows(const Record& record, const Prepared& prepared, double train_s);

// Pieces of about `rows` rows, of nearly equal length within a span.
std::vector<Span> cut(const std::vector<Span>& spans, Index rows);

}  // namespace ulna
