#include "passivity/teleoperation.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

struct Peak {
  double at = 0.0;
  double value = -kInfinity;
};

// The largest value on [0, pi] of a function whose second derivative is at most `curvature` in
// size: a stretch can rise above its ends by curvature h^2 / 8 only, and is split until it cannot
// hide more than the tolerance.
Peak largest(const std::function<double(double)>& f, double curvature, double tolerance) {
  struct Stretch {
    double a, b, fa, fb;
  };
  Peak best;
  const auto visit = [&](double x) {
    const double value = f(x);
    if (value > best.value) best = {x, value};
    return value;
  };
  require(std::isfinite(curvature), "delay_s",
          "these numbers are too far apart for double arithmetic: check their units");
  std::vector<Stretch> open;
  constexpr int kFirst = 64;
  double before = visit(0.0);
  for (int i = 0; i < kFirst; ++i) {
    const double a = kPi * i / kFirst;
    const double b = kPi * (i + 1) / kFirst;
    const double fb = visit(b);
    open.push_back({a, b, before, fb});
    before = fb;
  }
  while (!open.empty()) {
    const Stretch s = open.back();
    open.pop_back();
    const double h = s.b - s.a;
    const double bound = std::max(s.fa, s.fb) + curvature * h * h / 8.0;
    if (!(bound > best.value + tolerance) || h < 1e-9) continue;
    const double middle = 0.5 * (s.a + s.b);
    const double fm = visit(middle);
    open.push_back({s.a, middle, s.fa, fm});
    open.push_back({middle, s.b, fm, s.fb});
  }
  return best;
}

double sinc(double x) { return std::abs(x) < 1e-4 ? 1.0 - x * x / 6.0 : std::sin(x) / x; }

// Squares and products of such numbers neither overflow nor need a limit of their own.
constexpr double kMostTeleoperation = 1e60;

void check_not_negative(double value, const char* name) {
  require(value >= 0.0 && value <= kMostTeleoperation, name,
          std::string(name) + " must be a finite number that is not negative");
}

void check_delays(const Vector& delay_s) {
  for (Index i = 0; i < delay_s.size(); ++i) {
    require(delay_s(i) >= 0.0 && delay_s(i) <= kMostTeleoperation, "delay_s",
            sentence(9, "delay ", i, " is ", delay_s(i),
                     " s: a delay must be a finite number that is not negative"));
  }
}

// sup of f, divided as written in the header; (1 - cos psi) / psi^2 = sinc^2(psi/2) / 2.
double demand(const PositionForce& p, double delay) {
  const double total = 2.0 * (p.slave_damping + p.coupling_damping);
  const double kv = p.coupling_damping;
  const double bs = p.slave_damping;
  const double g = 2.0 * p.coupling_stiffness * delay;
  const auto f = [&](double psi) {
    const double half = sinc(0.5 * psi);
    return (kv * kv * (1.0 - std::cos(psi)) + 0.5 * g * g * half * half -
            2.0 * kv * bs * std::cos(psi) + 2.0 * g * bs * sinc(psi)) /
           total;
  };
  // |cos''| <= 1, |(sinc^2(x/2)/2)''| <= 1/12, |sinc''| <= 1/3.
  const double curvature = (kv * kv + g * g / 12.0 + 2.0 * kv * bs + 2.0 * g * bs / 3.0) / total;
  return largest(f, curvature, 1e-12 * curvature).value;
}

}  // namespace

Vector allowed_gain(const PositionForce& p, double excess, const Vector& delay_s) {
  check_not_negative(p.master_damping, "master_damping");
  check_not_negative(p.slave_damping, "slave_damping");
  check_not_negative(p.coupling_stiffness, "coupling_stiffness");
  require(p.coupling_damping > 0.0 && p.coupling_damping <= kMostTeleoperation, "coupling_damping",
          "coupling_damping must be a finite number above 0");
  require(std::abs(excess) <= kMostTeleoperation, "excess", "the excess must be a finite number");
  check_delays(delay_s);
  const double damping = p.master_damping + excess;
  Vector out(delay_s.size());
  for (Index i = 0; i < delay_s.size(); ++i) {
    if (damping < 0.0) {
      out(i) = 0.0;  // the master and the arm alone are not stable together
    } else {
      out(i) = delay_s(i) == 0.0 ? kInfinity : damping / demand(p, delay_s(i));
    }
  }
  return out;
}

Vector allowed_stiffness(double device_damping, double wall_damping, double excess,
                         const Vector& delay_s) {
  check_not_negative(device_damping, "device_damping");
  check_not_negative(wall_damping, "wall_damping");
  require(std::abs(excess) <= kMostTeleoperation, "excess", "the excess must be a finite number");
  check_delays(delay_s);
  const double damping = device_damping + excess;
  Vector out(delay_s.size());
  for (Index i = 0; i < delay_s.size(); ++i) {
    const double t = delay_s(i);
    if (t == 0.0) {
      out(i) = damping + wall_damping >= 0.0 ? kInfinity : 0.0;
      continue;
    }
    if (damping < 0.0 || (wall_damping > 0.0 && damping <= wall_damping)) {
      out(i) = 0.0;  // at w = pi / T the wall's damping acts with the wrong sign
      continue;
    }
    // The smallest ratio (damping + B cos x) / (T sinc x): each round takes the ratio where the
    // last one is most exceeded (Dinkelbach 1967).
    double k = (damping + wall_damping) / t;
    for (int round = 0; round < 50; ++round) {
      const auto excess_at = [&](double x) {
        return k * t * sinc(x) - damping - wall_damping * std::cos(x);
      };
      const double size = damping + wall_damping + k * t;
      const Peak peak = largest(excess_at, wall_damping + k * t / 3.0, 1e-14 * size);
      if (peak.value <= 1e-13 * size) break;
      k = (damping + wall_damping * std::cos(peak.at)) / (t * sinc(peak.at));
    }
    out(i) = k;
  }
  return out;
}

}  // namespace ulna
