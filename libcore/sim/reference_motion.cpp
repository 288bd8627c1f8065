#include "sim/reference_motion.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna::sim {
namespace {

constexpr double kLogisticSeconds = 6.0;  // of the published movement

// One way there at x = time / duration; the rate is per unit of x.
ReferenceMotion::Point way(MotionShape shape, double x) {
  switch (shape) {
    case MotionShape::kLogistic: {
      const double e = std::exp(5.0 - 2.0 * kLogisticSeconds * x);
      const double s = 1.0 / (1.1 * (1.0 + e));
      return {s, 2.0 * kLogisticSeconds * e / (1.1 * (1.0 + e) * (1.0 + e))};
    }
    case MotionShape::kMinimumJerk:
      return {x * x * x * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * (1.0 - x) * (1.0 - x)};
    case MotionShape::kRamp:
      return {x, 1.0};
    case MotionShape::kSinusoid:
      break;
  }
  return {0.5 * (1.0 - std::cos(kPi * x)), 0.5 * kPi * std::sin(kPi * x)};
}

}  // namespace

void ReferenceMotion::check() const {
  require(std::isfinite(duration_s) && duration_s >= 0.1 && duration_s <= 600.0, "duration_s",
          "the duration of a movement must be between 0.1 and 600 s");
  require(!speeds.empty() && speeds.size() <= 100, "speeds",
          "there must be between 1 and 100 speeds");
  for (const double speed : speeds) {
    require(std::isfinite(speed) && speed >= 0.01 && speed <= 100.0, "speeds",
            sentence(6, "speed ", speed, " is not between 0.01 and 100"));
  }
  require(repeats >= 1 && repeats <= 1000, "repeats", "repeats must be between 1 and 1000");
  require(std::isfinite(rest_s) && rest_s >= 0.0 && rest_s <= 60.0, "rest_s",
          "the rest between movements must be between 0 and 60 s");
  require(shape != MotionShape::kLogistic || !returns(), "shape",
          "the logistic movement ends short of its end and has no way back: "
          "take minimum jerk, "
          "ramp or sinusoid for several speeds or repeats");
}

double ReferenceMotion::length_s() const {
  double length = 0.0;
  const double ways = returns() ? 2.0 * repeats : 1.0;
  for (const double speed : speeds) length += ways * (duration_s / speed + rest_s);
  return length + (rest_s > 0.0 ? rest_s : 0.0);
}

ReferenceMotion::Point ReferenceMotion::at(double time_s) const {
  double t = time_s - rest_s;
  bool back = false;
  Point here{0.0, 0.0};
  if (shape == MotionShape::kLogistic && rest_s == 0.0) here = way(shape, 0.0);
  if (t < 0.0) return here;
  for (const double speed : speeds) {
    const double each = duration_s / speed;
    const int ways = returns() ? 2 * repeats : 1;
    for (int i = 0; i < ways; ++i) {
      // The last instant of the last way belongs to it.
      if (t <= each) {
        const Point p = way(shape, t / each);
        return {back ? 1.0 - p.share : p.share, (back ? -1.0 : 1.0) * p.rate / each};
      }
      here = {back ? 0.0 : way(shape, 1.0).share, 0.0};
      back = !back;
      if (t <= each + rest_s) return here;
      t -= each + rest_s;
    }
  }
  return here;
}

}  // namespace ulna::sim
