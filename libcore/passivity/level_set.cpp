#include "passivity/level_set.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace ulna {
namespace {

// 0 to infinity on 0 to 1 around a frequency of one's own.
double to_unit(double omega, double center) {
  return std::isinf(omega) ? 1.0 : omega / (omega + center);
}

double from_unit(double u, double center) { return u >= 1.0 ? kInfinity : center * u / (1.0 - u); }

class Search {
 public:
  Search(const LevelSetProblem& problem, const Band& band) : problem_(problem), band_(band) {}

  void visit(double omega) {
    if (!band_.holds(omega) || seen_.count(omega) > 0) return;
    const double value = problem_.value(omega);
    if (std::isnan(value)) return;
    seen_[omega] = value;
    if (value < best_.value) best_ = {value, omega};
  }

  // Brent's parabolas and golden sections between the neighbours of the best point.
  void refine() {
    auto here = seen_.find(best_.omega);
    if (here == seen_.end()) return;
    const double low = here == seen_.begin() ? best_.omega : std::prev(here)->first;
    const double high = std::next(here) == seen_.end() ? best_.omega : std::next(here)->first;
    if (low >= high) return;
    double center = best_.omega;
    if (!(center > 0.0) || std::isinf(center)) center = std::isinf(center) ? low : high;
    if (!(center > 0.0) || std::isinf(center)) center = 1.0;
    descend(to_unit(low, center), to_unit(high, center), center);
  }

  const Extremum& best() const { return best_; }

  // Where the value is the same at many frequencies to rounding, an end of the band if it is one
  // of them.
  Extremum preferred() const {
    if (!std::isfinite(best_.value)) return best_;
    const double rounding = 1e-4 * problem_.resolution(best_.omega);
    for (const double end : {band_.low, band_.high}) {
      const auto found = seen_.find(end);
      if (found == seen_.end() || found->second > best_.value + rounding) continue;
      return {found->second, end};
    }
    return best_;
  }

 private:
  double at(double u, double center) {
    const double omega = from_unit(u, center);
    visit(omega);
    const auto found = seen_.find(omega);
    return found == seen_.end() ? kInfinity : found->second;
  }

  void descend(double a, double b, double center) {
    constexpr double kGolden = 0.381966011250105;
    double x = to_unit(best_.omega, center);
    double w = x;
    double v = x;
    double fx = best_.value;
    double fw = fx;
    double fv = fx;
    double step = 0.0;
    double before = 0.0;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (a + b);
      // Minima are flat: a relative 1e-9 of the frequency moves the value by less than rounding.
      const double tolerance = 1e-9 * x + 1e-14;
      if (std::abs(x - middle) <= 2.0 * tolerance - 0.5 * (b - a)) return;
      bool golden = true;
      if (std::abs(before) > tolerance) {
        const double r = (x - w) * (fx - fv);
        double q = (x - v) * (fx - fw);
        double p = (x - v) * q - (x - w) * r;
        q = 2.0 * (q - r);
        if (q > 0.0) p = -p;
        q = std::abs(q);
        const double last = before;
        before = step;
        if (std::abs(p) < std::abs(0.5 * q * last) && p > q * (a - x) && p < q * (b - x)) {
          step = p / q;
          golden = false;
        }
      }
      if (golden) {
        before = x < middle ? b - x : a - x;
        step = kGolden * before;
      }
      const double moved =
          x + (std::abs(step) >= tolerance ? step : std::copysign(tolerance, step));
      const double u = std::clamp(moved, a, b);
      const double fu = at(u, center);
      if (fu <= fx) {
        (u < x ? b : a) = x;
        v = w, fv = fw;
        w = x, fw = fx;
        x = u, fx = fu;
      } else {
        (u < x ? a : b) = u;
        if (fu <= fw || w == x) {
          v = w, fv = fw;
          w = u, fw = fu;
        } else if (fu <= fv || v == x || v == w) {
          v = u, fv = fu;
        }
      }
    }
  }

  const LevelSetProblem& problem_;
  Band band_;
  std::map<double, double> seen_;
  Extremum best_{kInfinity, 0.0};
};

}  // namespace

std::vector<double> with_midpoints(std::vector<double> omega, const Band& band) {
  std::erase_if(omega, [&](double w) { return !band.holds(w); });
  omega.push_back(band.low);
  omega.push_back(band.high);
  std::sort(omega.begin(), omega.end());
  omega.erase(std::unique(omega.begin(), omega.end()), omega.end());
  std::vector<double> out;
  for (std::size_t i = 0; i < omega.size(); ++i) {
    out.push_back(omega[i]);
    if (i + 1 == omega.size()) break;
    const double low = omega[i];
    const double high = omega[i + 1];
    if (std::isinf(high)) {
      out.push_back(low > 0.0 ? 2.0 * low : 1.0);
    } else {
      out.push_back(low > 0.0 ? std::sqrt(low) * std::sqrt(high) : 0.5 * high);
    }
  }
  return out;
}

Extremum smallest(const LevelSetProblem& problem, const std::vector<double>& start,
                  const Band& band) {
  Search search(problem, band);
  for (const double omega : with_midpoints(start, band)) search.visit(omega);
  // Each round ends at a lower local minimum, of which a rational function has finitely many.
  for (int round = 0; round < 60; ++round) {
    if (!std::isfinite(search.best().value)) break;
    search.refine();
    const Extremum found = search.best();
    const double level = found.value - problem.resolution(found.omega);
    for (const double omega : with_midpoints(problem.crossings(level), band)) search.visit(omega);
    if (!(search.best().value < level)) {
      break;
    }
  }
  return search.preferred();
}

}  // namespace ulna
