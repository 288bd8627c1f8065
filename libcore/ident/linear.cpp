#include "ident/linear.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/pool.hpp"
#include "base/random.hpp"

namespace ulna {
namespace {

// Rows worked on at a time: a block of the usual 16 columns stays in the first-level caches.
constexpr Index kBlock = 256;

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// R of the stack [r; block], in place.
void absorb(Matrix& r, Eigen::Ref<const Matrix> block, Matrix& stack) {
  const Index width = r.cols();
  stack.resize(width + block.rows(), width);
  stack.topRows(width) = r;
  stack.bottomRows(block.rows()) = block;
  const Eigen::HouseholderQR<Eigen::Ref<Matrix>> qr(stack);
  r = stack.topRows(width).triangularView<Eigen::Upper>();
}

template <class Visit>
void for_blocks(const std::vector<Span>& spans, Token* token, Visit visit) {
  const double total = static_cast<double>(std::max<Index>(1, row_count(spans)));
  Index done = 0;
  for (const Span& span : spans) {
    for (Index row = span.begin; row < span.end; row += kBlock) {
      const Index count = std::min(kBlock, span.end - row);
      visit(span, row, count);
      done += count;
      if (done % (64 * kBlock) < kBlock) step(token, static_cast<double>(done) / total);
    }
  }
}

// Instruments that hold less than this share of the largest direction are copies of each other.
constexpr double kInstrumentRank = 1e-6;

}  // namespace

Factor factorise(const Design& design, const std::vector<Span>& spans, Token* token) {
  Factor factor{design.instruments(), design.regressors(), design.axes(), row_count(spans), {}};
  const Index width = design.columns();
  factor.r = Matrix::Zero(width, width);
  Matrix block(kBlock, width);
  Matrix stack;
  for_blocks(spans, token, [&](const Span& span, Index row, Index count) {
    design.fill(span.trial, row, count, block.topRows(count));
    absorb(factor.r, block.topRows(count), stack);
  });
  return factor;
}

Factor merge(const std::vector<const Factor*>& parts) {
  Factor out = *parts.front();
  Matrix stack;
  for (std::size_t i = 1; i < parts.size(); ++i) {
    absorb(out.r, parts[i]->r, stack);
    out.rows += parts[i]->rows;
  }
  return out;
}

Factor factor_of_gram(const Matrix& gram, Index q, Index p, Index n, Index rows) {
  // Cholesky by hand, since a noise-free record makes the last pivots zero: such a row of R is
  // zero.
  const Index width = gram.cols();
  Factor factor{q, p, n, rows, Matrix::Zero(width, width)};
  Matrix& r = factor.r;
  for (Index j = 0; j < width; ++j) {
    const double pivot = gram(j, j) - r.col(j).head(j).squaredNorm();
    if (pivot <= 1e-14 * gram(j, j)) continue;
    r(j, j) = std::sqrt(pivot);
    for (Index k = j + 1; k < width; ++k) {
      r(j, k) = (gram(j, k) - r.col(j).head(j).dot(r.col(k).head(j))) / r(j, j);
    }
  }
  return factor;
}

Fit solve(const Factor& factor, const Matrix& transform, Estimator estimator) {
  const Index p = factor.p;
  const Index n = factor.n;
  const Index k = transform.cols();
  const bool instrumental = estimator == Estimator::kInstrumental;
  // Least squares sees every row of the factor; the instrumental estimator what the instruments
  // span.
  Matrix span;    // orthonormal, in the coordinates of the instruments' own factor
  Matrix invert;  // instruments times this are that basis
  if (instrumental) {
    const Matrix z = factor.r.topLeftCorner(factor.q, factor.q).triangularView<Eigen::Upper>();
    const Vector norms = z.colwise().norm().transpose().cwiseMax(1e-300);
    const Eigen::JacobiSVD<Matrix> svd(z * norms.cwiseInverse().asDiagonal(),
                                       Eigen::ComputeThinU | Eigen::ComputeThinV);
    Index rank = 0;
    while (rank < factor.q &&
           svd.singularValues()[rank] > kInstrumentRank * svd.singularValues()[0]) {
      ++rank;
    }
    span = svd.matrixU().leftCols(rank);
    invert = norms.cwiseInverse().asDiagonal() * svd.matrixV().leftCols(rank) *
             svd.singularValues().head(rank).cwiseInverse().asDiagonal();
  }
  const auto project = [&](Index first, Index width) -> Matrix {
    if (!instrumental) return factor.r.block(0, first, factor.q + p, width);
    return span.transpose() * factor.r.block(0, first, factor.q, width);
  };
  const Matrix a = project(factor.q, p);
  const Matrix y = project(factor.q + p, n);
  const Index seen = a.rows();

  // One stacked problem over all outputs: (I (x) a) T eta = vec(y).
  // Fewer equations than unknowns leave rows of zeros, and with them a condition without end.
  Matrix stacked = Matrix::Zero(std::max(seen * n, k), k);
  Vector right = Vector::Zero(stacked.rows());
  for (Index i = 0; i < n; ++i) {
    stacked.middleRows(i * seen, seen).noalias() = a * transform.middleRows(i * p, p);
    right.segment(i * seen, seen) = y.col(i);
  }
  Vector norms = stacked.colwise().norm().transpose();
  const bool empty_column = (norms.array() <= 0.0).any() || !norms.allFinite();
  norms = (norms.array() > 0.0).select(norms, 1.0);
  const Matrix unit = stacked * norms.cwiseInverse().asDiagonal();

  Fit fit;
  fit.estimator = estimator;
  fit.transform = transform;
  const Eigen::JacobiSVD<Matrix> svd(unit, Eigen::ComputeThinV);
  const Vector& s = svd.singularValues();
  fit.condition = s[k - 1] > 1e-14 * s[0] && !empty_column ? s[0] / s[k - 1] : kInfinity;
  fit.weakest = svd.matrixV().col(k - 1);
  const Vector eta = norms.cwiseInverse().cwiseProduct(unit.householderQr().solve(right));
  fit.theta = (transform * eta).reshaped(p, n);
  fit.information = stacked.transpose() * stacked;
  if (instrumental) fit.weights = invert * a;
  return fit;
}

namespace {

// Gram matrix of the moving sums over `window` rows of a sequence, zero beyond its ends.
class MovingGram {
 public:
  MovingGram(Index width, Index window)
      : window_(window),
        gram_(Matrix::Zero(width, width)),
        moving_(kBlock, width),
        ring_(RowMajor::Zero(window, width)),
        running_(Eigen::RowVectorXd::Zero(width)) {}

  void push(const Eigen::RowVectorXd& row) {
    leave();
    running_ += row;
    ring_.row(filled_ % window_) = row;
    keep();
  }

  // The sequence ends: the sums run out over its last rows.
  void finish_run() {
    for (Index i = 1; filled_ > 0 && i < window_; ++i) {
      leave();
      ring_.row(filled_ % window_).setZero();
      keep();
    }
    filled_ = 0;
    running_.setZero();
    ring_.setZero();
  }

  Matrix gram() {
    flush();
    return gram_.selfadjointView<Eigen::Lower>();
  }

 private:
  void leave() {
    if (filled_ >= window_) running_ -= ring_.row(filled_ % window_);
  }
  void keep() {
    ++filled_;
    moving_.row(buffered_++) = running_;
    if (buffered_ == kBlock) flush();
  }
  void flush() {
    gram_.selfadjointView<Eigen::Lower>().rankUpdate(moving_.topRows(buffered_).transpose());
    buffered_ = 0;
  }

  Index window_;
  Matrix gram_;
  RowMajor moving_;
  RowMajor ring_;
  Eigen::RowVectorXd running_;
  Index filled_ = 0;
  Index buffered_ = 0;
};

// Gram matrix of the moving sums of the scores of spans that belong to one trial.
Matrix score_gram(const Design& design, const std::vector<Span>& spans,
                  const std::vector<const Fit*>& fits, Index window, Index stride, Token* token) {
  const Index p = design.regressors();
  const Index n = design.axes();
  const Index q = design.instruments();
  const Index each = p * n;
  const Index width = each * static_cast<Index>(fits.size());
  MovingGram sums(width, window);
  const Index rows_at_once = kBlock / stride * stride;
  Matrix block(kBlock, design.columns());
  std::vector<Matrix> regressors(fits.size(), Matrix(kBlock, p));
  std::vector<Matrix> errors(fits.size(), Matrix(kBlock, n));
  Eigen::RowVectorXd score(width);
  const double total = static_cast<double>(std::max<Index>(1, row_count(spans)));
  Index done = 0;
  const Span* previous = nullptr;
  for (const Span& span : spans) {
    if (previous != nullptr && previous->end != span.begin) {
      sums.finish_run();
    }
    previous = &span;
    for (Index row = span.begin; row < span.end; row += rows_at_once) {
      const Index count = std::min(rows_at_once, span.end - row);
      design.fill(span.trial, row, count, block.topRows(count));
      const auto z = block.topRows(count).leftCols(q);
      const auto phi = block.topRows(count).middleCols(q, p);
      const auto y = block.topRows(count).rightCols(n);
      for (std::size_t f = 0; f < fits.size(); ++f) {
        errors[f].topRows(count).noalias() = y - phi * fits[f]->theta;
        if (fits[f]->estimator == Estimator::kInstrumental) {
          regressors[f].topRows(count).noalias() = z * fits[f]->weights;
        } else {
          regressors[f].topRows(count) = phi;
        }
      }
      for (Index bin = 0; bin < count; bin += stride) {
        const Index size = std::min(stride, count - bin);
        for (std::size_t f = 0; f < fits.size(); ++f) {
          for (Index i = 0; i < n; ++i) {
            score.segment(static_cast<Index>(f) * each + i * p, p).noalias() =
                errors[f].col(i).segment(bin, size).transpose() *
                regressors[f].middleRows(bin, size);
          }
        }
        sums.push(score);
      }
      done += count;
      step(token, static_cast<double>(done) / total);
    }
  }
  sums.finish_run();
  return sums.gram();
}

}  // namespace

Matrix newey_west(const Design& design, const std::vector<Span>& spans,
                  const std::vector<const Fit*>& fits, Index lag, Index stride, Token* token,
                  int threads) {
  const Index each = design.regressors() * design.axes();
  const Index width = each * static_cast<Index>(fits.size());
  // A lag beyond the data says the same as one that covers all of them.
  lag = std::clamp<Index>(lag, 0, std::max<Index>(1, row_count(spans)));
  stride = std::clamp<Index>(stride, 1, std::min(kBlock, lag + 1));

  // Bartlett weights are the autocorrelation of a box: the weighted sum over all lags equals the
  // Gram matrix of the scores' moving sums over lag + 1 rows, over lag + 1. That costs rows x
  // width^2 instead of rows x lag x width^2. With a stride, scores are summed over so many rows
  // first.
  const Index window = std::max<Index>(1, (lag + 1 + stride / 2) / stride);
  std::vector<std::vector<Span>> trials;
  for (const Span& span : spans) {
    if (trials.empty() || trials.back().back().trial != span.trial) trials.emplace_back();
    trials.back().push_back(span);
  }
  std::vector<Matrix> grams(std::min<std::size_t>(trials.size(), 64));  // a few at a time
  Matrix meat = Matrix::Zero(width, width);
  for (std::size_t first = 0; first < trials.size(); first += grams.size()) {
    const std::size_t count = std::min(grams.size(), trials.size() - first);
    parallel_for(static_cast<std::ptrdiff_t>(count), threads, [&](std::ptrdiff_t i) {
      const auto t = static_cast<std::size_t>(i);
      grams[t] = score_gram(design, trials[first + t], fits, window, stride, token);
    });
    for (std::size_t t = 0; t < count; ++t) meat += grams[t] / static_cast<double>(window);
  }

  // Parameters move by T information^-1 T' times the scores.
  Matrix bread = Matrix::Zero(width, width);
  for (std::size_t f = 0; f < fits.size(); ++f) {
    const Fit& fit = *fits[f];
    const Index at = static_cast<Index>(f) * each;
    bread.block(at, at, each, each) =
        fit.transform * fit.information.ldlt().solve(fit.transform.transpose());
  }
  const Matrix covariance = bread * meat * bread.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

Matrix block_bootstrap(const Design& design, const std::vector<Span>& blocks,
                       const Matrix& transform, Estimator estimator, Index count,
                       std::uint64_t seed, int threads, Token* token) {
  const Index width = design.columns();
  std::vector<Matrix> grams(blocks.size());
  parallel_for(static_cast<std::ptrdiff_t>(blocks.size()), threads, [&](std::ptrdiff_t b) {
    const auto i = static_cast<std::size_t>(b);
    Matrix rows(blocks[i].end - blocks[i].begin, width);
    design.fill(blocks[i].trial, blocks[i].begin, rows.rows(), rows);
    grams[i] = Matrix::Zero(width, width);
    grams[i].selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
    grams[i] = Matrix(grams[i].selfadjointView<Eigen::Lower>());
  });
  Matrix out(count, transform.rows());
  parallel_for(
      count, threads,
      [&](std::ptrdiff_t i) {
        Random random(seed, static_cast<std::uint64_t>(i));
        Matrix gram = Matrix::Zero(width, width);
        Index rows = 0;
        for (std::size_t b = 0; b < blocks.size(); ++b) {
          const auto drawn =
              static_cast<std::size_t>(random.below(static_cast<std::int64_t>(blocks.size())));
          gram += grams[drawn];
          rows += blocks[drawn].end - blocks[drawn].begin;
        }
        const Factor factor =
            factor_of_gram(gram, design.instruments(), design.regressors(), design.axes(), rows);
        out.row(i) = solve(factor, transform, estimator).theta.reshaped().transpose();
      },
      token);
  return out;
}

}  // namespace ulna
