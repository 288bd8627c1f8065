// Muscles of the elbow and the shoulder: points, forces and operating ranges.
#pragma once

#include <vector>

#include "plant/arm_description.hpp"

namespace ulna {

// The eight elbow muscles on straight lines with the published forces and ranges (Tesfazgi 2023).
std::vector<Muscle> published_elbow_muscles();

// Where the fit begins: the same points around the cylinders, published forces, and flexor ranges
// that leave them slack when the elbow is straight.
std::vector<Muscle> unfitted_elbow_muscles();

// The same points; triceps and flexors go around cylinders on the elbow's axis, and forces and
// ranges are fitted to measured maximum isometric torque (Amis, Buchanan), see muscle_fit.hpp.
std::vector<Muscle> fitted_elbow_muscles();
std::vector<WrapCylinder> elbow_cylinders();

// Fifteen shoulder muscles on straight lines, published.
std::vector<Muscle> published_shoulder_muscles();

}  // namespace ulna
