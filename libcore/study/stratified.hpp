// The bootstrap of a Latin hypercube's blocks.
#pragma once

#include "base/token.hpp"
#include "study/block_estimate.hpp"

namespace ulna {

// Features about the same means, without what they owe to single stratified coordinates: that part,
// fitted by polynomials of each coordinate, averages to nearly the same in every hypercube, and
// resampling it would make intervals too wide. `blocks` itself where nothing is stratified, or
// where there are too few blocks to fit (or too many to hold): wide intervals then, never narrow
// ones.
BlockFeatures without_strata(const BlockFeatures& blocks, const Vector& mean, Token* token);

}  // namespace ulna
