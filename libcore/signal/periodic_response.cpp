#include "signal/periodic_response.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <unsupported/Eigen/FFT>

#include "base/error.hpp"
#include "base/words.hpp"
#include "signal/finite.hpp"

namespace ulna {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;
using Eigen::VectorXcd;

// Below this share of the strongest harmonic an input without noise is taken as silent.
constexpr double kSilent = 1e-10;
// Power of a harmonic over that of its noise, from which on it counts as excited.
constexpr double kExcited = 20.0;

}  // namespace

void check_period(Index period, Index rows) {
  require(period >= 4 && period <= rows, "period",
          "the period must have at least 4 samples and fit into the record");
}

FrequencyResponse periodic_response(MatrixRef inputs, MatrixRef outputs, double rate_hz,
                                    Index period, Index skip, const std::vector<RowRange>& ranges,
                                    double confidence, Token* token) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "rate_hz must be positive");
  require(
      inputs.rows() == outputs.rows(), "outputs",
      sentence(12, "the inputs have ", inputs.rows(), " rows and the outputs ", outputs.rows()));
  require(inputs.cols() >= 1 && outputs.cols() >= 1, "inputs",
          "there must be at least one input and one output");
  check_period(period, inputs.rows());
  require(skip >= 0, "skip", "skip must not be negative");
  require(confidence > 0.0 && confidence < 1.0, "confidence",
          "the confidence must lie between 0 and 1");
  require_finite(inputs, "inputs");
  require_finite(outputs, "outputs");
  const std::vector<RowRange> used =
      ranges.empty() ? std::vector<RowRange>{{0, inputs.rows()}} : ranges;
  const Index q = inputs.cols();
  const Index m = outputs.cols();
  const Index bins = period / 2 + 1;

  // Per range: means over periods, and sums of products of deviations from them.
  const auto harmonics = static_cast<std::size_t>(bins);
  std::vector<MatrixXcd> power(harmonics, MatrixXcd::Zero(q, q));
  std::vector<MatrixXcd> cross(harmonics, MatrixXcd::Zero(q, m));
  std::vector<MatrixXcd> noise(harmonics, MatrixXcd::Zero(q + m, q + m));
  Index freedom = 0;
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  Vector piece;
  VectorXcd transform;
  for (const RowRange& range : used) {
    require(range.begin >= 0 && range.end <= inputs.rows() && range.begin < range.end, "ranges",
            "ranges must lie within the rows");
    const Index count = (range.end - range.begin) / period - skip;
    if (count < 2) {
      throw Error(Fault::kData, "period",
                  sentence(12, "the rows from ", range.begin, " to ", range.end, " hold ",
                           std::max<Index>(0, count),
                           " periods after what is left out: at least 2 are needed"),
                  sentence(12, "row ", range.begin));
    }
    freedom += count - 1;
    std::vector<MatrixXcd> transforms(harmonics, MatrixXcd(count, q + m));
    for (Index p = 0; p < count; ++p) {
      step(token, 0.0);
      const Index first = range.begin + (skip + p) * period;
      for (Index c = 0; c < q + m; ++c) {
        piece = c < q ? inputs.col(c).segment(first, period)
                      : outputs.col(c - q).segment(first, period);
        fft.fwd(transform, piece);
        for (Index f = 0; f < bins; ++f)
          transforms[static_cast<std::size_t>(f)](p, c) = transform[f];
      }
    }
    for (std::size_t f = 0; f < harmonics; ++f) {
      const Eigen::RowVectorXcd mean = transforms[f].colwise().mean();
      const MatrixXcd deviation = transforms[f].rowwise() - mean;
      noise[f].noalias() += deviation.adjoint() * deviation;
      const double n = static_cast<double>(count);
      power[f].noalias() += n * mean.head(q).adjoint() * mean.head(q);
      cross[f].noalias() += n * mean.head(q).adjoint() * mean.tail(m);
    }
  }

  FrequencyResponse result;
  result.freq_hz = Vector::LinSpaced(bins, 0.0, static_cast<double>(bins - 1)) * rate_hz /
                   static_cast<double>(period);
  result.confidence = confidence;
  result.h.assign(harmonics, MatrixXcd::Constant(m, q, Complex(kNaN, kNaN)));
  result.radius.assign(harmonics, Matrix::Constant(m, q, kNaN));
  Vector strongest = Vector::Zero(q);
  for (std::size_t f = 1; f < harmonics; ++f) {
    strongest = strongest.cwiseMax(power[f].diagonal().real());
  }
  const double nu = static_cast<double>(freedom);
  const double quantile = std::expm1(-std::log1p(-confidence) / nu);
  bool any = false;
  for (std::size_t f = 1; f < harmonics; ++f) {
    bool excited = true;
    for (Index i = 0; i < q; ++i) {
      const double own = power[f](i, i).real();
      excited =
          excited && own > kSilent * strongest[i] && own > kExcited * noise[f](i, i).real() / nu;
    }
    if (!excited) continue;
    const Vector scale = power[f].diagonal().real().array().rsqrt();
    const Eigen::SelfAdjointEigenSolver<MatrixXcd> solver(scale.asDiagonal() * power[f] *
                                                          scale.asDiagonal());
    if (!(solver.eigenvalues()[0] > 1e-10)) continue;
    const MatrixXcd v = scale.asDiagonal() * solver.eigenvectors();
    const MatrixXcd inverse = v * solver.eigenvalues().cwiseInverse().asDiagonal() * v.adjoint();
    const MatrixXcd b = inverse * cross[f];
    any = true;
    result.h[f] = b.transpose();
    for (Index j = 0; j < m; ++j) {
      VectorXcd contrast = VectorXcd::Zero(q + m);
      contrast.head(q) = -b.col(j);
      contrast[q + j] = 1.0;
      const double left = std::max(0.0, contrast.dot(noise[f] * contrast).real());
      for (Index i = 0; i < q; ++i) {
        result.radius[f](j, i) = std::sqrt(quantile * left * inverse(i, i).real());
      }
    }
  }
  if (!any) {
    throw Error(Fault::kAnalysis, "inputs",
                "no harmonic of this period is excited above the noise: check the period, and with "
                "several inputs give a range for each of them");
  }
  return result;
}

}  // namespace ulna
