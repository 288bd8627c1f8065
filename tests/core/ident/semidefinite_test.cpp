// The convex problem min 1/2 eta' h eta - g' eta over cones has one solution, and its conditions of
// Karush, Kuhn and Tucker prove it: S >= 0, gradient matrix G >= 0, S G = 0, free gradient 0.
#include "ident/semidefinite.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "base/random.hpp"

namespace ulna {
namespace {

struct Example {
  Matrix h;
  Vector g;
  std::vector<Cone> cones;
};

// Three cones of size n, then n free parameters, as the impedance has them; `scale` spreads the
// sizes as those of M, B and K do.
Example random_example(Index n, double scale, std::uint64_t seed) {
  Random random(seed);
  const Index each = n * (n + 1) / 2;
  const Index size = 3 * each + n;
  Matrix data(3 * size, size);
  for (double& x : data.reshaped()) x = random.normal();
  Vector truth(size);
  for (double& x : truth) x = random.normal();  // symmetric, mostly indefinite
  Vector unit = Vector::Ones(size);
  for (Index i = 0; i < 3; ++i) unit.segment(i * each, each).setConstant(std::pow(scale, i));
  data = data * unit.cwiseInverse().asDiagonal();
  truth = truth.cwiseProduct(unit);
  Example out{data.transpose() * data, {}, {}};
  out.g = out.h * truth;
  for (Index i = 0; i < 3; ++i) out.cones.push_back({i * each, n});
  return out;
}

Matrix symmetric(const Vector& eta, const Cone& cone) {
  Matrix s(cone.size, cone.size);
  for (Index j = 0, k = cone.first; j < cone.size; ++j) {
    for (Index i = j; i < cone.size; ++i) s(i, j) = s(j, i) = eta[k++];
  }
  return s;
}

// d f / d S: an off-diagonal parameter stands for two entries.
Matrix gradient_matrix(const Vector& slope, const Cone& cone) {
  Matrix g = symmetric(slope, cone);
  for (Index i = 0; i < cone.size; ++i) {
    for (Index j = 0; j < cone.size; ++j) {
      if (i != j) g(i, j) *= 0.5;
    }
  }
  return g;
}

double smallest(const Matrix& s) {
  return Eigen::SelfAdjointEigenSolver<Matrix>(s).eigenvalues()[0];
}

TEST(Semidefinite, MeetsTheConditionsOfTheMinimum) {
  int active = 0;
  for (const Index n : {1, 2, 3, 6}) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      const double scale = seed % 2 == 0 ? 1.0 : 8.0;
      SCOPED_TRACE("n " + std::to_string(n) + " seed " + std::to_string(seed));
      const Example e = random_example(n, scale, 100 * static_cast<std::uint64_t>(n) + seed);
      const SemidefiniteFit fit = fit_semidefinite(e.h, e.g, e.cones);
      active += fit.active ? 1 : 0;
      EXPECT_TRUE(fit.converged);
      const Vector slope = e.h * fit.eta - e.g;
      const Vector unbounded = e.h.ldlt().solve(e.g);
      // The slope at zero is g: the size that "zero" is measured by. 1e-5: the descent stops where
      // the value is exact to about 1e-15, and the slope is the root of that, magnified by h.
      for (const Cone& cone : e.cones) {
        const Matrix s = symmetric(fit.eta, cone);
        const Matrix g = gradient_matrix(slope, cone);
        const double force = gradient_matrix(e.g, cone).norm();
        const double size = symmetric(unbounded, cone).norm();
        EXPECT_GT(smallest(s), -1e-12 * s.norm());
        EXPECT_GT(smallest(g), -1e-5 * force);
        EXPECT_LT(std::abs((s * g).trace()), 1e-5 * force * size);
      }
      EXPECT_LT(slope.tail(n).norm(), 1e-5 * e.g.tail(n).norm());
    }
  }
  EXPECT_GT(active, 60);
}

TEST(Semidefinite, AFreeMinimumInsideIsKept) {
  Example e = random_example(2, 1.0, 7);
  Vector inside(11);
  inside << 2.0, 0.5, 1.0, 3.0, -1.0, 2.0, 1.0, 0.0, 1.0, 5.0, -4.0;
  e.g = e.h * inside;
  const SemidefiniteFit fit = fit_semidefinite(e.h, e.g, e.cones);
  EXPECT_FALSE(fit.active);
  EXPECT_TRUE(fit.converged);
  EXPECT_LT((fit.eta - inside).norm(), 1e-10 * inside.norm());
}

// One variable: max(0, g / h). With h = I, projection clips the eigenvalues (the off-diagonal
// parameter counts twice in the norm of S, hence h = diag(1, 2, 1)).
TEST(Semidefinite, KnownSolutions) {
  const SemidefiniteFit one =
      fit_semidefinite(Matrix::Constant(1, 1, 2.0), Vector::Constant(1, -3.0), {{0, 1}});
  EXPECT_TRUE(one.active);
  EXPECT_NEAR(one.eta[0], 0.0, 1e-6);

  Vector target(3);
  target << 1.0, 2.0, 1.0;  // eigenvalues 3 and -1
  const Matrix h = Vector(Eigen::Vector3d(1.0, 2.0, 1.0)).asDiagonal();
  const SemidefiniteFit fit = fit_semidefinite(h, h * target, {{0, 2}});
  EXPECT_TRUE(fit.active);
  for (Index i = 0; i < 3; ++i) EXPECT_NEAR(fit.eta[i], 1.5, 1e-6);
}

TEST(Semidefinite, AnswersAZeroProblem) {
  const SemidefiniteFit fit = fit_semidefinite(Matrix::Identity(3, 3), Vector::Zero(3), {{0, 2}});
  EXPECT_EQ(fit.eta.norm(), 0.0);
  EXPECT_FALSE(fit.active);
}

}  // namespace
}  // namespace ulna
