// The force of a muscle at rest in the normalised curves of the engine (MuJoCo 2.2): active force
// over length, passive force over length. Length 1 is the optimal one.
#pragma once

namespace ulna {

struct MuscleCurves {
  double shortest = 0.5;      // no active force below
  double longest = 1.6;       // nor above
  double passive_peak = 1.3;  // slope of the passive force over half of (longest - 1)

  double active(double length) const { return bump(length, shortest, 1.0, longest); }

  double passive(double length) const {
    if (length <= 1.0) return 0.0;
    const double knee = 0.5 * (1.0 + longest);
    const double x = (length <= knee ? length - 1.0 : length - knee) / (knee - 1.0);
    return passive_peak * (length <= knee ? 0.5 * x * x : 0.5 + x);
  }

 private:
  // Quadratic pieces from 0 at a over 1 at the middle to 0 at b.
  static double bump(double x, double a, double middle, double b) {
    const double left = 0.5 * (a + middle);
    const double right = 0.5 * (middle + b);
    if (x <= a || x >= b) return 0.0;
    if (x < left) return 0.5 * square((x - a) / (left - a));
    if (x < middle) return 1.0 - 0.5 * square((middle - x) / (middle - left));
    if (x < right) return 1.0 - 0.5 * square((x - middle) / (right - middle));
    return 0.5 * square((b - x) / (b - right));
  }
  static double square(double x) { return x * x; }
};

}  // namespace ulna
