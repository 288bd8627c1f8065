// Motion of a body as the core reads it, shared by the sources of body.h and estimate.h.
#pragma once

#include <ulna/body.h>

#include "handles.hpp"
#include "plant/body/body_motion.hpp"

namespace ulna::capi {

// Views of a motion as matrices; those that were NULL are empty. Sizes are checked, and that the
// numbers are finite where `finite`.
struct BodyFrames {
  Matrix angle, rate, acceleration, position, orientation, velocity, angular_velocity, base;
  Index frames() const { return angle.rows(); }
  // State of a frame.
  BodyState state(Index frame) const;
  // Proper acceleration of the base at a frame; without one it lies still.
  Vector6 base_at(Index frame, const BodyTree& body) const;
  Vector acceleration_at(Index frame) const;
};

BodyFrames read_motion(const ulna_body_motion* motion, const BodyTree& body, bool finite);

}  // namespace ulna::capi
