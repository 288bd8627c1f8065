#include "signal/local_polynomial.hpp"

#include <Eigen/QR>
#include <algorithm>
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

constexpr Index kFreedom = 10;

// The longest length within all ranges that a fast Fourier transform likes.
Index common_length(const std::vector<RowRange>& ranges, Index rows) {
  Index shortest = rows;
  Index last_end = 0;
  for (const RowRange& r : ranges) {
    require(r.begin >= last_end && r.end <= rows && r.begin < r.end, "ranges",
            "ranges must be in order, not overlap, and lie within the rows");
    last_end = r.end;
    shortest = std::min(shortest, r.end - r.begin);
  }
  for (Index length = shortest; length > 1; --length) {
    Index rest = length;
    for (const Index factor : {2, 3, 5}) {
      while (rest % factor == 0) rest /= factor;
    }
    if (rest == 1) return length;
  }
  return shortest;
}

}  // namespace

Vector local_frequencies(Index rows, Index inputs, double rate_hz,
                         const std::vector<RowRange>& ranges, LocalPolynomial& options) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "rate_hz must be positive");
  require(options.order >= 0 && options.order <= 6, "order", "order must be from 0 to 6");
  require(options.half_width >= 0 && options.stride >= 0, "half_width",
          "half_width and stride must not be negative");
  const std::vector<RowRange> used = used_ranges(rows, ranges);
  const auto runs = static_cast<Index>(used.size());
  const Index length = common_length(used, rows);
  const Index unknowns = (options.order + 1) * (inputs + runs);
  const auto freedom = [&](Index w) { return runs * (2 * w + 1) - unknowns; };
  if (options.half_width == 0) {
    while (freedom(options.half_width) < kFreedom) ++options.half_width;
  }
  require(freedom(options.half_width) >= 1, "half_width",
          sentence(6, "half_width ", options.half_width, " leaves no degree of freedom for ",
                   unknowns, " coefficients: use a wider one"));
  if (options.stride == 0) options.stride = options.half_width;
  const Index last = (length - 1) / 2;  // neither 0 nor the Nyquist frequency
  const Index first = 1 + options.half_width;
  if (last - options.half_width < first) {
    throw Error(Fault::kData, "inputs",
                sentence(12, "a length of ", length, " rows is too short for windows of ",
                         2 * options.half_width + 1, " bins"));
  }
  const Index count = (last - options.half_width - first) / options.stride + 1;
  Vector out(count);
  for (Index k = 0; k < count; ++k) {
    out[k] =
        static_cast<double>(first + k * options.stride) * rate_hz / static_cast<double>(length);
  }
  return out;
}

LocalResponse local_response(MatrixRef inputs, MatrixRef outputs, double rate_hz,
                             const std::vector<RowRange>& ranges, LocalPolynomial options,
                             double confidence, Token* token) {
  require(
      inputs.rows() == outputs.rows(), "outputs",
      sentence(12, "the inputs have ", inputs.rows(), " rows and the outputs ", outputs.rows()));
  require(inputs.cols() >= 1 && outputs.cols() >= 1, "inputs",
          "there must be at least one input and one output");
  require(confidence > 0.0 && confidence < 1.0, "confidence",
          "the confidence must lie between 0 and 1");
  require_finite(inputs, "inputs");
  require_finite(outputs, "outputs");
  const Index q = inputs.cols();
  const Index m = outputs.cols();
  LocalResponse out;
  out.response.freq_hz = local_frequencies(inputs.rows(), q, rate_hz, ranges, options);
  const std::vector<RowRange> used = used_ranges(inputs.rows(), ranges);
  const Index length = common_length(used, inputs.rows());
  const auto runs = static_cast<Index>(used.size());

  std::vector<MatrixXcd> transforms;  // one a run: bins x (inputs, outputs)
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  for (const RowRange& range : used) {
    MatrixXcd all(length / 2 + 1, q + m);
    for (Index c = 0; c < q + m; ++c) {
      step(token, 0.0);
      const Vector piece = c < q ? inputs.col(c).segment(range.begin, length)
                                 : outputs.col(c - q).segment(range.begin, length);
      VectorXcd transform;
      fft.fwd(transform, piece);
      all.col(c) = transform.head(length / 2 + 1);
    }
    transforms.push_back(std::move(all));
  }

  const Index bins = out.response.freq_hz.size();
  out.response.confidence = confidence;
  out.response.h.assign(static_cast<std::size_t>(bins),
                        MatrixXcd::Constant(m, q, Complex(kNaN, kNaN)));
  out.response.radius.assign(static_cast<std::size_t>(bins), Matrix::Constant(m, q, kNaN));
  out.coherence.freq_hz = out.response.freq_hz;
  out.coherence.raw = Matrix::Constant(bins, m, kNaN);
  out.coherence.corrected = out.coherence.raw;

  const Index terms = options.order + 1;
  const Index w = options.half_width;
  const Index width = 2 * w + 1;
  const Index unknowns = terms * (q + runs);
  const double freedom = static_cast<double>(runs * width - unknowns);
  const double idle = static_cast<double>(runs * (width - terms));
  const double quantile = freedom * std::expm1(-std::log1p(-confidence) / freedom);
  MatrixXcd regressors(runs * width, unknowns);
  MatrixXcd right(runs * width, m);
  bool any = false;
  for (Index k = 0; k < bins; ++k) {
    step(token, static_cast<double>(k) / static_cast<double>(bins));
    const Index centre = 1 + w + k * options.stride;
    regressors.setZero();
    for (Index run = 0; run < runs; ++run) {
      const MatrixXcd& z = transforms[static_cast<std::size_t>(run)];
      for (Index r = -w; r <= w; ++r) {
        const Index row = run * width + r + w;
        const auto bin = z.row(centre + r);
        double weight = 1.0;
        for (Index t = 0; t < terms; ++t) {
          regressors.row(row).segment(runs * terms + t * q, q) = weight * bin.head(q);
          regressors(row, run * terms + t) = weight;
          weight *= static_cast<double>(r) / static_cast<double>(w);
        }
        right.row(row) = bin.tail(m);
      }
    }
    // The transient's columns come first, so what only they explain is the head of Q'Y.
    const Vector size = regressors.colwise().norm();
    if (!(size.minCoeff() > 0.0)) continue;
    const MatrixXcd scaled = regressors * size.cwiseInverse().asDiagonal();
    const Eigen::HouseholderQR<MatrixXcd> qr(scaled);
    const MatrixXcd r = qr.matrixQR().topRows(unknowns).triangularView<Eigen::Upper>();
    if (!(r.diagonal().cwiseAbs().minCoeff() > 1e-10)) continue;
    any = true;
    const MatrixXcd rotated = qr.householderQ().adjoint() * right;
    const MatrixXcd inverse =
        r.triangularView<Eigen::Upper>().solve(MatrixXcd::Identity(unknowns, unknowns));
    const MatrixXcd found = inverse * rotated.topRows(unknowns);
    for (Index j = 0; j < m; ++j) {
      const double left = rotated.col(j).tail(runs * width - unknowns).squaredNorm();
      const double whole = rotated.col(j).tail(runs * width - runs * terms).squaredNorm();
      if (whole > 0.0) {
        out.coherence.raw(k, j) = 1.0 - left / whole;
        out.coherence.corrected(k, j) = std::max(0.0, 1.0 - (left / freedom) / (whole / idle));
      }
      for (Index i = 0; i < q; ++i) {
        const Index place = runs * terms + i;
        const double spread = inverse.row(place).squaredNorm() / (size[place] * size[place]);
        const auto bin = static_cast<std::size_t>(k);
        out.response.h[bin](j, i) = found(place, j) / size[place];
        out.response.radius[bin](j, i) = std::sqrt(quantile * left / freedom * spread);
      }
    }
  }
  if (!any) {
    throw Error(Fault::kAnalysis, "inputs",
                "the inputs are constant or linearly dependent at every frequency: leave one out");
  }
  return out;
}

}  // namespace ulna
