// Which orders and which delay? Every combination is estimated from the same rows and judged on the
// same held-out rows.
#pragma once

#include <string>
#include <vector>

#include "ident/srivc.hpp"

namespace ulna {

enum class OrderCriterion {
  // The fewest coefficients whose held-out error is within two standard errors of the least.
  kHeldOut,
  kBic,   // Bayesian information criterion (Schwarz 1978)
  kAicc,  // Akaike's, corrected for few rows (Hurvich and Tsai 1989)
  // Young's information criterion (1989) among those with an error within three of the least.
  kYic,
};

struct OrderGrid {
  std::vector<Index> poles;
  std::vector<Index> zeros;  // empty: 0 ... poles - 1; combinations above `poles` are left out
  std::vector<double> delay_s;
};

struct OrderCandidate {
  Index poles = 0;
  Index zeros = 0;       // of every input
  double delay_s = 0.0;  // of every input
  bool failed = false;   // the estimate ended in an error, which is the note
  std::string note;      // why it is no candidate; empty when it is one
  RationalFit fit;       // without the simulated output; not refitted
};

struct OrderSearch {
  std::vector<OrderCandidate> candidates;  // by the criterion, best first; those that failed last
  Index recommended = -1;                  // -1: none is good
  std::string reason;                      // one or two sentences
};

// options: orders are replaced by those of the grid, held_out 0 with kHeldOut by 0.25.
OrderSearch search_orders(MatrixRef inputs, VectorRef output, double rate_hz,
                          const std::vector<RowRange>& ranges, const OrderGrid& grid,
                          OrderCriterion criterion, RationalOptions options, int threads,
                          Token* token = nullptr);

}  // namespace ulna
