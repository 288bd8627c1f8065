#include "plant/spring_design.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "base/random.hpp"
#include "base/words.hpp"

namespace ulna {

namespace {

constexpr int kPlaces = 8;
// Arrangements that are tried one by one: about a second.
constexpr std::int64_t kTryAll = 400'000;
constexpr int kStarts = 16;
constexpr double kLinearShare = 0.05;

using Choice = std::array<int, kPlaces>;  // kind of every place, -1: empty

bool is_taut(const SpringEquilibrium& at, double radius) {
  return at.slack_radius >= radius * (1.0 - 1e-12) &&
         std::find(at.slack.begin(), at.slack.end(), true) == at.slack.end();
}

bool is_central(const SpringEquilibrium& at, const SpringDesignOptions& options) {
  const Vector2 d = (at.position - options.centre).cwiseAbs();
  return d(0) <= options.reach * options.half_x && d(1) <= options.reach * options.half_y;
}

// What an arrangement is worth: springs that stay taut around a handle that rests near the centre
// come before a nearer stiffness.
struct Score {
  bool usable = false;
  double error = kInfinity;
  bool better_than(const Score& other) const {
    if (error == kInfinity || other.error == kInfinity) return error < other.error;
    if (usable != other.usable) return usable;
    return error < other.error;
  }
};

struct Best {
  Score score;
  Choice choice{};
  std::int64_t evaluations = 0;
};

class Drawer {
 public:
  Drawer(const Matrix2& wanted, const SpringDesignOptions& options)
      : wanted_(wanted),
        options_(options),
        anchors_(SpringArray::frame_anchors(options.half_x, options.half_y, options.centre)) {}

  int kinds() const { return static_cast<int>(options_.kinds.size()); }

  bool available(const Choice& choice) const {
    std::vector<int> used(options_.kinds.size(), 0);
    for (const int kind : choice) {
      if (kind < 0) continue;
      const auto k = static_cast<std::size_t>(kind);
      if (options_.kinds[k].count > 0 && ++used[k] > options_.kinds[k].count) return false;
    }
    return true;
  }

  Score score(const Choice& choice) const {
    if (!available(choice)) return {};
    std::vector<Spring> springs;
    springs.reserve(kPlaces);
    for (std::size_t i = 0; i < kPlaces; ++i) {
      if (choice[i] < 0) continue;
      const SpringKind& kind = options_.kinds[static_cast<std::size_t>(choice[i])];
      springs.push_back({anchors_[i], kind.rate, kind.rest});
    }
    if (springs.size() < 2) return {};
    SpringEquilibrium at;
    if (!SpringArray(std::move(springs)).find_equilibrium(at)) return {};
    Score out;
    out.error = (at.stiffness - wanted_).norm() / wanted_.norm();
    out.usable = is_taut(at, options_.radius) && is_central(at, options_);
    return out;
  }

 private:
  Matrix2 wanted_;
  const SpringDesignOptions& options_;
  std::array<Vector2, 8> anchors_;
};

void keep_better(Best& best, const Best& other) {
  best.evaluations += other.evaluations;
  if (!other.score.better_than(best.score)) return;
  best.score = other.score;
  best.choice = other.choice;
}

// Every arrangement, split over the kinds of the first place.
Best try_all(const Drawer& drawer, int threads, Token* token) {
  const int options = drawer.kinds() + 1;
  std::vector<Best> parts(static_cast<std::size_t>(options));
  std::int64_t each = 1;
  for (int i = 1; i < kPlaces; ++i) each *= options;
  parallel_for(
      options, threads,
      [&](std::ptrdiff_t first) {
        Best& best = parts[static_cast<std::size_t>(first)];
        Choice choice;
        choice[0] = static_cast<int>(first) - 1;
        for (std::int64_t code = 0; code < each; ++code) {
          std::int64_t rest = code;
          for (std::size_t i = 1; i < kPlaces; ++i, rest /= options) {
            choice[i] = static_cast<int>(rest % options) - 1;
          }
          const Score score = drawer.score(choice);
          ++best.evaluations;
          if (score.better_than(best.score)) {
            best.score = score;
            best.choice = choice;
          }
          if (code % 4096 == 0 && token != nullptr && token->cancelled()) step(token, 0.0);
        }
      },
      token);
  Best best;
  for (const Best& part : parts) keep_better(best, part);
  return best;
}

// From one arrangement to the best that changing one or two places reaches, until nothing helps.
void descend(const Drawer& drawer, Best& best, Token* token) {
  const int kinds = drawer.kinds();
  for (bool improved = true; improved;) {
    improved = false;
    const Choice from = best.choice;
    for (std::size_t a = 0; a < kPlaces; ++a) {
      for (std::size_t b = a; b < kPlaces; ++b) {
        if (token != nullptr && token->cancelled()) step(token, 0.0);
        for (int ka = -1; ka < kinds; ++ka) {
          for (int kb = a == b ? ka : -1; kb < (a == b ? ka + 1 : kinds); ++kb) {
            Choice trial = from;
            trial[a] = ka;
            trial[b] = kb;
            const Score score = drawer.score(trial);
            ++best.evaluations;
            if (!score.better_than(best.score)) continue;
            best.score = score;
            best.choice = trial;
            improved = true;
          }
        }
      }
    }
  }
}

Best search(const Drawer& drawer, const SpringDesignOptions& options, Token* token) {
  std::vector<Best> starts(kStarts);
  parallel_for(
      kStarts, options.threads,
      [&](std::ptrdiff_t i) {
        Best& best = starts[static_cast<std::size_t>(i)];
        Random random(options.seed, static_cast<std::uint64_t>(i));
        for (int& kind : best.choice) kind = static_cast<int>(random.below(drawer.kinds() + 1)) - 1;
        best.score = drawer.score(best.choice);
        descend(drawer, best, token);
      },
      token);
  Best best;
  for (const Best& start : starts) keep_better(best, start);
  return best;
}

// Rates between 0 and max_rate that bring the stiffness nearest without a force at the place.
std::vector<double> continuous_rates(const Matrix2& wanted, const SpringDesignOptions& options) {
  const auto anchors = SpringArray::frame_anchors(options.half_x, options.half_y, options.centre);
  const Vector2 place = options.centre + options.offset;
  const double root2 = std::sqrt(2.0);
  std::vector<Index> usable;
  Eigen::Matrix<double, 3, Eigen::Dynamic> stiffness(3, kPlaces);
  Eigen::Matrix<double, 2, Eigen::Dynamic> force(2, kPlaces);
  for (Index i = 0; i < kPlaces; ++i) {
    const Vector2 d = place - anchors[static_cast<std::size_t>(i)];
    const double length = d.norm();
    if (length - options.rest < options.radius) continue;
    usable.push_back(i);
    const Vector2 u = d / length;
    const double across = 1.0 - options.rest / length;
    const Matrix2 k = across * Matrix2::Identity() + (1.0 - across) * u * u.transpose();
    stiffness.col(i) << k(0, 0), k(1, 1), root2 * k(0, 1);
    force.col(i) = -across * d;
  }
  if (usable.size() < 3) {
    throw Error(Fault::kArgument, "rest_m",
                sentence(4, "springs of ", options.rest, " m leave fewer than three places of the ",
                         "frame taut within ", options.radius,
                         " m: use shorter springs or a smaller radius"));
  }
  const Eigen::Vector3d target(wanted(0, 0), wanted(1, 1), root2 * wanted(0, 1));
  const bool bounded = options.max_rate > 0.0;
  const int states = bounded ? 3 : 2;
  const Index n = static_cast<Index>(usable.size());
  std::int64_t cases = 1;
  for (Index i = 0; i < n; ++i) cases *= states;

  Vector best = Vector::Zero(kPlaces);
  double best_cost = kInfinity;
  const double size = target.norm();
  // Forces in units of a stiffness: no force at the place is a condition, not one wish among many.
  const double length = options.half_x + options.half_y;
  for (std::int64_t code = 0; code < cases; ++code) {
    // 0: empty, 1: free, 2: at the largest rate.
    std::vector<Index> free;
    Vector rates = Vector::Zero(kPlaces);
    std::int64_t rest = code;
    for (const Index place_index : usable) {
      const auto state = rest % states;
      rest /= states;
      if (state == 1) free.push_back(place_index);
      if (state == 2) rates[place_index] = options.max_rate;
    }
    if (!free.empty()) {
      const Index f = static_cast<Index>(free.size());
      const Matrix a = stiffness(Eigen::all, free);
      const Matrix c = force(Eigen::all, free) / length;
      const Eigen::Vector3d b = target - stiffness * rates;
      const Eigen::Vector2d d = -force * rates / length;
      // Least squares under c k = d: particular solution, then the null space of c.
      Eigen::CompleteOrthogonalDecomposition<Matrix> conditions(c);
      const Vector particular = conditions.solve(d);
      if ((c * particular - d).norm() > 1e-10 * size) continue;
      const Index rank = conditions.rank();
      Vector k = particular;
      if (f > rank) {
        Eigen::ColPivHouseholderQR<Matrix> range(c.transpose());
        const Matrix q = range.householderQ();
        const Matrix null = q.rightCols(f - rank);
        const Matrix reduced = a * null;
        k += null *
             Eigen::CompleteOrthogonalDecomposition<Matrix>(reduced).solve(b - a * particular);
      }
      bool feasible = true;
      for (Index i = 0; i < f; ++i) {
        if (k[i] < -1e-12 * size || (bounded && k[i] > options.max_rate * (1.0 + 1e-12))) {
          feasible = false;
        }
        rates[free[static_cast<std::size_t>(i)]] = std::max(k[i], 0.0);
      }
      if (!feasible) continue;
    }
    if ((force * rates).norm() > 1e-9 * size * length) continue;
    const double miss = (stiffness * rates - target).norm() / size;
    // The second part only decides between arrangements that come equally near.
    const double cost = miss + 1e-9 * rates.norm() / size;
    if (rates.squaredNorm() > 0.0 && cost < best_cost) {
      best_cost = cost;
      best = rates;
    }
  }
  // Rates that rounding leaves above zero are empty places.
  const double least = 1e-9 * best.maxCoeff();
  return [&] {
    std::vector<double> out(kPlaces);
    for (Index i = 0; i < kPlaces; ++i)
      out[static_cast<std::size_t>(i)] = best[i] > least ? best[i] : 0.0;
    return out;
  }();
}

void check(const Matrix2& wanted, const SpringDesignOptions& options) {
  const bool finite = wanted.allFinite();
  const double asymmetry = std::abs(wanted(0, 1) - wanted(1, 0));
  require(finite && asymmetry <= 1e-9 * wanted.norm(), "stiffness_n_m",
          "springs are conservative: the wanted stiffness must be symmetric and finite");
  const double least = Eigen::SelfAdjointEigenSolver<Matrix2>(wanted).eigenvalues()(0);
  require(least > 0.0, "stiffness_n_m",
          sentence(4, "the wanted stiffness must be positive in every direction; its smallest ",
                   "eigenvalue is ", least, " N/m"));
  require(std::isfinite(options.radius) && options.radius > 0.0, "radius_m",
          "the radius within which springs stay taut must be above zero");
  require(options.reach > 0.0 && options.reach <= 1.0, "reach",
          "the reach is a share of the half sides, above 0 and at most 1");
  require(options.threads >= 0, "threads", "the number of threads must not be negative");
  for (std::size_t i = 0; i < options.kinds.size(); ++i) {
    const SpringKind& kind = options.kinds[i];
    if (std::isfinite(kind.rate) && kind.rate > 0.0 && std::isfinite(kind.rest) &&
        kind.rest > 0.0 && kind.count >= 0) {
      continue;
    }
    throw Error(Fault::kArgument, "springs",
                sentence(4, "spring ", i + 1, " of the drawer has a rate of ", kind.rate,
                         " N/m, a rest length of ", kind.rest, " m and a count of ", kind.count,
                         "; rate and length must be above zero"),
                sentence(4, "spring ", i + 1));
  }
  require(options.kinds.size() <= 1000, "springs", "a drawer holds at most 1000 kinds of spring");
  require(std::isfinite(options.rest) && options.rest > 0.0, "rest_m",
          "the rest length must be above zero");
  require(std::isfinite(options.max_rate) && options.max_rate >= 0.0, "max_rate_n_m",
          "the largest rate must not be negative");
  require(options.offset.allFinite() && std::abs(options.offset(0)) < options.half_x &&
              std::abs(options.offset(1)) < options.half_y,
          "offset_m", "the wanted equilibrium must lie inside the frame");
}

}  // namespace

SpringDesign design_springs(const Matrix2& wanted, const SpringDesignOptions& options,
                            Token* token) {
  check(wanted, options);
  SpringDesign out;
  out.kinds.assign(kPlaces, -1);
  if (options.kinds.empty()) {
    out.rates = continuous_rates(wanted, options);
    out.rests.assign(kPlaces, options.rest);
    out.exhaustive = true;
    out.evaluations = 1;
  } else {
    const Drawer drawer(wanted, options);
    const double all = std::pow(static_cast<double>(drawer.kinds() + 1), kPlaces);
    out.exhaustive = all <= static_cast<double>(kTryAll);
    const Best best =
        out.exhaustive ? try_all(drawer, options.threads, token) : search(drawer, options, token);
    if (best.score.error == kInfinity) {
      throw Error(Fault::kAnalysis, "springs",
                  "no arrangement of these springs holds the handle in every direction: there are "
                  "too few of them or they are longer than the frame");
    }
    out.evaluations = best.evaluations;
    out.rates.assign(kPlaces, 0.0);
    out.rests.assign(kPlaces, options.rest);
    for (std::size_t i = 0; i < kPlaces; ++i) {
      out.kinds[i] = best.choice[i];
      if (best.choice[i] < 0) continue;
      const SpringKind& kind = options.kinds[static_cast<std::size_t>(best.choice[i])];
      out.rates[i] = kind.rate;
      out.rests[i] = kind.rest;
    }
  }
  const SpringArray array =
      SpringArray::on_frame(out.rates, out.rests, options.centre, options.half_x, options.half_y);
  out.achieved = array.equilibrium();
  out.error = (out.achieved.stiffness - wanted).norm() / wanted.norm();
  out.linearity = array.linearity(out.achieved, options.radius);
  out.linear_radius = array.linear_radius(out.achieved, kLinearShare);
  out.taut = is_taut(out.achieved, options.radius);
  out.central = is_central(out.achieved, options);
  return out;
}

Matrix2 stiffness_of_ellipse(double major, double minor, double angle) {
  require(std::isfinite(major) && std::isfinite(minor) && std::isfinite(angle) && minor > 0.0 &&
              major >= minor,
          "ellipse", "an ellipse of stiffness has major >= minor > 0 and a finite angle");
  const Vector2 u(std::cos(angle), std::sin(angle));
  return minor * Matrix2::Identity() + (major - minor) * u * u.transpose();
}

}  // namespace ulna
