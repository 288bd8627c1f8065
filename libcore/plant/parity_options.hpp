// The published simulation (Tesfazgi 2023) with its defects as switches, and the six factors of its
// study. It is built again from its published numbers; nothing of it is copied.
#pragma once

#include "base/types.hpp"

namespace ulna {

// Of the plant; true: as published. Defects of the controller, of the start and of what ends a run
// are those of sim::Protocol, defects of the estimator those of ViscoelasticOptions.
struct ParityDefects {
  // A selection by number without regard to type gives 73 of the 74 length constraints of the
  // straps the stiffness of the upper arm's tissue.
  bool strap_mask = true;
  // The nominal model has neither straps nor tissue, keeps the masses and lengths of the nominal
  // arm and has the elbow 15 mm beside the device's.
  bool nominal_omissions = true;
  // Elements of the tissue and of the straps overlap and touch each other at every step, and carry
  // load by it.
  bool self_contact = true;
  // The start lies on limits of the device's joints, and the arm's shoulder rests on one.
  bool tight_limits = true;
};

struct ParityOptions {
  double upper_factor = 1.0;       // of the upper arm's length
  double fore_factor = 1.0;        // of the forearm's length
  double upper_mass = 1.761;       // kg, without the tissue's 0.489
  double fore_mass = 0.962;        // kg, without the tissue's 0.351
  double upper_stiffness = 537.5;  // of the constraints of the tissue, 1/s^2: published as N/m
  double fore_stiffness = 537.5;   // 1/s^2
  double viscosity = 111.0;        // 1/s: published as 100 N s/m
  ParityDefects defects;

  // Throws Error (kArgument) in one sentence that names the option.
  void check() const;
};

}  // namespace ulna
