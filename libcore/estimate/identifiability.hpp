// What a set of sensors can tell at all, at one pose: which free wrenches and which accelerations
// only the prior decides. The balance of the body has six equations; two free hands have twelve
// unknowns.
#pragma once

#include "estimate/body_sensors.hpp"

namespace ulna {

struct Identifiability {
  // Free external wrenches.
  std::vector<std::string> free;  // names of the contacts
  Index wrench_unknowns = 0;      // their components
  Index wrench_rank = 0;          // combinations that the balance tells
  Index force_rank = 0;           // if all of them were forces without moments ...
  Index force_unknowns = 0;       // ... of so many components
  // Accelerations of base and hinges.
  Index motion_unknowns = 0;
  Index motion_rank = 0;
  std::vector<std::string> undetermined;  // hinges, and "base", that the sensors leave open
  std::string words;                      // for a person

  bool complete() const { return wrench_rank == wrench_unknowns && undetermined.empty(); }
};

// y tells which rows are there (NaN: missing); empty: all. Throws Error (kArgument) as check_state,
// and for a y of another size.
Identifiability identifiability(const SensorSuite& suite, const BodyState& state,
                                const Vector& y = {});

}  // namespace ulna
