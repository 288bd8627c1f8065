#include "signal/spectrum.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>
#include <unsupported/Eigen/FFT>

#include "base/error.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;

// Periodic, as scipy.signal.get_window('hann') gives it for spectra.
Vector hann(Index size) {
  Vector w(size);
  for (Index i = 0; i < size; ++i) {
    w(i) = 0.5 - 0.5 * std::cos(2.0 * kPi * static_cast<double>(i) / static_cast<double>(size));
  }
  return w;
}

// Sums the periodograms of successive segments.
class Accumulator {
 public:
  Accumulator(MatrixRef signals, Index segment)
      : signals_(signals), window_(hann(segment)), bins_(segment / 2 + 1) {
    fft_.SetFlag(Eigen::FFT<double>::HalfSpectrum);
    transforms_.resize(bins_, signals.cols());
    sum_.assign(static_cast<std::size_t>(bins_), MatrixXcd::Zero(signals.cols(), signals.cols()));
  }

  void add(Index begin) {
    const Index segment = window_.size();
    for (Index c = 0; c < signals_.cols(); ++c) {
      const auto piece = signals_.col(c).segment(begin, segment);
      windowed_ = (piece.array() - piece.mean()) * window_.array();
      fft_.fwd(transform_, windowed_);
      transforms_.col(c) = transform_.head(bins_);
    }
    for (Index f = 0; f < bins_; ++f) {
      const auto x = transforms_.row(f);
      sum_[static_cast<std::size_t>(f)].noalias() += x.adjoint() * x;
    }
  }

  const Vector& window() const { return window_; }
  std::vector<MatrixXcd> take() { return std::move(sum_); }

 private:
  MatrixRef signals_;
  Vector window_;
  Index bins_;
  Eigen::FFT<double> fft_;
  Vector windowed_;
  VectorXcd transform_;
  MatrixXcd transforms_;  // bins x channels
  std::vector<MatrixXcd> sum_;
};

// Segments that overlap share data: the variance of their average is that of fewer independent ones
// (Welch 1967). pairs: overlapping neighbours among the averages.
double independent_averages(const Vector& window, Index shift, Index averages, Index pairs) {
  const double correlation =
      window.head(window.size() - shift).dot(window.tail(window.size() - shift)) /
      window.squaredNorm();
  const double n = static_cast<double>(averages);
  return n * n / (n + 2.0 * correlation * correlation * static_cast<double>(pairs));
}

Index shift_of(Index segment) { return segment - segment / 2; }

void check_channels(const Spectra& spectra, const std::vector<Index>& channels, const char* name) {
  const Index count = spectra.s.empty() ? 0 : spectra.s.front().rows();
  require(!channels.empty(), name, std::string(name) + " must name at least one channel");
  for (const Index c : channels) {
    require(c >= 0 && c < count, name,
            std::string(name) + " names channel " + std::to_string(c) +
                ": there are channels 0 to " + std::to_string(count - 1));
  }
}

void check_averages(const Spectra& spectra, const std::vector<Index>& inputs) {
  if (spectra.effective_averages > static_cast<double>(inputs.size())) return;
  throw Error(Fault::kAnalysis, "segment",
              "the record gives " + std::to_string(spectra.averages) + " averages for " +
                  std::to_string(inputs.size()) +
                  " inputs, too few to tell coherence from chance: use shorter segments");
}

// Inverse of S_xx from its eigenvalues after scaling every input to unit power; false when the
// inputs are dependent to rounding (1e-12 allows for the condition number a double solve can still
// carry).
bool invert(const MatrixXcd& sxx, MatrixXcd& inverse) {
  const Vector power = sxx.diagonal().real();
  if (!(power.array() > 0.0).all()) return false;
  const Vector scale = power.array().rsqrt();
  const MatrixXcd scaled = scale.asDiagonal() * sxx * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXcd> solver(scaled);
  if (!(solver.eigenvalues()(0) > 1e-12)) return false;
  const MatrixXcd v = scale.asDiagonal() * solver.eigenvectors();
  inverse = v * solver.eigenvalues().cwiseInverse().asDiagonal() * v.adjoint();
  return true;
}

// What complex regression of the outputs on the inputs gives at one frequency.
struct Regression {
  MatrixXcd inverse;  // of S_xx
  MatrixXcd h;        // outputs x inputs
  Vector total;       // S_yy
  Vector residual;    // S_ee, the part that the inputs do not explain
};

bool regress(const MatrixXcd& s, const std::vector<Index>& inputs,
             const std::vector<Index>& outputs, Regression& r) {
  if (!invert(s(inputs, inputs), r.inverse)) return false;
  const MatrixXcd sxy = s(inputs, outputs);
  const MatrixXcd b = r.inverse * sxy;
  r.h = b.transpose();
  r.total = s(outputs, outputs).diagonal().real();
  r.residual.resize(r.total.size());
  for (Index j = 0; j < r.total.size(); ++j) {
    r.residual(j) = std::max(0.0, r.total(j) - sxy.col(j).dot(b.col(j)).real());
  }
  return true;
}

void refuse_if_never(bool determined) {
  if (determined) return;
  throw Error(Fault::kAnalysis, "inputs",
              "the inputs are constant or linearly dependent at every frequency: leave one out");
}

}  // namespace

std::vector<RowRange> used_ranges(Index rows, const std::vector<RowRange>& ranges) {
  return ranges.empty() ? std::vector<RowRange>{{0, rows}} : ranges;
}

Averaging welch_averaging(Index rows, Index segment, const std::vector<RowRange>& ranges) {
  require(segment >= 4, "segment",
          "the segment has " + std::to_string(segment) + " samples: it must have at least 4");
  Averaging result;
  Index pairs = 0;
  for (const RowRange& range : used_ranges(rows, ranges)) {
    require(range.begin >= 0 && range.begin <= range.end && range.end <= rows, "ranges",
            "a range of rows lies outside the signals");
    const Index length = range.end - range.begin;
    if (length < segment) continue;
    const Index count = (length - segment) / shift_of(segment) + 1;
    result.averages += count;
    pairs += count - 1;
  }
  if (result.averages == 0) {
    throw Error(Fault::kData, "segment",
                "no range of rows holds a whole segment of " + std::to_string(segment) +
                    " samples: use a shorter segment");
  }
  result.effective = independent_averages(hann(segment), shift_of(segment), result.averages, pairs);
  return result;
}

Spectra welch(MatrixRef signals, double rate_hz, Index segment, const std::vector<RowRange>& ranges,
              Token* token) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "the sampling rate must be positive");
  require(signals.cols() >= 1, "signals", "there must be at least one channel");
  const Averaging averaging = welch_averaging(signals.rows(), segment, ranges);
  for (const RowRange& range : used_ranges(signals.rows(), ranges)) {
    require_finite(signals.middleRows(range.begin, range.end - range.begin), "signals",
                   range.begin);
  }

  Spectra result;
  result.averages = averaging.averages;
  result.effective_averages = averaging.effective;
  Accumulator accumulator(signals, segment);
  Index done = 0;
  for (const RowRange& range : used_ranges(signals.rows(), ranges)) {
    for (Index begin = range.begin; begin + segment <= range.end; begin += shift_of(segment)) {
      step(token, static_cast<double>(done++) / static_cast<double>(result.averages));
      accumulator.add(begin);
    }
  }

  result.freq_hz = Vector::LinSpaced(segment / 2 + 1, 0.0, static_cast<double>(segment / 2)) *
                   (rate_hz / static_cast<double>(segment));
  const double density =
      1.0 / (rate_hz * accumulator.window().squaredNorm() * static_cast<double>(result.averages));
  result.s = accumulator.take();
  for (std::size_t f = 0; f < result.s.size(); ++f) {
    // One-sided: every frequency but 0 and Nyquist stands for itself and its negative.
    const bool single = f == 0 || (segment % 2 == 0 && f + 1 == result.s.size());
    result.s[f] *= single ? density : 2.0 * density;
  }
  return result;
}

Coherence multiple_coherence(const Spectra& spectra, const std::vector<Index>& inputs,
                             const std::vector<Index>& outputs) {
  check_channels(spectra, inputs, "inputs");
  check_channels(spectra, outputs, "outputs");
  check_averages(spectra, inputs);
  const Index bins = static_cast<Index>(spectra.s.size());
  const Index columns = static_cast<Index>(outputs.size());
  const double n = spectra.effective_averages;
  const double q = static_cast<double>(inputs.size());

  Coherence result{spectra.freq_hz, Matrix::Constant(bins, columns, kNaN),
                   Matrix::Constant(bins, columns, kNaN)};
  bool determined = false;
  Regression r;
  for (Index f = 0; f < bins; ++f) {
    if (!regress(spectra.s[static_cast<std::size_t>(f)], inputs, outputs, r)) continue;
    determined = true;
    for (Index j = 0; j < columns; ++j) {
      if (!(r.total(j) > 0.0)) continue;
      const double unexplained = r.residual(j) / r.total(j);
      result.raw(f, j) = 1.0 - unexplained;
      result.corrected(f, j) = std::max(0.0, 1.0 - unexplained * n / (n - q));
    }
  }
  refuse_if_never(determined);
  return result;
}

FrequencyResponse frequency_response(const Spectra& spectra, const std::vector<Index>& inputs,
                                     const std::vector<Index>& outputs, double confidence) {
  check_channels(spectra, inputs, "inputs");
  check_channels(spectra, outputs, "outputs");
  check_averages(spectra, inputs);
  require(confidence > 0.0 && confidence < 1.0, "confidence",
          "the confidence must lie between 0 and 1");
  const std::size_t bins = spectra.s.size();
  const Index rows = static_cast<Index>(outputs.size());
  const Index cols = static_cast<Index>(inputs.size());
  const double freedom = spectra.effective_averages - static_cast<double>(inputs.size());
  const double quantile = std::expm1(-std::log1p(-confidence) / freedom);

  FrequencyResponse result;
  result.freq_hz = spectra.freq_hz;
  result.confidence = confidence;
  result.h.assign(bins, MatrixXcd::Constant(rows, cols, Complex(kNaN, kNaN)));
  result.radius.assign(bins, Matrix::Constant(rows, cols, kNaN));
  bool determined = false;
  Regression r;
  for (std::size_t f = 0; f < bins; ++f) {
    if (!regress(spectra.s[f], inputs, outputs, r)) continue;
    determined = true;
    result.h[f] = r.h;
    result.radius[f] =
        (quantile * r.residual * r.inverse.diagonal().real().transpose()).cwiseMax(0.0).cwiseSqrt();
  }
  refuse_if_never(determined);
  return result;
}

}  // namespace ulna
