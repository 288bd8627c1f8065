#include "signal/crest.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

constexpr Index kPointsPerPeriod = 16;  // while optimising
constexpr Index kFinePerPeriod = 64;    // to judge the result
constexpr Index kLeastPoints = 256;
constexpr Index kLeastFinePoints = 4096;
constexpr Index kBlock = 256;
constexpr int kIterations = 25;       // of each norm; it ends earlier when nothing moves
constexpr double kNegligible = 1e-9;  // weight of a sample in the norm

Index points_of(const Sinusoids& lines, double span_s, Index per_period, Index least) {
  const double wanted =
      std::ceil(static_cast<double>(per_period) * lines.freq_hz.maxCoeff() * span_s);
  require(wanted <= 2e7, "lines", "the lines hold too many periods to optimise their phases");
  return std::max(least, static_cast<Index>(wanted));
}

// The lines at evenly spaced times over a span, without a call to a trigonometric function for
// every sample: columns cos(w t) and sin(w t).
struct Waves {
  Matrix cosine, sine;
};

Waves waves_of(const Sinusoids& lines, double span_s, Index points) {
  const Index count = lines.freq_hz.size();
  Waves out{Matrix(points, count), Matrix(points, count)};
  for (Index k = 0; k < count; ++k) {
    const double step = 2.0 * kPi * lines.freq_hz[k] * span_s / static_cast<double>(points);
    for (Index i = 0; i < points; ++i) {
      const double angle = step * static_cast<double>(i);
      out.cosine(i, k) = std::cos(angle);
      out.sine(i, k) = std::sin(angle);
    }
  }
  return out;
}

class Search {
 public:
  Search(const Sinusoids& lines, double span_s, Token* token)
      : lines_(lines),
        waves_(waves_of(lines, span_s, points_of(lines, span_s, kPointsPerPeriod, kLeastPoints))),
        token_(token) {}

  Vector signal(const Vector& phase) const {
    const Vector c = lines_.amplitude.array() * phase.array().cos();
    const Vector s = lines_.amplitude.array() * phase.array().sin();
    return waves_.cosine * c - waves_.sine * s;
  }

  // Descends the L_2p norm from a set of phases, for growing p.
  Vector descend(Vector phase) const {
    for (int p = 2; p <= 128; p *= 2) {
      double damping = 1e-3;
      Vector u = signal(phase);
      double scale = u.cwiseAbs().maxCoeff();
      double cost = norm(u, scale, p);
      for (int i = 0; i < kIterations; ++i) {
        step(token_, 0.0);
        Matrix normal;
        Vector gradient;
        linearise(phase, u, scale, p, normal, gradient);
        bool moved = false;
        double gain = 0.0;
        for (int tries = 0; tries < 8 && !moved; ++tries) {
          Matrix damped = normal;
          damped.diagonal().array() += damping * (normal.diagonal().maxCoeff() + 1e-300);
          const Vector candidate = phase - damped.ldlt().solve(gradient);
          const Vector there = signal(candidate);
          const double next = candidate.allFinite() ? norm(there, scale, p) : cost;
          if (next < cost) {
            gain = (cost - next) / cost;
            phase = candidate;
            u = there;
            scale = u.cwiseAbs().maxCoeff();
            cost = norm(u, scale, p);
            damping = std::max(1e-9, 0.2 * damping);
            moved = true;
          } else {
            damping *= 5.0;
          }
        }
        if (!moved || gain < 1e-4) break;
      }
    }
    return phase;
  }

 private:
  static double norm(const Vector& u, double scale, int p) {
    return (u.array() / scale).square().pow(static_cast<double>(p)).sum();
  }

  // Residuals (u / scale)^p; rows far below the peak weigh nothing and are left out.
  void linearise(const Vector& phase, const Vector& u, double scale, int p, Matrix& normal,
                 Vector& gradient) const {
    const Index count = phase.size();
    const Vector c = lines_.amplitude.array() * phase.array().cos();
    const Vector s = lines_.amplitude.array() * phase.array().sin();
    normal = Matrix::Zero(count, count);
    gradient = Vector::Zero(count);
    Matrix block(kBlock, count);
    Vector residual(kBlock);
    Index filled = 0;
    const auto flush = [&] {
      step(token_, 0.0);
      normal.selfadjointView<Eigen::Lower>().rankUpdate(block.topRows(filled).transpose());
      gradient.noalias() += block.topRows(filled).transpose() * residual.head(filled);
      filled = 0;
    };
    for (Index i = 0; i < u.size(); ++i) {
      const double ratio = u[i] / scale;
      const double power = std::pow(std::abs(ratio), p - 1);
      if (power < kNegligible) continue;
      const double slope = static_cast<double>(p) * power / scale;
      // d u / d phase(k) = -amplitude(k) sin(w t + phase(k)); the residual takes the sign of u.
      block.row(filled) =
          (ratio < 0.0 ? slope : -slope) * (waves_.sine.row(i).cwiseProduct(c.transpose()) +
                                            waves_.cosine.row(i).cwiseProduct(s.transpose()));
      residual[filled++] = power * std::abs(ratio);
      if (filled == kBlock) flush();
    }
    if (filled > 0) flush();
    normal = Matrix(normal.selfadjointView<Eigen::Lower>());
  }

  const Sinusoids& lines_;
  Waves waves_;
  Token* token_;
};

}  // namespace

Vector schroeder_phases(VectorRef amplitude) {
  const Vector power = amplitude.array().square() / amplitude.squaredNorm();
  Vector phase(amplitude.size());
  double slope = 0.0;
  double angle = 0.0;
  for (Index k = 0; k < phase.size(); ++k) {
    phase[k] = std::remainder(-2.0 * kPi * angle, 2.0 * kPi);
    slope += power[k];
    angle += slope;
  }
  return phase;
}

double crest_factor(const Sinusoids& lines, double span_s) {
  const Index points = points_of(lines, span_s, kFinePerPeriod, kLeastFinePoints);
  Vector u = Vector::Zero(points);
  for (Index k = 0; k < lines.freq_hz.size(); ++k) {
    const double step = 2.0 * kPi * lines.freq_hz[k] * span_s / static_cast<double>(points);
    for (Index i = 0; i < points; ++i) {
      u[i] += lines.amplitude[k] * std::cos(step * static_cast<double>(i) + lines.phase_rad[k]);
    }
  }
  return u.cwiseAbs().maxCoeff() / std::sqrt(u.squaredNorm() / static_cast<double>(points));
}

Vector low_crest_phases(const Sinusoids& lines, double span_s, int starts, std::uint64_t seed,
                        std::uint64_t stream, Token* token) {
  const Index count = lines.freq_hz.size();
  if (count < 2) return lines.phase_rad;  // one sinusoid has one crest factor
  const Search search(lines, span_s, token);
  const auto peak = [&](const Vector& phase) { return search.signal(phase).cwiseAbs().maxCoeff(); };
  Vector best = lines.phase_rad;
  double lowest = peak(best);
  Random random(seed, stream);
  for (int start = 0; start <= starts; ++start) {
    Vector phase = lines.phase_rad;
    if (start > 0) {
      for (Index k = 0; k < count; ++k) phase[k] = 2.0 * kPi * random.uniform();
    }
    phase = search.descend(std::move(phase));
    const double found = peak(phase);
    if (found < lowest) {
      lowest = found;
      best = phase;
    }
  }
  return best.unaryExpr([](double a) { return std::remainder(a, 2.0 * kPi); });
}

}  // namespace ulna
