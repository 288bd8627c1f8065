// Passivity of M x'' + B x' + K x = force, by the eigenvalues of the symmetric parts. Theorem 3.2
// of Dyck 2013 corrected: it prints leading minors and misses k_yy, m_yy, b_yy >= 0.
#pragma once

#include "base/types.hpp"

namespace ulna {

enum class Answer { kPassive, kNotPassive, kUndecided };

struct ModelMargins {
  double m_min = 0.0;           // smallest eigenvalue of the symmetric part of M (kg or kg m^2)
  double b_min = 0.0;           // of B (N s/m or N m s/rad)
  double k_min = 0.0;           // of K (N/m or N m/rad)
  double antisymmetry_m = 0.0;  // (3.26); infinite when M is not positive definite
  double antisymmetry_k = 0.0;
  bool m_symmetric = true;  // antisymmetry at most the threshold: dropped
  bool k_symmetric = true;
  // Excess of passivity: H(jw) = B + B' at every frequency when M and K are symmetric, so it is
  // b_min. Minus infinity when M or K is not symmetric positive semidefinite: the shortage is
  // unbounded.
  double excess = 0.0;
  Answer answer = Answer::kUndecided;
};

// tolerance: eigenvalues within this share of the matrix's norm of zero leave the answer undecided.
// A matrix that is exactly zero is positive semidefinite.
ModelMargins model_passivity(const Matrix& m, const Matrix& b, const Matrix& k,
                             double antisymmetry_threshold = 0.15, double tolerance = 1e-12);

}  // namespace ulna
