// What an estimate says of itself: warnings, notes, provenance, and what the data do not determine.
#pragma once

#include <string>
#include <vector>

#include "impedance/estimate.hpp"

namespace ulna {

inline constexpr const char* kNegativeInertia =
    "The inertia comes out negative, which no limb has: the force must be the one by the human on "
    "the robot (else turn its sign in a map), its axes those of the motion, and the payload no "
    "more than was moved.";

// The direction that the data determine least, in words.
std::string unidentifiable(const Fit& fit, const std::vector<std::string>& axes);

// That least squares is biased, by its most telling parameter.
std::string bias_sentence(const DifferenceTest& test, const ImpedanceFit& iv,
                          const ImpedanceFit& ls, const std::vector<std::string>& axes);

// VAF on held-out data, or where nothing was held out on the data of the fit.
const Vector& judged_vaf(const ImpedanceFit& fit);

// Adds the warnings and notes that follow from the numbers of an estimate, and the outcomes that
// only words tell; then its provenance. reported: the regression behind estimate.fit, of `rows`
// rows.
void explain(ImpedanceEstimate& estimate, const Fit& reported, const ImpedanceOptions& options,
             Index rows);

}  // namespace ulna
