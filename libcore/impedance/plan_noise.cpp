#include "impedance/plan_noise.hpp"

#include <unsupported/Eigen/FFT>

#include "base/error.hpp"

namespace ulna {

using Eigen::MatrixXcd;
using Eigen::VectorXcd;

Index Transforms::length_for(Index rows) {
  Index length = 64;
  while (length < 2 * rows) length *= 2;
  return length;
}

Transforms::Transforms(const Matrix& columns, double rate_hz, Index bins) {
  const Index length = length_for(columns.rows());
  require(bins <= length / 2, "bins", "more frequencies than the signals have");
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  values_.resize(bins, columns.cols());
  Vector padded = Vector::Zero(length);
  VectorXcd transform;
  for (Index c = 0; c < columns.cols(); ++c) {
    padded.head(columns.rows()) = columns.col(c);
    fft.fwd(transform, padded);
    values_.col(c) = transform.head(bins);
  }
  weight_ = rate_hz / static_cast<double>(length);
}

Matrix Transforms::covariance(const std::function<MatrixXcd(Index)>& pick, Index m) const {
  const Index w = values_.cols();
  Matrix out = Matrix::Zero(m * w, m * w);
  MatrixXcd outer(w, w);
  for (Index k = 0; k < values_.rows(); ++k) {
    const MatrixXcd density = pick(k);
    outer.noalias() = values_.row(k).adjoint() * values_.row(k);
    const double both = weight(k);  // negative frequencies are conjugates
    for (Index i = 0; i < m; ++i) {
      for (Index j = 0; j < m; ++j) {
        out.block(i * w, j * w, w, w) += both * (outer * density(i, j)).real();
      }
    }
  }
  return 0.5 * (out + out.transpose());
}

Matrix integral(const NoiseSpectra& spectra) {
  const Index size = spectra.density.front().rows();
  Matrix out = Matrix::Zero(size, size);
  for (std::size_t k = 0; k < spectra.density.size(); ++k) {
    out += (k == 0 ? 1.0 : 2.0) * spectra.step_hz * spectra.density[k].real();
  }
  return out;
}

}  // namespace ulna
