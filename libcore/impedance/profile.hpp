// Intervals from the profile of a fit over one parameter.
#pragma once

#include "base/types.hpp"

namespace ulna {

inline constexpr double kQuantile95 = 1.959963984540054;  // two-sided, normal

// Ends of the range outside of which every distance exceeds the limit; the profile's own end where
// none does. at: ascending; distance: square root of a chi-square of one degree against the best,
// linear between its points. A second minimum that is not significantly worse belongs to the range.
Eigen::Vector2d likely_range(const Vector& at, const Vector& distance, double limit);

}  // namespace ulna
