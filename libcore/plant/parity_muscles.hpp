// Length ranges of the published simulation's muscles, which are numbers there and do not follow
// from the paths.
#pragma once

#include <string>

#include "plant/arm_description.hpp"

namespace ulna {

// Elbow muscles: planes over the scales of upper arm and forearm. Shoulder muscles: constants.
// Throws Error (kArgument) for a muscle that is not among the published.
struct PublishedLengths {
  double shortest;  // m
  double longest;   // m
};
PublishedLengths published_lengths(const std::string& muscle, double upper_scale,
                                   double fore_scale);

}  // namespace ulna
