#include "plant/spring_array.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {

namespace {

constexpr int kAngles = 144;
constexpr int kRadii = 6;

// A displacement and how far the linear law errs there.
struct Miss {
  double deviation = 0.0;
  double share = 0.0;
};

Miss miss_at(const SpringArray& array, const SpringEquilibrium& at, double radius, double angle) {
  const Vector2 d(radius * std::cos(angle), radius * std::sin(angle));
  const Vector2 linear = at.stiffness * d;
  const double deviation = (array.force(at.position + d) + linear).norm();
  return {deviation, deviation / linear.norm()};
}

// The largest value of f over the angles, by a scan and golden sections around its best.
template <class Function>
double largest_over_angles(const Function& f) {
  double best = 0.0;
  double where = 0.0;
  const double step = 2.0 * kPi / kAngles;
  for (int i = 0; i < kAngles; ++i) {
    const double value = f(i * step);
    if (value > best) {
      best = value;
      where = i * step;
    }
  }
  constexpr double kGolden = 0.6180339887498949;
  double low = where - step;
  double high = where + step;
  for (int i = 0; i < 30; ++i) {
    const double a = high - kGolden * (high - low);
    const double b = low + kGolden * (high - low);
    const double fa = f(a);
    const double fb = f(b);
    best = std::max({best, fa, fb});
    (fa > fb ? high : low) = fa > fb ? b : a;
  }
  return best;
}

}  // namespace

SpringArray::SpringArray(std::vector<Spring> springs) : springs_(std::move(springs)) {
  require(!springs_.empty() && static_cast<Index>(springs_.size()) <= kMost, "springs",
          "a spring array has from 1 to 8 springs");
  for (std::size_t i = 0; i < springs_.size(); ++i) {
    const Spring& s = springs_[i];
    const bool good = s.anchor.allFinite() && std::isfinite(s.rate) && s.rate > 0.0 &&
                      std::isfinite(s.rest) && s.rest > 0.0;
    if (good) continue;
    throw Error(
        Fault::kArgument, "springs",
        sentence(6, "spring ", i + 1, " has a rate of ", s.rate, " N/m and a rest length of ",
                 s.rest, " m; both must be above zero and its anchor finite"),
        sentence(6, "spring ", i + 1));
  }
}

std::array<Vector2, 8> SpringArray::frame_anchors(double half_x, double half_y,
                                                  const Vector2& centre) {
  require(std::isfinite(half_x) && std::isfinite(half_y) && half_x > 0.0 && half_y > 0.0, "half",
          "the half sides of the frame must be above zero");
  require(centre.allFinite(), "centre", "the centre of the frame must be finite");
  const double x = half_x;
  const double y = half_y;
  std::array<Vector2, 8> out = {Vector2(-x, -y), Vector2(-x, 0), Vector2(-x, y), Vector2(0, y),
                                Vector2(x, y),   Vector2(x, 0),  Vector2(x, -y), Vector2(0, -y)};
  for (Vector2& anchor : out) anchor += centre;
  return out;
}

SpringArray SpringArray::on_frame(const std::vector<double>& rates,
                                  const std::vector<double>& rests, const Vector2& centre,
                                  double half_x, double half_y) {
  require(rates.size() == 8 && rests.size() == 8, "rates",
          "a frame has eight places: give eight rates (zero leaves a place empty) and eight rest "
          "lengths");
  const std::array<Vector2, 8> anchors = frame_anchors(half_x, half_y, centre);
  std::vector<Spring> springs;
  for (std::size_t i = 0; i < 8; ++i) {
    if (rates[i] != 0.0) springs.push_back({anchors[i], rates[i], rests[i]});
  }
  return SpringArray(std::move(springs));
}

Vector2 SpringArray::force(const Vector2& position) const noexcept {
  Vector2 sum = Vector2::Zero();
  for (const Spring& s : springs_) {
    const Vector2 d = position - s.anchor;
    const double length = d.norm();
    if (length > s.rest) sum -= s.rate * (1.0 - s.rest / length) * d;
  }
  return sum;
}

Matrix2 SpringArray::stiffness(const Vector2& position) const noexcept {
  Matrix2 sum = Matrix2::Zero();
  for (const Spring& s : springs_) {
    const Vector2 d = position - s.anchor;
    const double length = d.norm();
    if (length <= s.rest) continue;
    const double across = 1.0 - s.rest / length;
    const Vector2 u = d / length;
    sum += s.rate * (across * Matrix2::Identity() + (1.0 - across) * u * u.transpose());
  }
  return sum;
}

double SpringArray::energy(const Vector2& position) const noexcept {
  double sum = 0.0;
  for (const Spring& s : springs_) {
    const double stretch = (position - s.anchor).norm() - s.rest;
    if (stretch > 0.0) sum += 0.5 * s.rate * stretch * stretch;
  }
  return sum;
}

SpringEquilibrium SpringArray::equilibrium() const {
  SpringEquilibrium out;
  if (find_equilibrium(out)) return out;
  throw Error(Fault::kAnalysis, "springs",
              "the springs do not hold the handle in every direction: too many hang slack or pull "
              "along one line; add a spring or shorten one");
}

bool SpringArray::find_equilibrium(SpringEquilibrium& out) const {
  double rates = 0.0;
  double size = 0.0;
  Vector2 r = Vector2::Zero();
  for (const Spring& s : springs_) {
    r += s.rate * s.anchor;
    rates += s.rate;
  }
  r /= rates;
  for (const Spring& s : springs_) size = std::max({size, s.rest, (s.anchor - r).norm()});

  out = {};
  // Rounding of a sum of forces of the size of rate times length.
  const double small = 1e-14 * rates * size;
  Vector2 f = force(r);
  for (; out.iterations < 200 && f.norm() > small; ++out.iterations) {
    Matrix2 k = stiffness(r);
    // Slack springs leave directions without stiffness: a little of the identity keeps the step
    // downhill and finite.
    const double least = Eigen::SelfAdjointEigenSolver<Matrix2>(k).eigenvalues()(0);
    if (least < 1e-6 * rates) k.diagonal().array() += 1e-3 * rates;
    const Vector2 step = k.ldlt().solve(f);
    const double before = energy(r);
    double length = 1.0;
    // Armijo's guard, as long as the energy resolves the descent; beyond that Newton converges.
    if (f.dot(step) > 1e-10 * before) {
      while (length > 1e-10 && energy(r + length * step) > before - 1e-4 * length * f.dot(step)) {
        length *= 0.5;
      }
    }
    const Vector2 next = r + length * step;
    const Vector2 next_force = force(next);
    if (!(next_force.norm() < f.norm()) && (next - r).norm() < 1e-9 * size) break;
    r = next;
    f = next_force;
  }

  out.position = r;
  out.stiffness = stiffness(r);
  out.residual_n = f.norm();
  out.eigenvalues = Eigen::SelfAdjointEigenSolver<Matrix2>(out.stiffness).eigenvalues();
  out.slack_radius = std::numeric_limits<double>::infinity();
  for (const Spring& s : springs_) {
    const double stretch = (r - s.anchor).norm() - s.rest;
    out.slack.push_back(stretch <= 0.0);
    if (stretch > 0.0) out.slack_radius = std::min(out.slack_radius, stretch);
  }
  return out.eigenvalues(0) > 1e-9 * rates && out.residual_n <= 1e-9 * rates * size;
}

Linearity SpringArray::linearity(const SpringEquilibrium& at, double radius) const {
  require(std::isfinite(radius) && radius > 0.0, "radius_m", "the radius must be above zero");
  Linearity out;
  out.radius = radius;
  out.slack = radius > at.slack_radius;
  for (int i = 1; i <= kRadii; ++i) {
    const double r = radius * i / kRadii;
    out.deviation_n = std::max(out.deviation_n, largest_over_angles([&](double angle) {
                                 return miss_at(*this, at, r, angle).deviation;
                               }));
    out.share = std::max(out.share, largest_over_angles([&](double angle) {
                           return miss_at(*this, at, r, angle).share;
                         }));
  }
  return out;
}

double SpringArray::linear_radius(const SpringEquilibrium& at, double share, double most) const {
  require(share > 0.0 && share < 1.0, "share", "the share of deviation must lie between 0 and 1");
  require(std::isfinite(most) && most > 0.0, "most_m", "the largest radius must be above zero");
  const auto share_at = [&](double radius) {
    return largest_over_angles(
        [&](double angle) { return miss_at(*this, at, radius, angle).share; });
  };
  // The first crossing: the share need not grow evenly once springs go slack.
  constexpr int kSteps = 50;
  double low = 0.0;
  double high = most;
  int i = 1;
  for (; i <= kSteps; ++i) {
    high = most * i / kSteps;
    if (share_at(high) > share) break;
    low = high;
  }
  if (i > kSteps) return most;
  for (int half = 0; half < 40; ++half) {
    const double middle = 0.5 * (low + high);
    (share_at(middle) > share ? high : low) = middle;
  }
  return low;
}

}  // namespace ulna
