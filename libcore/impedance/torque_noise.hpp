// Standard errors of a regression of torque on angle and rate that hold the noise of the
// measurement alone: for this movement of this arm, what would change in a repetition.
//
// A straight line leaves more than noise: the curves of the muscles, the softness of an interface.
// That is slow, as the movement is, and it repeats itself. So rich functions of angle and rate are
// taken off the torque, which take the slow part of the noise with them. The noise that is left at
// higher frequencies is a spectrum
//
//     S(f) = a (1 + r / (1 + (f / f_c)^4))     white, r = 0, or with a low-pass part of second
//     order
//
// fitted by quasi-likelihood (Whittle 1953) to the squared cosine coefficients of the residual,
// each with the expectation that the removal left it. Its low end is where parameters are
// sensitive: their variances are sums of S over the spectrum of the estimator's weights.
//
// Noise that is slower than what was taken off (0.8 times as many half cycles as there were
// functions, over the time of the record) cannot be told from the arm: these errors do not hold it.
#pragma once

#include "base/types.hpp"
#include "record/record.hpp"

namespace ulna {

struct TorqueNoise {
  Vector error;      // standard error of each parameter
  double dof = 0.0;  // of these errors: of Student's t
  double rms = 0.0;  // of the torque beside what is a function of angle and rate, N m
};

// record: for its trials and rate. weights: rows x parameters, a parameter is the product of its
// column and the torque. Angle, rate and torque have an entry a row; at least 30 rows.
TorqueNoise torque_noise(const Record& record, const Matrix& weights, const VectorRef& angle,
                         const VectorRef& rate, const VectorRef& torque);

}  // namespace ulna
