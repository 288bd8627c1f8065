// The regularised incomplete beta function, which Student's t and the F distribution rest on.
#pragma once

namespace ulna {

// I_x(a, b), 0 to 1, for a, b > 0; x outside [0, 1] counts as the nearer end.
double beta_regularised(double a, double b, double x);

}  // namespace ulna
