// The empty rig taken out of a measurement: what hangs between the force sensor and the hand has an
// inertia, damping and stiffness of its own, identified from a recording without the arm. A payload
// of known mass is the special case M_r = payload I, (3.7) of Dyck 2013.
#pragma once

#include <string>
#include <vector>

#include "base/token.hpp"
#include "ident/force_errors.hpp"
#include "ident/prepare.hpp"
#include "record/record.hpp"

namespace ulna {

// Natural parameters (impedance/natural.hpp) with their covariance.
struct NaturalParameters {
  Vector value;
  Matrix covariance;
};

// measured - rig for M, B and K; K x0 is the difference of both K x0, so that x0 is the place where
// the hand alone is at rest: NaN where the difference of the stiffnesses is singular. Both
// identifications are independent, and their covariances add (x0 by linear propagation). A rig with
// singular stiffness (its x0 NaN) counts as one without: then its K must be zero.
NaturalParameters tare_impedance(const NaturalParameters& measured, const NaturalParameters& rig);

struct TaredRecord {
  Record record;
  ForceErrors errors;  // of the rig's parameters: "rig M_11" ... "rig K_nn", "rig K x0_1" ...
};

// The record with its forces replaced by those of the hand alone: F_hand = F - F_rig, where
// M_r x'' + B_r x' + K_r (x - x_r) = -F_rig, hence F_hand = F + M_r x'' + B_r x' + K_r (x - x_r).
// Motion is differentiated with a low pass four times above the one an identification would choose
// (options.lowpass_hz 0), so that the identification's own filter finds the same operator on force
// and motion. Rows at the ends of every trial where the smoother starts and stops are left out.
// Errors as prepare; kArgument when the rig has another number of axes than the record.
TaredRecord tare_record(const Record& record, const NaturalParameters& rig, const Roles& roles,
                        PrepareOptions options, int threads = 1, Token* token = nullptr);

}  // namespace ulna
