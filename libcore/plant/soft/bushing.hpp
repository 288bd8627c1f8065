// A bushing between a bone and a link: a Voigt element of six dimensions. Its
// coordinates are the displacement of the tissue's centre (cuff frame, m) and
// the rotation vector (rad) of the limb since it was donned.
#pragma once

#include "plant/soft/soft_interface.hpp"

namespace ulna {

struct Bushing {
  std::string name;                     // "fore_cuff"
  int interface = 0;                    // that it is part of
  bool strap = false;                   // reported as the strap's, else as the cuff's
  Twist origin = Twist::Zero();         // coordinates that stiffness is taken about
  Wrench preload = Wrench::Zero();      // on the limb there
  Matrix6 stiffness = Matrix6::Zero();  // symmetric
  Matrix6 damping = Matrix6::Zero();

  Wrench wrench(const Twist& at, const Twist& rate) const {
    return preload - stiffness * (at - origin) - damping * rate;
  }
  void check() const;  // throws Error (kArgument) unless symmetric and positive
                       // semidefinite
};

Twist coordinates(const LimbPose& donned, const LimbPose& pose);

}  // namespace ulna
