#include "impedance/safety.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

void check(const SafetyOptions& options) {
  const auto limit = [](double value, const char* argument) {
    require(std::isfinite(value) && value >= 0.0, argument,
            std::string("the limit ") + argument + " must be a positive number");
  };
  limit(options.limits.force, "force");
  limit(options.limits.displacement, "displacement");
  limit(options.limits.velocity, "velocity");
  require(std::isfinite(options.sigmas) && options.sigmas >= 0.0, "sigmas",
          "the multiple of the tremor must be 0 or more");
}

// Largest s >= 0 with |rest + s part| <= radius; infinite when the part is 0, 0 when the rest alone
// is too large.
double largest_scale(const Vector& rest, const Vector& part, double radius) {
  const double a = part.squaredNorm();
  const double b = rest.dot(part);
  const double c = rest.squaredNorm() - radius * radius;
  if (radius < 0.0 || c > 0.0) return 0.0;
  if (a == 0.0) return kInfinity;
  const double root = std::sqrt(b * b - a * c);
  // Without cancellation for either sign of b.
  return b > 0.0 ? -c / (b + root) : (root - b) / a;
}

PeakOf peak_of(const Matrix& part, const Vector& rest, const Matrix& covariance, double limit,
               bool per_axis, double sigmas, double rate_hz) {
  const Index n = part.cols();
  PeakOf out;
  out.limit = limit;
  out.scale = kInfinity;
  out.value = out.time_s = out.tremor = Vector::Zero(n + 1);
  out.tremor.head(n) = sigmas * covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Matrix> spread(covariance, Eigen::EigenvaluesOnly);
  out.tremor[n] = sigmas * std::sqrt(std::max(0.0, spread.eigenvalues()[n - 1]));
  const Matrix total = part.rowwise() + rest.transpose();
  for (Index a = 0; a <= n; ++a) {
    Index row = 0;
    const double largest = a < n ? total.col(a).cwiseAbs().maxCoeff(&row)
                                 : std::sqrt(total.rowwise().squaredNorm().maxCoeff(&row));
    out.value[a] = largest + out.tremor[a];
    out.time_s[a] = static_cast<double>(row) / rate_hz;
  }
  if (limit == 0.0) return out;

  for (Index i = 0; i < part.rows(); ++i) {
    for (Index a = per_axis ? 0 : n; a < (per_axis ? n : n + 1); ++a) {
      const double radius = limit - out.tremor[a];
      const double s = a < n ? largest_scale(rest.segment(a, 1), part.row(i).segment(a, 1), radius)
                             : largest_scale(rest, part.row(i).transpose(), radius);
      if (s >= out.scale) continue;
      out.scale = s;
      out.scale_time_s = static_cast<double>(i) / rate_hz;
      out.entry = out.axis = a;
      if (a == n) total.row(i).cwiseAbs().maxCoeff(&out.axis);
    }
  }
  out.within = out.scale >= 1.0;
  return out;
}

struct Words {
  const char* name;
  const char* unit;
};

Words words_of(Quantity quantity, bool rotational) {
  switch (quantity) {
    case Quantity::kForce:
      return {rotational ? "torque" : "force", rotational ? " N m" : " N"};
    case Quantity::kDisplacement:
      return {"displacement", rotational ? " rad" : " m"};
    case Quantity::kVelocity:
      return {"velocity", rotational ? " rad/s" : " m/s"};
  }
  return {"", ""};
}

}  // namespace

Safety check_safety(const Excitation& excitation, const ArmLoop& loop, const SafetyOptions& options,
                    Token* token) {
  check(options);
  const ArmLoop::Spread spread = loop.spread(options.tremor);
  const ArmLoop::Response response = loop.respond(excitation, token);
  const Vector still = Vector::Zero(loop.axes());
  const bool per_axis = options.limits.per_axis;
  const auto peak = [&](const Matrix& part, const Vector& rest, const Matrix& covariance,
                        double limit) {
    return peak_of(part, rest, covariance, limit, per_axis, options.sigmas, excitation.rate_hz);
  };
  Safety out;
  out.peaks[0] = peak(response.force, loop.rest_force(), spread.force, options.limits.force);
  out.peaks[1] = peak(response.position, still, spread.position, options.limits.displacement);
  out.peaks[2] = peak(response.velocity, still, spread.velocity, options.limits.velocity);
  out.scale = kInfinity;
  for (int q = 0; q < 3; ++q) {
    out.within = out.within && out.peaks[q].within;
    if (out.peaks[q].scale >= out.scale) continue;
    out.scale = out.peaks[q].scale;
    out.tightest = static_cast<Quantity>(q);
  }
  return out;
}

std::string safety_sentence(const Safety& safety, const std::vector<std::string>& axes,
                            bool rotational) {
  const PeakOf& peak = safety.peaks[static_cast<int>(safety.tightest)];
  const auto [name, unit] = words_of(safety.tightest, rotational);
  const Index n = peak.value.size() - 1;
  require(static_cast<Index>(axes.size()) == n, "axes", "there must be a name for every axis");
  if (std::isinf(safety.scale)) {
    const double force = safety.peaks[0].value[n];
    return sentence(3, "No limit was given: the ", words_of(Quantity::kForce, rotational).name,
                    " reaches ", force, words_of(Quantity::kForce, rotational).unit,
                    ", the displacement ", safety.peaks[1].value[n],
                    words_of(Quantity::kDisplacement, rotational).unit, " and the velocity ",
                    safety.peaks[2].value[n], words_of(Quantity::kVelocity, rotational).unit, ".");
  }
  const std::string where = sentence(6, " at ", peak.scale_time_s, " s, ",
                                     n > 1 && peak.entry == n ? "mostly along " : "along ",
                                     axes[static_cast<std::size_t>(peak.axis)]);
  if (safety.scale == 0.0) {
    return sentence(3,
                    "Out of limits even without a perturbation: what the arm pulls at rest and "
                    "the tremor (",
                    peak.tremor[peak.entry], unit, ") leave nothing of the limit of ", peak.limit,
                    unit, " on the ", name, ".");
  }
  const double largest = peak.value[peak.entry];
  if (!safety.within) {
    return sentence(3, "Out of limits: the ", name, " reaches ", largest, unit, where,
                    ", and the limit is ", peak.limit, unit, "; scale the design by at most ",
                    safety.scale, ".");
  }
  return sentence(3, "Within limits: closest is the ", name, ", ", largest, unit, " of ",
                  peak.limit, unit, where, "; the design may be scaled by up to ", safety.scale,
                  ".");
}

}  // namespace ulna
