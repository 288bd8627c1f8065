#include "signal/closed_loop_response.hpp"

#include <Eigen/LU>
#include <cmath>

#include "base/error.hpp"
#include "base/words.hpp"

namespace ulna {
namespace {

using Complex = std::complex<double>;
using Eigen::MatrixXcd;

}  // namespace

FrequencyResponse closed_loop_response(const Spectra& spectra, const std::vector<Index>& references,
                                       const std::vector<Index>& inputs,
                                       const std::vector<Index>& outputs, double confidence) {
  require(references.size() == inputs.size(), "references",
          sentence(6, "there are ", references.size(), " references for ", inputs.size(),
                   " inputs: give one for each"));
  require(confidence > 0.0 && confidence < 1.0, "confidence",
          "the confidence must lie between 0 and 1");
  // Refuses channels that are not there, too few averages, and references without power.
  std::vector<Index> driven = inputs;
  driven.insert(driven.end(), outputs.begin(), outputs.end());
  const Coherence coherence = [&] {
    try {
      return multiple_coherence(spectra, references, driven);
    } catch (const Error& error) {
      if (error.argument() != "inputs") throw;
      throw Error(error.fault(), "references",
                  "the references are constant or linearly dependent at every frequency: record "
                  "what drives the loop");
    }
  }();

  const Index q = static_cast<Index>(inputs.size());
  const Index rows = static_cast<Index>(outputs.size());
  const double freedom = spectra.effective_averages - static_cast<double>(q);
  const double quantile = std::expm1(-std::log1p(-confidence) / freedom);
  FrequencyResponse result;
  result.freq_hz = spectra.freq_hz;
  result.confidence = confidence;
  result.h.assign(spectra.s.size(), MatrixXcd::Constant(rows, q, Complex(kNaN, kNaN)));
  result.radius.assign(spectra.s.size(), Matrix::Constant(rows, q, kNaN));
  for (std::size_t f = 0; f < spectra.s.size(); ++f) {
    const auto bin = static_cast<Index>(f);
    if (std::isnan(coherence.raw(bin, 0))) continue;
    const MatrixXcd& s = spectra.s[f];
    // In units of each channel's own power, so that the condition does not depend on units.
    const Vector of_reference = s(references, references).diagonal().real().cwiseSqrt();
    const Vector of_input = s(inputs, inputs).diagonal().real().cwiseSqrt();
    if (!(of_reference.minCoeff() > 0.0 && of_input.minCoeff() > 0.0)) continue;
    const MatrixXcd scaled = of_reference.cwiseInverse().asDiagonal() * s(references, inputs) *
                             of_input.cwiseInverse().asDiagonal();
    const Eigen::FullPivLU<MatrixXcd> lu(scaled);
    if (!(lu.rcond() > 1e-14)) continue;
    const MatrixXcd inverse = of_input.cwiseInverse().asDiagonal() * lu.inverse() *
                              of_reference.cwiseInverse().asDiagonal();
    const MatrixXcd b = inverse * s(references, outputs);
    const MatrixXcd spread = inverse * s(references, references) * inverse.adjoint();
    const MatrixXcd suu = s(inputs, inputs);
    const MatrixXcd suy = s(inputs, outputs);
    result.h[f] = b.transpose();
    for (Index j = 0; j < rows; ++j) {
      const Index y = outputs[static_cast<std::size_t>(j)];
      const double left = s(y, y).real() - 2.0 * b.col(j).dot(suy.col(j)).real() +
                          b.col(j).dot(suu * b.col(j)).real();
      for (Index i = 0; i < q; ++i) {
        const double share = coherence.raw(bin, i);
        const bool told = share > quantile * (1.0 - share);
        result.radius[f](j, i) =
            told ? std::sqrt(quantile * std::max(0.0, left) * spread(i, i).real()) : kInfinity;
      }
    }
  }
  return result;
}

}  // namespace ulna
