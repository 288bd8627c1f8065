#include "impedance/torque_noise.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "impedance/state_functions.hpp"

namespace ulna {
namespace {

// From rich to poor: the first for which the record has rows enough.
constexpr StateDegrees kDegrees[] = {{10, 5}, {8, 4}, {6, 3}, {4, 2}, {2, 1}, {1, 1}};
constexpr Index kRowsEach = 3;       // per function
constexpr Index kRowsMore = 20;      // and beside: left for the noise
constexpr double kDependent = 1e-6;  // of the largest column
constexpr double kSlowest = 0.8;     // corner of the noise, in widths of what was taken off
constexpr int kCorners = 9, kRatios = 13;
constexpr double kLeastRatio = 0.5;  // of the low-pass over the white part
constexpr double kMostRatio = 2e3;
constexpr double kExtra = 2.0;  // log-likelihood that a low-pass part must bring: Akaike's
constexpr double kLeastDof = 3.0;

// Rows of a record as means of blocks, each trial's as coefficients of its cosines: stationary
// noise has coefficients that are nearly independent, with variances S(f).
class BlockCosines {
 public:
  BlockCosines(const Record& record, Index block) : block_(block) {
    for (const Trial& trial : record.trials()) {
      const Index count = (trial.end - trial.begin) / block;
      if (count == 0) continue;
      pieces_.push_back({trial.begin, count, rows_});
      rows_ += count;
    }
    frequency_.resize(rows_);
    for (const Piece& p : pieces_) {
      const double step =
          record.rate_hz() / (2.0 * static_cast<double>(p.count) * static_cast<double>(block));
      for (Index k = 0; k < p.count; ++k) frequency_[p.to + k] = static_cast<double>(k) * step;
    }
  }

  Index rows() const { return rows_; }
  const Vector& frequency() const { return frequency_; }  // Hz

  Matrix means(const Matrix& values) const {
    Matrix out(rows_, values.cols());
    for (const Piece& p : pieces_) {
      for (Index i = 0; i < p.count; ++i) {
        out.row(p.to + i) = values.middleRows(p.from + i * block_, block_).colwise().mean();
      }
    }
    return out;
  }

  Matrix cosines(const Matrix& means) const {
    Matrix out(rows_, means.cols());
    for (const Piece& p : pieces_) {
      out.middleRows(p.to, p.count) = basis(p.count) * means.middleRows(p.to, p.count);
    }
    return out;
  }

 private:
  struct Piece {
    Index from, count, to;
  };

  // Orthonormal: row k is cos(pi k (2 i + 1) / (2 n)) over i.
  static Matrix basis(Index n) {
    Vector cosine(4 * n);
    for (Index i = 0; i < 4 * n; ++i) {
      cosine[i] = std::cos(kPi * static_cast<double>(i) / (2.0 * static_cast<double>(n)));
    }
    Matrix rows(n, n);
    const double scale = std::sqrt(2.0 / static_cast<double>(n));
    for (Index i = 0; i < n; ++i) {
      for (Index k = 0; k < n; ++k) rows(k, i) = scale * cosine[(k * (2 * i + 1)) % (4 * n)];
    }
    rows.row(0) *= std::sqrt(0.5);
    return rows;
  }

  Index block_, rows_ = 0;
  std::vector<Piece> pieces_;
  Vector frequency_;
};

StateDegrees degrees_for(Index rows) {
  for (const StateDegrees& d : kDegrees) {
    if (kRowsEach * state_function_count(d) + kRowsMore <= rows) return d;
  }
  return kDegrees[std::size(kDegrees) - 1];
}

// Shapes of spectra, a column each, white noise first.
Matrix spectrum_shapes(const Vector& frequency, double slowest) {
  const double fastest = std::max(frequency.maxCoeff(), slowest);
  Matrix shapes(frequency.size(), 1 + kCorners * kRatios);
  shapes.col(0).setOnes();
  Index c = 1;
  for (int i = 0; i < kCorners; ++i) {
    const double corner = slowest * std::pow(fastest / slowest, i / (kCorners - 1.0));
    const Vector low_pass = (1.0 + (frequency.array() / corner).pow(4)).inverse();
    for (int j = 0; j < kRatios; ++j) {
      const double ratio = kLeastRatio * std::pow(kMostRatio / kLeastRatio, j / (kRatios - 1.0));
      shapes.col(c++) = 1.0 + ratio * low_pass.array();
    }
  }
  return shapes;
}

struct FittedSpectrum {
  Vector power;  // at each coefficient
  double dof = 0.0;
};

// `residual`: coefficients from which the orthonormal columns of `space` were taken.
FittedSpectrum fit_spectrum(const Matrix& shapes, const Matrix& space, const Vector& residual) {
  const Matrix kept = Matrix::Identity(space.rows(), space.rows()) - space * space.transpose();
  const Vector share = kept.diagonal().cwiseMax(0.0);  // of each coefficient
  const Matrix expected = (kept.cwiseAbs2() * shapes).cwiseMax(1e-300);
  const double dof = share.sum();
  FittedSpectrum best;
  double least = kInfinity;
  for (Index m = 0; m < shapes.cols(); ++m) {
    const Vector ratio = residual.cwiseAbs2().cwiseQuotient(expected.col(m));
    const double scale = std::max(share.dot(ratio) / dof, 1e-300);
    const double badness = share.dot(expected.col(m).array().log().matrix()) +
                           dof * std::log(scale) + (m == 0 ? 0.0 : 2.0 * kExtra);
    if (badness >= least) continue;
    least = badness;
    best.power = scale * shapes.col(m);
    // What is known of the low end is known from coefficients of about its power.
    best.dof = std::max(kLeastDof, share.dot(shapes.col(m)) / shapes(0, m));
  }
  return best;
}

}  // namespace

TorqueNoise torque_noise(const Record& record, const Matrix& weights, const VectorRef& angle,
                         const VectorRef& rate, const VectorRef& torque) {
  const auto rows = static_cast<double>(torque.size());
  Matrix functions = state_functions(angle, rate, degrees_for(torque.size()));
  functions.array().rowwise() /= functions.colwise().norm().array().max(1e-300);
  // As many blocks as there must be, few enough to be quick.
  const Index wanted = kRowsEach * functions.cols() + kRowsMore;
  const Index block = std::max<Index>(1, torque.size() / wanted);
  const BlockCosines blocks(record, block);

  const Matrix means = blocks.means(functions);
  const Vector mean_torque = blocks.means(torque);
  Eigen::ColPivHouseholderQR<Matrix> qr(means);
  qr.setThreshold(kDependent);
  const Matrix space =
      blocks.cosines(qr.householderQ() * Matrix::Identity(means.rows(), qr.rank()));
  const Vector coefficients = blocks.cosines(mean_torque);
  const Vector residual = coefficients - space * (space.transpose() * coefficients);

  const double slowest =
      kSlowest * static_cast<double>(qr.rank()) * record.rate_hz() / (2.0 * rows);
  const FittedSpectrum noise =
      fit_spectrum(spectrum_shapes(blocks.frequency(), slowest), space, residual);
  const Matrix weight = static_cast<double>(block) * blocks.cosines(blocks.means(weights));
  TorqueNoise found;
  found.error = (weight.cwiseAbs2().transpose() * noise.power).cwiseSqrt();
  found.dof = noise.dof;
  const Vector left = torque - functions * qr.solve(mean_torque);
  found.rms = std::sqrt(left.squaredNorm() / rows);
  return found;
}

}  // namespace ulna
