#include "signal/excitation.hpp"

#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

constexpr double kMostRows = 1e8;

}  // namespace

void check_rate(double rate_hz) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz",
          "the sampling rate must be a positive number of Hz");
}

void check_axes(Index axes) {
  require(axes >= 1 && axes <= 6, "axes",
          "a design has from 1 to 6 axes, not " + std::to_string(axes));
}

Index rows_of(double duration_s, double rate_hz, const char* argument) {
  require(std::isfinite(duration_s) && duration_s > 0.0, argument,
          std::string(argument) + " must be a positive number of seconds");
  const double rows = std::round(duration_s * rate_hz);
  require(rows >= 2.0 && rows <= kMostRows, argument,
          sentence(6, duration_s, " s at ", rate_hz, " Hz are ", rows,
                   " samples: a design has from 2 to 1e8"));
  return static_cast<Index>(rows);
}

Extent extent_of(const Excitation& excitation) {
  const Index n = excitation.axes();
  Extent out{Vector::Zero(n), Vector::Zero(n), Vector::Zero(n)};
  Index rows = 0;
  for (const RowRange& range : excitation.segments) {
    const auto part = excitation.value.middleRows(range.begin, range.end - range.begin);
    out.peak = out.peak.cwiseMax(part.cwiseAbs().colwise().maxCoeff().transpose());
    out.rms += part.colwise().squaredNorm().transpose();
    rows += part.rows();
  }
  out.rms = (out.rms / static_cast<double>(rows)).cwiseSqrt();
  out.crest = out.peak.cwiseQuotient(out.rms);
  return out;
}

Excitation scaled(const Excitation& excitation, double factor) {
  require(std::isfinite(factor) && factor != 0.0, "factor",
          "the factor must be a finite number other than 0");
  Excitation out = excitation;
  out.value *= factor;
  out.rate *= factor;
  out.acceleration *= factor;
  for (Line& line : out.lines) line.amplitude *= factor;
  for (StepEvent& event : out.events) event.size *= factor;
  out.provenance += sentence(9, ", scaled by ", factor);
  return out;
}

Excitation excitation_of(Drive drive, double rate_hz, MatrixRef value,
                         std::vector<RowRange> segments, const Matrix& rate,
                         const Matrix& acceleration) {
  check_rate(rate_hz);
  check_axes(value.cols());
  const Index rows = value.rows();
  require(rows >= 3, "reference", "a design needs at least 3 rows");
  require_finite(value, "reference");
  Index before = 0;
  for (const RowRange& range : segments) {
    require(range.begin >= before && range.end > range.begin && range.end <= rows, "segments",
            "segments must lie in order, apart and within the " + std::to_string(rows) +
                " rows of the reference");
    before = range.end;
  }
  Excitation out;
  out.drive = drive;
  out.rate_hz = rate_hz;
  out.value = value;
  const auto slope = [&](const Matrix& y) {
    Matrix d(rows, y.cols());
    d.middleRows(1, rows - 2) = 0.5 * rate_hz * (y.bottomRows(rows - 2) - y.topRows(rows - 2));
    d.row(0) = rate_hz * (y.row(1) - y.row(0));
    d.row(rows - 1) = rate_hz * (y.row(rows - 1) - y.row(rows - 2));
    return d;
  };
  const auto given = [&](const Matrix& y, const char* argument) {
    if (y.size() == 0) return false;
    require(y.rows() == rows && y.cols() == value.cols(), argument,
            std::string("the ") + argument + " must have the shape of the reference");
    require_finite(y, argument);
    return true;
  };
  out.rate = given(rate, "velocity") ? rate : slope(out.value);
  out.acceleration = given(acceleration, "acceleration") ? acceleration : slope(out.rate);
  out.segments = segments.empty() ? std::vector<RowRange>{{0, rows}} : std::move(segments);
  out.provenance = "design: a signal of one's own";
  return out;
}

SignalPoint gently_back(const SignalPoint& from, double duration_s, double t_s) {
  // Hermite polynomials of fifth order in s = t / T; the state at s = 1 is zero.
  const double T = duration_s;
  const double s = t_s / T;
  const double p = from.value;
  const double v = from.rate * T;
  const double a = from.acceleration * T * T;
  const double c[6] = {p,
                       v,
                       0.5 * a,
                       -10.0 * p - 6.0 * v - 1.5 * a,
                       15.0 * p + 8.0 * v + 1.5 * a,
                       -6.0 * p - 3.0 * v - 0.5 * a};
  SignalPoint out;
  for (int k = 5; k >= 0; --k) {
    out.acceleration = out.acceleration * s + 2.0 * out.rate;
    out.rate = out.rate * s + out.value;
    out.value = out.value * s + c[k];
  }
  out.rate /= T;
  out.acceleration /= T * T;
  return out;
}

SignalPoint smooth_rise(double t) {
  if (t <= 0.0) return {};
  if (t >= 1.0) return {1.0, 0.0, 0.0};
  return {t * t * t * (10.0 + t * (6.0 * t - 15.0)), 30.0 * t * t * (1.0 - t) * (1.0 - t),
          60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)};
}

}  // namespace ulna
