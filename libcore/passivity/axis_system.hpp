// The imaginary axis is a circle through infinity. Turned by a Moebius map that keeps it in place,
// no pole or zero of interest lies at infinity: proper and improper systems become one case, every
// inverse exists, and the frequencies at which an index has a given value are the eigenvalues of a
// Hamiltonian matrix.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "signal/system.hpp"

namespace ulna {

// D + C (j x - A)^-1 B at omega = scale (x + turn) / (1 - x turn).
struct AxisSystem {
  Eigen::MatrixXcd a, b, c, d;
  double scale = 1.0;
  double turn = 0.0;
};

AxisSystem axis_system(const StateSpace& model, double scale_rad_s);

// Nothing when D is singular to rounding: the system is singular at every frequency.
std::optional<AxisSystem> inverse(const AxisSystem& h);
AxisSystem plus_identity(AxisSystem h);
// (I - H) (I + H)^-1.
std::optional<AxisSystem> scattering(const AxisSystem& h);
// d' H d of a direction d.
AxisSystem along(const AxisSystem& h, const Vector& direction);

// Frequencies (rad/s, not negative) at which the Hermitian part of H may have the eigenvalue
// `level`, or H may have the singular value `gain`: those of all eigenvalues near the axis.
std::vector<double> hermitian_crossings(const AxisSystem& h, double level);
std::vector<double> gain_crossings(const AxisSystem& h, double gain);

}  // namespace ulna
