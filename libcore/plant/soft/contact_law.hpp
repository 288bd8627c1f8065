// Contacts of one time step as a small linear complementarity: each is a stiff
// pad that only pushes. Everything that moves freely in between has been
// condensed into `mobility`, what is left open are a few outer velocities (of a
// bone against its link, or of a plate).
#pragma once

#include <vector>

#include "plant/soft/growing_matrix.hpp"

namespace ulna {

struct ContactProblem {
  double timestep = 0.0;
  Vector stiffness;          // of each pad, N/m
  Vector penetration;        // at the end of the step without contact forces, the
                             // outer bodies still, m
  Matrix approach;           // contacts x outer velocities: d penetration / dt
  GrowingMatrix mobility;    // contacts x contacts: -d (d penetration / dt) / d force, m/(s N)
  std::vector<char> active;  // which contacts to begin with

  void resize(Index contacts, Index outer);  // what it held is lost
};

class ContactLaw {
 public:
  // To be written before begin(): the same storage serves every step.
  ContactProblem& problem() { return problem_; }
  void begin();

  // Force on the outer velocities: bias - resistance x velocity, with the
  // present active contacts; of the first `contacts` of them only where it is
  // not negative. Adds to what is there.
  void condense(Vector& bias, Matrix& resistance, Index contacts = -1) const;
  // Contact forces (N) for outer velocities; chooses the active contacts anew.
  // True when they changed, so that the outer velocities must be solved for
  // again.
  bool settle(const Vector& velocity);

  const Vector& force() const { return force_; }
  const std::vector<char>& active() const { return problem_.active; }

 private:
  void factor();

  ContactProblem problem_;
  std::vector<Index> chosen_;
  GrowingMatrix system_;     // 1/k + dt mobility, of the active ones
  Matrix inverse_approach_;  // of the active ones: (1/k + dt mobility)^-1 approach
  Vector inverse_penetration_;
  Vector force_;
};

}  // namespace ulna
