#include "signal/savgol.hpp"

#include <cmath>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "signal/finite.hpp"
#include "signal/lanes.hpp"

namespace ulna {
namespace {

using lanes::kLanes;
using Long = long double;

// Far beyond use; they bound the memory of a mistyped specification.
constexpr int kMaxWindow = 100001;
constexpr int kMaxOrder = 30;
constexpr int kMaxDerivative = 6;

// Polynomials orthonormal on the window's points t_k = (k - half) / half, with their derivatives
// there (in units of 1 / t): basis[j].value[d * window + k]. Built from t times the previous one
// and orthogonalised twice, in extended precision: the normal equations of monomials lose every
// digit at the orders and windows in use.
struct Basis {
  int window;
  int derivatives;
  std::vector<std::vector<Long>> polynomial;

  Long at(int j, int d, int k) const {
    return polynomial[static_cast<std::size_t>(j)][static_cast<std::size_t>(d * window + k)];
  }
};

Long dot(const std::vector<Long>& a, const std::vector<Long>& b, int window) {
  Long sum = 0;
  for (int k = 0; k < window; ++k) {
    sum += a[static_cast<std::size_t>(k)] * b[static_cast<std::size_t>(k)];
  }
  return sum;
}

Basis make_basis(const SavgolSpec& spec, int max_derivative) {
  const int window = spec.window;
  const int half = (window - 1) / 2;
  Basis basis{window, max_derivative, {}};
  const std::size_t size =
      static_cast<std::size_t>(window) * static_cast<std::size_t>(max_derivative + 1);
  for (int j = 0; j <= spec.order; ++j) {
    std::vector<Long> p(size, 0);
    for (int k = 0; k < window; ++k) {
      const Long t = half == 0 ? 0 : static_cast<Long>(k - half) / static_cast<Long>(half);
      if (j == 0) {
        p[static_cast<std::size_t>(k)] = 1;
        continue;
      }
      // (t q)^(d) = t q^(d) + d q^(d-1)
      for (int d = 0; d <= max_derivative; ++d) {
        Long x = t * basis.at(j - 1, d, k);
        if (d > 0) x += static_cast<Long>(d) * basis.at(j - 1, d - 1, k);
        p[static_cast<std::size_t>(d * window + k)] = x;
      }
    }
    for (int pass = 0; pass < 2; ++pass) {
      // Only polynomials of the same parity: the others are orthogonal by symmetry.
      for (int i = j - 2; i >= 0; i -= 2) {
        const auto& q = basis.polynomial[static_cast<std::size_t>(i)];
        const Long share = dot(p, q, window);
        for (std::size_t m = 0; m < size; ++m) p[m] -= share * q[m];
      }
    }
    const Long norm = std::sqrt(dot(p, p, window));
    for (Long& x : p) x /= norm;
    basis.polynomial.push_back(std::move(p));
  }
  return basis;
}

// One over (the time of half a window)^d: derivatives by t become derivatives by seconds.
Long derivative_scale(const SavgolSpec& spec, int d, double rate_hz) {
  const int half = (spec.window - 1) / 2;
  return half == 0
             ? 1
             : std::pow(static_cast<Long>(rate_hz) / static_cast<Long>(half), static_cast<Long>(d));
}

Matrix kernels_from(const Basis& basis, const SavgolSpec& spec, int max_derivative,
                    double rate_hz) {
  const int window = spec.window;
  const int half = (window - 1) / 2;
  Matrix kernels = Matrix::Zero(window, max_derivative + 1);
  for (int d = 0; d <= std::min(max_derivative, spec.order); ++d) {
    const Long scale = derivative_scale(spec, d, rate_hz);
    const int parity = d % 2;
    for (int k = 0; k <= half; ++k) {
      Long sum = 0;
      for (int j = parity; j <= spec.order; j += 2) sum += basis.at(j, 0, k) * basis.at(j, d, half);
      const double weight = static_cast<double>(sum * scale);
      kernels(k, d) = weight;
      kernels(window - 1 - k, d) = parity == 0 ? weight : -weight;
    }
    if (parity == 1) kernels(half, d) = 0.0;
  }
  return kernels;
}

// y points at the first of `count` >= kLanes centres, w at the weights of k = 0 ... half. The last
// block is moved back to end with the last centre: an output computed twice gets the same bits.
struct Three {
  const double* y;
  Index count;
  Index half;
  const double *w0, *w1, *w2;
  double *out0, *out1, *out2;
};

// The sums y[i+k] + y[i-k] serve the value and the second derivative, the differences the first;
// the accumulators of eight outputs stay in registers.
template <class R>
ULNA_INLINE void three_body(const Three& a) {
  using V = typename R::V;
  constexpr int kWidth = R::kWidth;
  constexpr int kParts = static_cast<int>(kLanes) / kWidth;
  for (Index i = 0; i < a.count; i += kLanes) {
    const Index at = i + kLanes <= a.count ? i : a.count - kLanes;
    const double* y = a.y + at;
    V v0[kParts], v1[kParts], v2[kParts];
    for (int p = 0; p < kParts; ++p) {
      const V centre = lanes::load<R>(y + p * kWidth);
      v0[p] = centre * a.w0[0];
      v1[p] = centre * a.w1[0];
      v2[p] = centre * a.w2[0];
    }
    for (Index k = 1; k <= a.half; ++k) {
      for (int p = 0; p < kParts; ++p) {
        const V right = lanes::load<R>(y + k + p * kWidth);
        const V left = lanes::load<R>(y - k + p * kWidth);
        const V sum = right + left;
        const V difference = right - left;
        v0[p] += sum * a.w0[k];
        v1[p] += difference * a.w1[k];
        v2[p] += sum * a.w2[k];
      }
    }
    for (int p = 0; p < kParts; ++p) {
      lanes::store<R>(a.out0 + at + p * kWidth) = v0[p];
      lanes::store<R>(a.out1 + at + p * kWidth) = v1[p];
      lanes::store<R>(a.out2 + at + p * kWidth) = v2[p];
    }
  }
}

struct One {
  const double* y;
  Index count;
  Index half;
  const double* w;
  double* out;
  double sign;  // +1 for an even kernel, -1 for an odd one
};

template <class R>
ULNA_INLINE void one_body(const One& a) {
  using V = typename R::V;
  constexpr int kWidth = R::kWidth;
  constexpr int kParts = static_cast<int>(kLanes) / kWidth;
  for (Index i = 0; i < a.count; i += kLanes) {
    const Index at = i + kLanes <= a.count ? i : a.count - kLanes;
    const double* y = a.y + at;
    V v[kParts];
    for (int p = 0; p < kParts; ++p) v[p] = lanes::load<R>(y + p * kWidth) * a.w[0];
    for (Index k = 1; k <= a.half; ++k) {
      for (int p = 0; p < kParts; ++p) {
        // The product with +1 or -1 is exact: the same bits as the shared sums and differences.
        v[p] += (lanes::load<R>(y + k + p * kWidth) + lanes::load<R>(y - k + p * kWidth) * a.sign) *
                a.w[k];
      }
    }
    for (int p = 0; p < kParts; ++p) lanes::store<R>(a.out + at + p * kWidth) = v[p];
  }
}

void three_base(const Three& a) { three_body<lanes::Base>(a); }
void one_base(const One& a) { one_body<lanes::Base>(a); }
#ifdef ULNA_AVX2
ULNA_AVX2 void three_avx2(const Three& a) { three_body<lanes::Avx2>(a); }
ULNA_AVX2 void one_avx2(const One& a) { one_body<lanes::Avx2>(a); }
#endif

void run_three(const Three& a) {
#ifdef ULNA_AVX2
  if (lanes::have_avx2()) return three_avx2(a);
#endif
  three_base(a);
}

void run_one(const One& a) {
#ifdef ULNA_AVX2
  if (lanes::have_avx2()) return one_avx2(a);
#endif
  one_base(a);
}

void run_centres(const double* y, Index count, const Matrix& weights, Index half,
                 Eigen::Ref<Matrix> out) {
  const Index outputs = weights.cols();
  Index d = 0;
  if (outputs >= 3) {
    run_three({y, count, half, weights.col(0).data(), weights.col(1).data(), weights.col(2).data(),
               out.col(0).data(), out.col(1).data(), out.col(2).data()});
    d = 3;
  }
  for (; d < outputs; ++d) {
    run_one({y, count, half, weights.col(d).data(), out.col(d).data(), d % 2 == 1 ? -1.0 : 1.0});
  }
}

// The polynomial fitted to the window at `start`, evaluated at window points [first, last).
void apply_edge(const Basis& basis, const SavgolSpec& spec, double rate_hz, VectorRef y,
                Index start, int first, int last, Eigen::Ref<Matrix> out) {
  std::vector<Long> coefficient(basis.polynomial.size(), 0);
  for (std::size_t j = 0; j < coefficient.size(); ++j) {
    for (int k = 0; k < spec.window; ++k) {
      coefficient[j] +=
          basis.polynomial[j][static_cast<std::size_t>(k)] * static_cast<Long>(y(start + k));
    }
  }
  for (int d = 0; d < static_cast<int>(out.cols()); ++d) {
    const Long scale = derivative_scale(spec, d, rate_hz);
    for (int k = first; k < last; ++k) {
      Long sum = 0;
      for (int j = 0; j <= spec.order; ++j)
        sum += coefficient[static_cast<std::size_t>(j)] * basis.at(j, d, k);
      out(start + k, d) = static_cast<double>(sum * scale);
    }
  }
}

double value_gain(const Matrix& kernel, double fraction) {
  const Index half = (kernel.rows() - 1) / 2;
  double gain = kernel(half, 0);
  for (Index k = 1; k <= half; ++k) {
    gain += 2.0 * kernel(half + k, 0) * std::cos(kPi * fraction * static_cast<double>(k));
  }
  return gain;
}

}  // namespace

void check_savgol(const SavgolSpec& spec, int max_derivative) {
  require(spec.window >= 1 && spec.window <= kMaxWindow && spec.window % 2 == 1, "window",
          "the window is " + std::to_string(spec.window) +
              " samples: it must be an odd number from 1 to " + std::to_string(kMaxWindow));
  require(spec.order >= 0 && spec.order < spec.window, "order",
          "the polynomial order is " + std::to_string(spec.order) +
              ": it must be from 0 to window - 1 = " + std::to_string(spec.window - 1));
  require(spec.order <= kMaxOrder, "order",
          "the polynomial order is " + std::to_string(spec.order) + ": it must be at most " +
              std::to_string(kMaxOrder));
  require(max_derivative >= 0 && max_derivative <= kMaxDerivative, "derivative",
          "the derivative is " + std::to_string(max_derivative) + ": it must be from 0 to " +
              std::to_string(kMaxDerivative));
}

Matrix savgol_kernels(const SavgolSpec& spec, int max_derivative, double rate_hz) {
  check_savgol(spec, max_derivative);
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "the sampling rate must be positive");
  return kernels_from(make_basis(spec, std::min(max_derivative, spec.order)), spec, max_derivative,
                      rate_hz);
}

double savgol_cutoff(const SavgolSpec& spec) {
  const Matrix kernel = savgol_kernels(spec, 0, 1.0);
  const double wanted = std::sqrt(0.5);
  // The gain's lobes are about 2 / window wide: this scan cannot step over the first crossing.
  const int steps = 16 * spec.window;
  for (int i = 1; i <= steps; ++i) {
    double high = static_cast<double>(i) / steps;
    if (value_gain(kernel, high) > wanted) continue;
    double low = static_cast<double>(i - 1) / steps;
    for (int bisection = 0; bisection < 60; ++bisection) {
      const double middle = 0.5 * (low + high);
      (value_gain(kernel, middle) > wanted ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }
  return 1.0;
}

void savgol_correlate(const Matrix& kernels, VectorRef y, Eigen::Ref<Matrix> out) {
  const Index half = (kernels.rows() - 1) / 2;
  const Matrix weights = kernels.bottomRows(half + 1);
  const Index count = y.size() - 2 * half;
  require(count >= 1 && out.rows() == count && out.cols() == kernels.cols(), "out",
          "out must have one row for every full window and one column for every kernel");
  if (count >= kLanes) {
    run_centres(y.data() + half, count, weights, half, out);
    return;
  }
  // Few centres: padded to one block so that every output goes through the same loop.
  Vector padded = Vector::Zero(2 * half + kLanes);
  padded.head(y.size()) = y;
  Matrix block(kLanes, kernels.cols());
  run_centres(padded.data() + half, kLanes, weights, half, block);
  out = block.topRows(count);
}

void savgol_apply(const SavgolSpec& spec, double rate_hz, VectorRef y, int max_derivative,
                  Eigen::Ref<Matrix> out) {
  check_savgol(spec, max_derivative);
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "rate_hz", "the sampling rate must be positive");
  require(out.rows() == y.size() && out.cols() == max_derivative + 1, "out",
          "out must have the rows of y and max_derivative + 1 columns");
  if (y.size() < spec.window) {
    throw Error(Fault::kData, "y",
                "the signal has " + std::to_string(y.size()) +
                    " samples, fewer than the window of " + std::to_string(spec.window) +
                    ": use a shorter window or a longer signal");
  }
  require_finite(y, "y");

  const Basis basis = make_basis(spec, max_derivative);
  const Index half = savgol_edge_rows(spec);
  const Index count = y.size() - 2 * half;
  savgol_correlate(kernels_from(basis, spec, max_derivative, rate_hz), y,
                   out.middleRows(half, count));
  const int edge = static_cast<int>(half);
  apply_edge(basis, spec, rate_hz, y, 0, 0, edge, out);
  apply_edge(basis, spec, rate_hz, y, y.size() - spec.window, edge + 1, spec.window, out);
}

}  // namespace ulna
