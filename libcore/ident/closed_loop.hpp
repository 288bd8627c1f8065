// Whether the measured motion was caused by the robot's perturbation or by the human: the question
// on which a direct estimate from closed-loop data stands or falls.
#pragma once

#include "base/types.hpp"
#include "ident/linear.hpp"
#include "ident/prepare.hpp"

namespace ulna {

// Share of the motion's power that the reference does not explain, 1 - multiple coherence.
struct MotionShare {
  Vector freq_hz;  // up to the band of the analysis
  Matrix share;    // frequencies x axes, 0 to 1, corrected for the number of averages
  Vector total;    // axes: over the whole band, weighted by power
};

// From prepared signals: one filter for all leaves coherence as it is, up to the band it passes.
// Empty without a reference or when the trials are too short to average.
MotionShare motion_share(const Prepared& prepared, double band_hz);

// VAF of the force that the perturbation caused, percent, per axis: what the fit leaves of the
// force and the reference explains, against what the reference explains of the force. The human's
// own force lowers the plain VAF but not this one; a model that does not hold lowers both. NaN
// without a reference. theta: (3 n + 1) x n for positions centred on position_mean, payload
// excluded.
Vector reference_vaf(const Prepared& prepared, const Matrix& theta, const Vector& position_mean,
                     double payload_kg, double band_hz);

// Is the least-squares estimate compatible with the instrumental one? Wald test of the difference
// of their parameters with its Newey-West covariance (the two share their noise: Hausman's shortcut
// does not hold for correlated residuals).
struct DifferenceTest {
  Vector difference;  // least squares - instrumental, vec(theta)
  Vector standard_error;
  double statistic = 0.0;
  double degrees = 0.0;
  double p_value = 1.0;
};

// joint_covariance: of [vec(theta_instrumental); vec(theta_least_squares)], from newey_west.
DifferenceTest difference_test(const Fit& instrumental, const Fit& least_squares,
                               const Matrix& joint_covariance);

// How much later the force is than the motion, in seconds: to first order -F(t) = Phi theta + tau
// F'(t). Positive: the force channel lags. One value pooled over the axes, with its standard error.
struct LagCheck {
  double lag_s = 0.0;
  double standard_error_s = 0.0;
  bool available = false;
};

LagCheck check_lag(const Prepared& prepared, const std::vector<Span>& spans, Estimator estimator,
                   double hac_lag_s);

}  // namespace ulna
