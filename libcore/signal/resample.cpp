#include "signal/resample.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

constexpr double kGapSteps = 1.5;  // a step beyond it is reported as a gap

// Windowed sincs with a Kaiser window over +-32 samples: the transition is 0.3 of the Nyquist
// frequency wide and the ripple 1e-7 (146 dB by Kaiser's formula). The fit uses the interpolating
// sinc, cut-off 1: flat up to 0.85, and on undisturbed stamps it changes nothing. A lower rate uses
// cut-off 0.85: flat up to 0.7 of the new Nyquist frequency, closed from 1.
constexpr double kFitCutoff = 1.0;
constexpr double kDecimateCutoff = 0.85;
constexpr double kKnotsPerSample = 0.85;
constexpr int kReach = 32;
constexpr double kBeta = 15.1;

constexpr Index kChunkRows =
    16384;  // rows fitted at a time, so that memory does not grow with the log
constexpr Index kMarginRows = 128;  // fitted on either side of a chunk and thrown away

std::string row_text(Index row) { return "row " + std::to_string(row); }

void check_times(VectorRef times) {
  if (times.size() < 2) {
    throw Error(Fault::kData, "times",
                "the clock has fewer than 2 samples: nothing can be said of it");
  }
  for (Index i = 0; i < times.size(); ++i) {
    if (!std::isfinite(times(i))) {
      throw Error(Fault::kData, "times", "the time at " + row_text(i) + " is not a finite number",
                  row_text(i));
    }
    if (i > 0 && !(times(i) > times(i - 1))) {
      throw Error(Fault::kData, "times",
                  "the time at " + row_text(i) +
                      " does not follow that of the row before: sort the rows " +
                      "or split the log there",
                  row_text(i));
    }
  }
}

double median_step(VectorRef times) {
  std::vector<double> steps(static_cast<std::size_t>(times.size() - 1));
  for (std::size_t i = 0; i < steps.size(); ++i) {
    steps[i] = times(static_cast<Index>(i) + 1) - times(static_cast<Index>(i));
  }
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  if (steps.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(steps.begin(), middle));
}

// The kernel in a table with cubic interpolation: exact to 1e-10, fifty times faster than its
// formula.
class Kernel {
 public:
  explicit Kernel(double cutoff) {
    const int count = kReach * kPerUnit + 4;
    table_.resize(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      table_[static_cast<std::size_t>(i)] = formula(cutoff, static_cast<double>(i - 1) / kPerUnit);
    }
  }

  double operator()(double x) const {
    const double at = std::abs(x) * kPerUnit;
    if (at >= static_cast<double>(kReach * kPerUnit)) return 0.0;
    const double whole = std::floor(at);
    const double t = at - whole;
    const double* p = table_.data() + static_cast<std::ptrdiff_t>(whole);
    const double c1 = 0.5 * (t + 1.0) * (t - 1.0) * (t - 2.0);
    const double c2 = -0.5 * (t + 1.0) * t * (t - 2.0);
    const double c0 = -t * (t - 1.0) * (t - 2.0) / 6.0;
    const double c3 = (t + 1.0) * t * (t - 1.0) / 6.0;
    return c0 * p[0] + c1 * p[1] + c2 * p[2] + c3 * p[3];
  }

 private:
  static constexpr int kPerUnit = 512;

  static double formula(double cutoff, double x) {
    const double share = x / kReach;
    if (std::abs(share) >= 1.0) return 0.0;
    const double window = std::cyl_bessel_i(0.0, kBeta * std::sqrt(1.0 - share * share)) /
                          std::cyl_bessel_i(0.0, kBeta);
    const double angle = kPi * cutoff * x;
    return cutoff * window * (std::abs(angle) < 1e-9 ? 1.0 : std::sin(angle) / angle);
  }

  std::vector<double> table_;
};

// The signal is sum over k of u(k) kernel((t - start) / step - k). S maps u to the recorded
// instants.
class Fit {
 public:
  Fit(VectorRef times, double step_s, const Kernel& kernel)
      : start_(times(0)), step_(step_s), rows_(times.size()), kernel_(kernel) {
    position_ = (times.array() - start_) / step_;
    // Knots reach beyond both ends: they let the ends follow the data instead of an assumed
    // extension.
    first_ = -kReach;
    count_ = static_cast<Index>(std::ceil(position_(rows_ - 1))) + 2 * kReach + 1;
    weights_.resize(kTaps, rows_);
    for (Index i = 0; i < rows_; ++i) {
      for (Index k = 0; k < kTaps; ++k) {
        weights_(k, i) = kernel(position_(i) - static_cast<double>(first_tap(i) + first_ + k));
      }
    }
    // Each instant counts for the time it stands for: crowded samples do not outvote lone ones.
    density_.resize(rows_);
    for (Index i = 0; i < rows_; ++i) {
      const double before = position_(std::max<Index>(i - 1, 0));
      const double after = position_(std::min(i + 1, rows_ - 1));
      density_(i) = 0.5 * (after - before);
    }
  }

  Index knots() const { return count_; }

  // Time in knots, counted from the first knot.
  double locate(double seconds_after_start) const {
    return seconds_after_start / step_ - static_cast<double>(first_);
  }
  double locate_end() const { return position_(rows_ - 1) - static_cast<double>(first_); }

  // The fitted signal at a place within the record, in knots.
  Eigen::RowVectorXd value(const Matrix& u, double at) const {
    const Index low = std::max<Index>(0, static_cast<Index>(std::floor(at)) - kReach + 1);
    const Index high = std::min(count_, static_cast<Index>(std::floor(at)) + kReach + 1);
    Eigen::RowVectorXd v = Eigen::RowVectorXd::Zero(u.cols());
    for (Index k = low; k < high; ++k) v += kernel_(at - static_cast<double>(k)) * u.row(k);
    return v;
  }

  // Conjugate gradients on the weighted least-squares problem from linear interpolation. They
  // settle the band that the samples determine first; stopping when they stall keeps noise above it
  // out.
  Vector solve(const Vector& y, const ResampleOptions& options, Token* token) const {
    Vector u = linear(y);
    Vector residual = y - forward(u);
    Vector gradient = backward(density_.cwiseProduct(residual));
    Vector direction = gradient;
    double slope = gradient.squaredNorm();
    double size = weighted(residual);
    int stalled = 0;
    // Never below what rounding leaves, or a constant signal would be fitted for ever.
    const double enough =
        std::max(options.tolerance * weighted(y.array() - y.mean()), 1e-13 * weighted(y));
    for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
      if (size <= enough || slope <= 0.0) break;
      if (token != nullptr && token->cancelled()) step(token, token->progress());
      const Vector image = forward(direction);
      const double curvature = image.cwiseAbs2().dot(density_);
      if (!(curvature > 0.0)) break;
      const double length = slope / curvature;
      u += length * direction;
      residual -= length * image;
      const double next_size = weighted(residual);
      stalled = next_size > 0.9999 * size ? stalled + 1 : 0;
      if (stalled == 3) break;
      size = next_size;
      gradient = backward(density_.cwiseProduct(residual));
      const double next_slope = gradient.squaredNorm();
      direction = gradient + (next_slope / slope) * direction;
      slope = next_slope;
    }
    return u;
  }

 private:
  static constexpr Index kTaps = 2 * kReach;

  // Number of the knot that the first tap of row i meets.
  Index first_tap(Index i) const {
    return static_cast<Index>(std::floor(position_(i))) - kReach + 1 - first_;
  }

  double weighted(const Vector& r) const { return std::sqrt(r.cwiseAbs2().dot(density_)); }

  Vector forward(const Vector& u) const {
    Vector y(rows_);
    for (Index i = 0; i < rows_; ++i) y(i) = weights_.col(i).dot(u.segment<kTaps>(first_tap(i)));
    return y;
  }

  Vector backward(const Vector& y) const {
    Vector u = Vector::Zero(count_);
    for (Index i = 0; i < rows_; ++i) u.segment<kTaps>(first_tap(i)) += y(i) * weights_.col(i);
    return u;
  }

  Vector linear(const Vector& y) const {
    Vector u(count_);
    Index row = 0;
    for (Index k = 0; k < count_; ++k) {
      const double at = static_cast<double>(k + first_);
      while (row + 2 < rows_ && position_(row + 1) < at) ++row;
      const double share = (at - position_(row)) / (position_(row + 1) - position_(row));
      u(k) = y(row) + std::clamp(share, 0.0, 1.0) * (y(row + 1) - y(row));
    }
    return u;
  }

  double start_;
  double step_;
  Index rows_;
  const Kernel& kernel_;
  Index first_ = 0;  // place of the first knot, in knots after the start
  Index count_ = 0;
  Vector position_;  // recorded instants in knots after the start
  Matrix weights_;   // kTaps x rows
  Vector density_;
};

void check_gaps(VectorRef times, double median, double max_gap_steps) {
  for (Index i = 0; i + 1 < times.size(); ++i) {
    const double gap = times(i + 1) - times(i);
    if (gap <= max_gap_steps * median) continue;
    throw Error(Fault::kData, "times",
                "the log has a gap of " + std::to_string(gap) + " s after " + row_text(i) + ", " +
                    std::to_string(gap / median) +
                    " times the median step: split it into trials there, nothing can be restored",
                row_text(i));
  }
}

void check_request(VectorRef times, MatrixRef y, double t0_s, double rate_hz, Index n,
                   const ResampleOptions& options) {
  check_times(times);
  require(
      y.rows() == times.size(), "y",
      "y has " + std::to_string(y.rows()) + " rows and the clock " + std::to_string(times.size()));
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "the sampling rate must be positive");
  require(n >= 0, "n", "the number of samples must not be negative");
  require(std::isfinite(t0_s), "t0_s", "the start must be a finite time");
  require(options.max_gap_steps >= 1.0 && options.tolerance > 0.0 && options.max_iterations >= 0,
          "options",
          "max_gap_steps must be at least 1, tolerance positive and max_iterations not negative");
  const double end = t0_s + static_cast<double>(std::max<Index>(n - 1, 0)) / rate_hz;
  // A millionth of a step, for the rounding of times computed by the caller.
  const double slack = 1e-6 / rate_hz;
  require(n == 0 || (t0_s >= times(0) - slack && end <= times(times.size() - 1) + slack), "t0_s",
          "the grid runs from " + std::to_string(t0_s) + " to " + std::to_string(end) +
              " s, the log from " + std::to_string(times(0)) + " to " +
              std::to_string(times(times.size() - 1)) + " s: ask for times within the log");
  require_finite(y, "y");
}

// The knots with `reach` more at either end, the record's signal continued oddly about its ends:
// what a wide low-pass kernel meets there.
Matrix extend(const Fit& fit, const Matrix& knots, Index reach) {
  const double begin = fit.locate(0.0);
  const double end = fit.locate_end();
  const Eigen::RowVectorXd at_begin = fit.value(knots, begin);
  const Eigen::RowVectorXd at_end = fit.value(knots, end);
  Matrix wide(knots.rows() + 2 * reach, knots.cols());
  for (Index k = 0; k < wide.rows(); ++k) {
    const double at = static_cast<double>(k - reach);
    if (at < begin) {
      wide.row(k) = 2.0 * at_begin - fit.value(knots, std::min(2.0 * begin - at, end));
    } else if (at > end) {
      wide.row(k) = 2.0 * at_end - fit.value(knots, std::max(2.0 * end - at, begin));
    } else {
      wide.row(k) = fit.value(knots, at);
    }
  }
  return wide;
}

Eigen::RowVectorXd filtered(const Kernel& kernel, double ratio, Index reach, const Matrix& knots,
                            double at) {
  const Index low = std::max<Index>(0, static_cast<Index>(std::ceil(at)) - reach);
  const Index high = std::min(knots.rows(), static_cast<Index>(std::floor(at)) + reach + 1);
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(knots.cols());
  double total = 0.0;
  for (Index k = low; k < high; ++k) {
    const double weight = kernel(ratio * (at - static_cast<double>(k)));
    total += weight;
    sum += weight * knots.row(k);
  }
  return sum / total;
}

}  // namespace

Jitter check_clock(VectorRef times) {
  check_times(times);
  Jitter j;
  j.median_step_s = median_step(times);
  double sum = 0.0;
  Index counted = 0;
  for (Index i = 0; i + 1 < times.size(); ++i) {
    const double gap = times(i + 1) - times(i);
    if (gap > kGapSteps * j.median_step_s) {
      j.gap_rows.push_back(i);
      if (gap > j.largest_gap_s) {
        j.largest_gap_s = gap;
        j.largest_gap_row = i;
      }
      continue;
    }
    const double deviation = std::abs(gap / j.median_step_s - 1.0);
    sum += deviation * deviation;
    ++counted;
    if (deviation > j.max_fraction) {
      j.max_fraction = deviation;
      j.worst_row = i + 1;
    }
  }
  j.gaps = static_cast<Index>(j.gap_rows.size());
  if (j.gaps > 0) j.first_gap_row = j.gap_rows.front();
  if (counted > 0) j.rms_fraction = std::sqrt(sum / static_cast<double>(counted));
  return j;
}

Matrix resample_columns(VectorRef times, MatrixRef y, double t0_s, double rate_hz, Index n,
                        const ResampleOptions& options, Token* token) {
  check_request(times, y, t0_s, rate_hz, n, options);
  check_gaps(times, median_step(times), options.max_gap_steps);

  const Index rows = times.size();
  const double step_s =
      (times(rows - 1) - times(0)) / static_cast<double>(rows - 1) / kKnotsPerSample;
  const double ratio = std::min(1.0, rate_hz * step_s);  // below 1 the kernel widens and low-passes
  const Kernel fit_kernel(kFitCutoff);
  const Kernel out_kernel(kDecimateCutoff);
  // No wider than the log, however low the rate.
  const Index reach =
      static_cast<Index>(std::ceil(std::min(kReach / ratio, 2.0 * static_cast<double>(rows))));
  const Index margin = kMarginRows + reach;

  Matrix out(n, y.cols());
  Index row = 0;
  for (Index done = 0; done < n;) {
    const double first_time = t0_s + static_cast<double>(done) / rate_hz;
    while (row + 1 < rows && times(row + 1) <= first_time) ++row;
    const Index end_row = std::min(rows, row + kChunkRows);
    const Index from = std::max<Index>(0, row - margin);
    const Index to = std::min(rows, end_row + margin);
    const Fit fit(times.segment(from, to - from), step_s, fit_kernel);
    Matrix knots(fit.knots(), y.cols());
    for (Index c = 0; c < y.cols(); ++c) {
      step(token, static_cast<double>(done) / static_cast<double>(n));
      knots.col(c) = fit.solve(y.col(c).segment(from, to - from), options, token);
    }
    const bool decimate = ratio < 1.0 - 1e-6;
    const Index extension = decimate ? reach : 0;
    if (decimate) knots = extend(fit, knots, reach);
    const double limit = end_row == rows ? times(rows - 1) + 1.0 / rate_hz : times(end_row - 1);
    const Index begun = done;
    for (; done < n; ++done) {
      const double at_s = t0_s + static_cast<double>(done) / rate_hz;
      if (done > begun && at_s > limit) break;
      const double at = fit.locate(at_s - times(from));
      out.row(done) =
          decimate ? filtered(out_kernel, ratio, reach, knots, at + static_cast<double>(extension))
                   : fit.value(knots, at);
    }
  }
  step(token, 1.0);
  return out;
}

Vector resample_uniform(VectorRef times, VectorRef y, double t0_s, double rate_hz, Index n,
                        const ResampleOptions& options, Token* token) {
  return resample_columns(times, y, t0_s, rate_hz, n, options, token).col(0);
}

}  // namespace ulna
