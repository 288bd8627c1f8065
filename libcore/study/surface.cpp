#include "study/surface.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/error.hpp"
#include "base/words.hpp"
#include "study/permutation.hpp"
#include "study/streams.hpp"

namespace ulna {
namespace {

constexpr int kMaxSurfaceDegree = 14;
constexpr Index kSurfaceTerms = 300;
constexpr Index kMaxSurfaceRows = 6000;   // of the fit
constexpr Index kSurfaceFailures = 1000;  // whose neighbourhood validates
constexpr double kValidationShare = 0.15;

using Legendre = std::array<double, kMaxSurfaceDegree + 1>;

// Orthonormal on (0, 1): sqrt(2 d + 1) P_d(2 u - 1).
Legendre legendre(double u) {
  const double t = 2.0 * u - 1.0;
  Legendre p;
  p[0] = 1.0;
  p[1] = t;
  for (std::size_t d = 2; d < p.size(); ++d) {
    const auto n = static_cast<double>(d);
    p[d] = ((2.0 * n - 1.0) * t * p[d - 1] - (n - 1.0) * p[d - 2]) / n;
  }
  for (std::size_t d = 0; d < p.size(); ++d) p[d] *= std::sqrt(2.0 * static_cast<double>(d) + 1.0);
  return p;
}

struct SurfaceTerm {
  std::vector<std::pair<Index, int>> parts;
  double size = 0.0;
};

// Terms of up to three factors in the order of their hyperbolic degree (Blatman and Sudret 2011,
// q = 0.75), which prefers few factors with high degrees to many with low ones.
std::vector<SurfaceTerm> surface_terms(Index factors) {
  constexpr double kQ = 0.75;
  const auto weight = [](int d) { return std::pow(static_cast<double>(d), kQ); };
  const double limit = std::pow(static_cast<double>(kMaxSurfaceDegree), kQ) + 1e-9;
  std::vector<SurfaceTerm> out(1);
  // Of many factors, products alone exceed the terms that are kept.
  const Index second = factors <= 40 ? factors : 0;
  const Index third = factors <= 15 ? factors : 0;
  for (Index i = 0; i < factors; ++i) {
    for (int a = 1; a <= kMaxSurfaceDegree; ++a) {
      out.push_back({{{i, a}}, weight(a)});
      for (Index j = i + 1; j < second; ++j) {
        for (int b = 1; b <= kMaxSurfaceDegree && weight(a) + weight(b) <= limit; ++b) {
          out.push_back({{{i, a}, {j, b}}, weight(a) + weight(b)});
          for (Index k = j + 1; k < third; ++k) {
            for (int c = 1; c <= kMaxSurfaceDegree; ++c) {
              const double size = weight(a) + weight(b) + weight(c);
              if (size > limit) break;
              out.push_back({{{i, a}, {j, b}, {k, c}}, size});
            }
          }
        }
      }
    }
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const SurfaceTerm& a, const SurfaceTerm& b) { return a.size < b.size; });
  return out;
}

void fill_terms(const std::vector<SurfaceTerm>& terms, Index count, const std::vector<Legendre>& p,
                double* out) {
  for (Index t = 0; t < count; ++t) {
    double value = 1.0;
    for (const auto& [factor, degree] : terms[static_cast<std::size_t>(t)].parts) {
      value *= p[static_cast<std::size_t>(factor)][static_cast<std::size_t>(degree)];
    }
    out[t] = value;
  }
}

}  // namespace

double Surface::value(const VectorRef& point) const {
  std::vector<Legendre> p(static_cast<std::size_t>(point.size()));
  for (Index k = 0; k < point.size(); ++k) p[static_cast<std::size_t>(k)] = legendre(point[k]);
  double sum = 0.0;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    double product = coefficients[static_cast<Index>(t)];
    for (const auto& [factor, degree] : terms[t]) {
      product *= p[static_cast<std::size_t>(factor)][static_cast<std::size_t>(degree)];
    }
    sum += product;
  }
  return sum;
}

Surface fit_surface(const PointRows& points, const Vector& y, const std::vector<bool>& failed,
                    std::uint64_t seed, Token* token) {
  // A random share of a large study: the first rows that a random order meets.
  std::vector<Index> good;
  std::vector<Index> bad;
  const Permutation order(points.rows(), random_of(seed, Use::kSurfaceRows, 0, 0));
  for (Index place = 0; place < points.rows(); ++place) {
    const Index row = order(place);
    const bool lost = failed[static_cast<std::size_t>(row)];
    if (lost && static_cast<Index>(bad.size()) < kSurfaceFailures) bad.push_back(row);
    if (!lost && static_cast<Index>(good.size()) < kMaxSurfaceRows) good.push_back(row);
  }
  if (good.size() < 10) {
    throw Error(Fault::kData, "on_failure",
                sentence(17, "a surface needs at least 10 good runs, there are ", good.size()));
  }
  // Good runs by their distance to the nearest failure, nearest first.
  std::vector<double> distance(good.size());
  for (std::size_t i = 0; i < good.size(); ++i) {
    if (i % 64 == 0) step(token, 0.5 * static_cast<double>(i) / static_cast<double>(good.size()));
    double best = std::numeric_limits<double>::infinity();
    for (const Index row : bad) {
      best = std::min(best, (points.row(good[i]) - points.row(row)).squaredNorm());
    }
    distance[i] = best;
  }
  std::vector<std::size_t> rank(good.size());
  std::iota(rank.begin(), rank.end(), std::size_t{0});
  std::sort(rank.begin(), rank.end(), [&](std::size_t a, std::size_t b) {
    return distance[a] != distance[b] ? distance[a] < distance[b] : a < b;
  });
  const auto n = static_cast<Index>(good.size());
  const Index held = std::max<Index>(
      3, static_cast<Index>(std::llround(kValidationShare * static_cast<double>(n))));

  std::vector<SurfaceTerm> terms = surface_terms(points.cols());
  // Whole degrees only, so that no factor is preferred.
  auto limit = static_cast<std::size_t>(std::min(kSurfaceTerms, (n - held) / 3));
  limit = std::min(limit, terms.size());
  const auto ends = [&terms](std::size_t m) {
    return m == terms.size() || terms[m].size > terms[m - 1].size + 1e-9;
  };
  while (limit > 1 && !ends(limit)) --limit;
  terms.resize(std::max<std::size_t>(1, limit));
  const auto count = static_cast<Index>(terms.size());
  // Rows in that order: the first `held` validate.
  PointRows design(n, count);
  Vector output(n);
  std::vector<Legendre> p(static_cast<std::size_t>(points.cols()));
  for (Index i = 0; i < n; ++i) {
    const Index row = good[rank[static_cast<std::size_t>(i)]];
    for (Index k = 0; k < points.cols(); ++k) {
      p[static_cast<std::size_t>(k)] = legendre(points(row, k));
    }
    fill_terms(terms, count, p, design.data() + i * count);
    output[i] = y[row];
  }
  const double centre = output.mean();
  output.array() -= centre;
  step(token, 0.6);
  const auto fit = design.bottomRows(n - held);
  const auto check = design.topRows(held);
  const Matrix part = fit.transpose() * fit;
  const Vector part_right = fit.transpose() * output.tail(n - held);
  step(token, 0.8);

  // Nested fits are leading corners of one normal matrix; a model ends where a degree does.
  Index best = 1;
  double best_error = std::numeric_limits<double>::infinity();
  const auto solve = [](const Matrix& square, const Vector& right, Index m) -> Vector {
    // A touch of regularisation: where a corner is missing, polynomials of high degree are nearly
    // dependent, and what the data do not say shall stay small.
    Matrix normal = square.topLeftCorner(m, m);
    normal.diagonal().array() += 1e-10 * normal.diagonal().maxCoeff();
    return normal.ldlt().solve(right.head(m));
  };
  for (Index m = 1; m <= count; ++m) {
    if (!ends(static_cast<std::size_t>(m))) continue;
    step(token, 0.8);
    const Vector c = solve(part, part_right, m);
    const double error = (check.leftCols(m) * c - output.head(held)).squaredNorm();
    if (error < best_error) {
      best_error = error;
      best = m;
    }
  }
  const Matrix whole = part + check.transpose() * check;
  const Vector whole_right = part_right + check.transpose() * output.head(held);
  Surface out;
  out.coefficients = solve(whole, whole_right, best);
  out.coefficients[0] += centre;
  for (Index t = 0; t < best; ++t) {
    out.terms.push_back(terms[static_cast<std::size_t>(t)].parts);
  }
  const double spread = (output.head(held).array() - output.head(held).mean()).square().sum();
  out.validation_r2 = spread > 0.0 ? 1.0 - best_error / spread : (best_error > 0.0 ? 0.0 : 1.0);
  return out;
}

}  // namespace ulna
