// Analysis of variance of repeated measures: every subject is measured once in every cell of one or
// two factors, and the subjects are the random sample.
//
// With C an orthonormal basis of an effect's contrasts over the cells (cells x d) and Z = Y C the
// scores of n subjects, the effect has the sum of squares n |mean Z|^2 with d degrees of freedom
// and its error |Z - mean Z|^2 with d (n - 1): for two factors these are F_A = MS_A / MS_AxS, F_B =
// MS_B / MS_BxS and F_AB = MS_AB / MS_ABxS of the textbooks (Winer 1971, chapter 7). Scores that
// are correlated or of unequal variance make that F test too generous; Greenhouse and Geisser
// (1959) shrink both degrees of freedom by epsilon = tr(S)^2 / (d tr(S^2)), S the covariance of Z.
#pragma once

#include "base/types.hpp"

namespace ulna {

enum class AnovaEffectKind { kFirst, kSecond, kInteraction };

struct AnovaEffect {
  double sum_of_squares = 0.0;  // in the squared unit of the values
  double error_sum_of_squares = 0.0;
  double dof = 0.0;
  double error_dof = 0.0;
  double f = 0.0;
  double p = 0.0;                    // under sphericity
  double epsilon = 1.0;              // Greenhouse-Geisser, 1 / d to 1; 1 where d is 1
  double p_corrected = 0.0;          // with both degrees of freedom times epsilon
  double partial_eta_squared = 0.0;  // SS / (SS + SS error)
};

// values: subjects x (levels_first levels_second), the second factor runs fastest; one factor has
// levels_second 1 and only kFirst. Throws Error kArgument for a shape that does not fit, kData for
// a value that is no number (with subject and cell) and kAnalysis where the subjects do not differ,
// so that nothing can be tested.
AnovaEffect repeated_anova(MatrixRef values, Index levels_first, Index levels_second,
                           AnovaEffectKind kind);

// P(F > f) of the F distribution with `dof` and `error_dof` degrees of freedom, both positive and
// not necessarily whole; NaN for an f that is NaN.
double f_tail(double f, double dof, double error_dof);

}  // namespace ulna
