// The blocked algorithms against the dense formulas they stand for.
#include "ident/linear.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>

#include "base/error.hpp"
#include "made.hpp"

namespace ulna {
namespace {

// Several trials, spans that touch and spans that do not, more and fewer rows than one block of
// 256.
const std::vector<Span> kSpans = {
    {0, 3, 400}, {0, 400, 620}, {0, 650, 700}, {1, 0, 300}, {2, 5, 9}};

Prepared example(Index n, Index m) { return made_prepared({700, 300, 20}, n, m, 5); }

double relative(const Matrix& value, const Matrix& expected) {
  return (value - expected).norm() / expected.norm();
}

Matrix identity(const Design& design) {
  const Index size = design.regressors() * design.axes();
  return Matrix::Identity(size, size);
}

// theta of the projected normal equations, by an orthogonal basis of the instruments.
Matrix dense_solution(const Design& design, const Matrix& rows, Estimator estimator) {
  const Index q = design.instruments();
  const Index p = design.regressors();
  const Matrix y = rows.rightCols(design.axes());
  Matrix phi = rows.middleCols(q, p);
  if (estimator == Estimator::kInstrumental) {
    const Matrix z = rows.leftCols(q);
    phi = z * z.colPivHouseholderQr().solve(phi);
  }
  return phi.colPivHouseholderQr().solve(y);
}

TEST(Design, ColumnsAreInstrumentsRegressorsAndOutputs) {
  const Prepared prepared = example(2, 2);
  const double payload = 0.3;
  const Design design(prepared, payload, kSpans);
  ASSERT_EQ(design.instruments(), 7);
  ASSERT_EQ(design.regressors(), 7);
  ASSERT_EQ(design.columns(), 16);
  const Matrix rows = dense(design, kSpans);
  const PreparedTrial& trial = prepared.trials[0];
  const Matrix first = rows.topRows(397);
  EXPECT_EQ(first.middleCols(0, 2), trial.reference_acceleration().middleRows(3, 397));
  EXPECT_EQ(first.middleCols(2, 2), trial.reference_rate().middleRows(3, 397));
  EXPECT_TRUE((first.col(6).array() == 1.0).all());
  EXPECT_EQ(first.middleCols(7, 2), trial.acceleration().middleRows(3, 397));
  EXPECT_EQ(first.middleCols(9, 2), trial.velocity().middleRows(3, 397));
  EXPECT_TRUE((first.col(13).array() == 1.0).all());
  const Matrix y = -trial.force().middleRows(3, 397) - payload * first.middleCols(7, 2);
  EXPECT_LT((first.rightCols(2) - y).norm(), 1e-12);
  // Position and reference are centred over the spans; means of 971 values of size 1: rounding.
  EXPECT_LT(rows.middleCols(11, 2).colwise().mean().norm(), 1e-12);
  EXPECT_LT(rows.middleCols(4, 2).colwise().mean().norm(), 1e-12);
  EXPECT_GT(design.position_mean().norm(), 1.0);
}

TEST(Design, FewerReferencesThanAxesAreNoInstruments) {
  const Prepared prepared = example(3, 2);
  EXPECT_EQ(Design(prepared, 0.0, kSpans).instruments(), 0);
}

TEST(Factorise, IsTheTriangularFactorOfTheWholeTable) {
  const Prepared prepared = example(3, 0);
  const Design design(prepared, 0.0, kSpans);
  const Factor factor = factorise(design, kSpans);
  const Matrix rows = dense(design, kSpans);
  EXPECT_EQ(factor.rows, rows.rows());
  const Matrix r = Eigen::HouseholderQR<Matrix>(rows)
                       .matrixQR()
                       .topRows(rows.cols())
                       .triangularView<Eigen::Upper>();
  // Signs of rows are free. 1e-12: rounding of orthogonal transformations of 1000 rows.
  for (Index i = 0; i < r.rows(); ++i) {
    const double sign = r(i, i) * factor.r(i, i) < 0.0 ? -1.0 : 1.0;
    EXPECT_LT((sign * factor.r.row(i) - r.row(i)).norm(), 1e-12 * r.norm()) << i;
  }
  EXPECT_EQ(Matrix(factor.r.triangularView<Eigen::StrictlyLower>()).norm(), 0.0);
}

// With instruments the constant stands twice: the factor is not unique, its Gram matrix is.
TEST(Factorise, HoldsTheGramMatrixAlsoOfDependentColumns) {
  const Prepared prepared = example(2, 2);
  const Design design(prepared, 0.0, kSpans);
  const Factor factor = factorise(design, kSpans);
  const Matrix rows = dense(design, kSpans);
  EXPECT_LT(relative(factor.r.transpose() * factor.r, rows.transpose() * rows), 1e-13);
  EXPECT_EQ(Matrix(factor.r.triangularView<Eigen::StrictlyLower>()).norm(), 0.0);
}

TEST(Factorise, PartsMergeToTheWhole) {
  const Prepared prepared = example(1, 1);
  const Design design(prepared, 0.1, kSpans);
  std::vector<Factor> parts;
  std::vector<const Factor*> pointers;
  for (const Span& span : kSpans) parts.push_back(factorise(design, {span}));
  for (const Factor& part : parts) pointers.push_back(&part);
  const Factor merged = merge(pointers);
  const Factor whole = factorise(design, kSpans);
  EXPECT_EQ(merged.rows, whole.rows);
  EXPECT_LT(relative(merged.r.transpose() * merged.r, whole.r.transpose() * whole.r), 1e-13);
}

TEST(FactorOfGram, IsTheSameFactor) {
  const Prepared prepared = example(2, 2);
  const Design design(prepared, 0.0, kSpans);
  const Matrix rows = dense(design, kSpans);
  const Matrix gram = rows.transpose() * rows;
  const Factor factor = factor_of_gram(gram, 7, 7, 2, rows.rows());
  EXPECT_LT(relative(factor.r.transpose() * factor.r, gram), 1e-13);
  EXPECT_LT(relative(solve(factor, identity(design), Estimator::kInstrumental).theta,
                     dense_solution(design, rows, Estimator::kInstrumental)),
            1e-9);  // a Gram matrix squares the condition number, here about 10
}

// A column that depends on earlier ones leaves a zero row, not a NaN.
TEST(FactorOfGram, ADependentColumnIsAZeroRow) {
  Matrix rows = Matrix::Random(50, 4);
  rows.col(2) = 2.0 * rows.col(0) - rows.col(1);
  const Matrix gram = rows.transpose() * rows;
  const Factor factor = factor_of_gram(gram, 0, 3, 1, 50);
  EXPECT_TRUE(factor.r.allFinite());
  EXPECT_EQ(factor.r.row(2).norm(), 0.0);
  EXPECT_LT(relative(factor.r.transpose() * factor.r, gram), 1e-12);
}

TEST(Solve, EqualsTheDenseSolution) {
  for (const Index n : {1, 2, 3, 6}) {
    const Prepared prepared = example(n, n);
    const Design design(prepared, 0.0, kSpans);
    const Factor factor = factorise(design, kSpans);
    const Matrix rows = dense(design, kSpans);
    for (const Estimator estimator : {Estimator::kLeastSquares, Estimator::kInstrumental}) {
      const Fit fit = solve(factor, identity(design), estimator);
      // Two algorithms, condition below 100: 1e-14 times that.
      EXPECT_LT(relative(fit.theta, dense_solution(design, rows, estimator)), 1e-11) << n;
      EXPECT_LT(fit.condition, 100.0);
    }
  }
}

TEST(Solve, MoreReferencesThanAxesAreUsed) {
  const Prepared prepared = example(1, 3);
  const Design design(prepared, 0.0, kSpans);
  ASSERT_EQ(design.instruments(), 10);
  const Fit fit = solve(factorise(design, kSpans), identity(design), Estimator::kInstrumental);
  EXPECT_LT(
      relative(fit.theta, dense_solution(design, dense(design, kSpans), Estimator::kInstrumental)),
      1e-11);
}

// A structure is a stacked least-squares problem with fewer unknowns.
TEST(Solve, AStructureIsPartOfTheFit) {
  const Prepared prepared = example(2, 2);
  const Design design(prepared, 0.0, kSpans);
  const Matrix rows = dense(design, kSpans);
  Matrix transform = Matrix::Zero(14, 9);  // any linear map will do
  Random random(8);
  for (double& x : transform.reshaped()) x = random.normal();
  const Fit fit = solve(factorise(design, kSpans), transform, Estimator::kLeastSquares);

  const Index count = rows.rows();
  Matrix stacked(2 * count, 9);
  Vector right(2 * count);
  for (Index i = 0; i < 2; ++i) {
    stacked.middleRows(i * count, count) = rows.middleCols(7, 7) * transform.middleRows(7 * i, 7);
    right.segment(i * count, count) = rows.col(14 + i);
  }
  const Vector eta = stacked.colPivHouseholderQr().solve(right);
  EXPECT_LT(relative(fit.theta.reshaped(), transform * eta), 1e-11);
  EXPECT_LT(relative(fit.information, stacked.transpose() * stacked), 1e-12);
  Matrix unit = stacked;
  for (Index j = 0; j < 9; ++j) unit.col(j).normalize();
  const Eigen::JacobiSVD<Matrix> svd(unit, Eigen::ComputeThinV);
  EXPECT_NEAR(fit.condition / (svd.singularValues()[0] / svd.singularValues()[8]), 1.0, 1e-10);
  EXPECT_NEAR(std::abs(fit.weakest.dot(svd.matrixV().col(8))), 1.0, 1e-8);
}

TEST(Solve, ADependentColumnIsSeenInTheCondition) {
  Prepared prepared = example(1, 0);
  for (PreparedTrial& trial : prepared.trials) {
    Matrix table = trial.table();
    table.col(2) = -4.0 * (table.col(0).array() - 3.0);  // acceleration follows position: a sine
    trial = PreparedTrial(trial.begin(), 1, 0, table);
  }
  const Design design(prepared, 0.0, kSpans);
  const Fit fit = solve(factorise(design, kSpans), identity(design), Estimator::kLeastSquares);
  EXPECT_GT(fit.condition, 1e10);
  // The direction is acceleration and position in equal parts, in unit columns.
  EXPECT_NEAR(std::abs(fit.weakest[0]), std::sqrt(0.5), 0.02);
  EXPECT_NEAR(std::abs(fit.weakest[2]), std::sqrt(0.5), 0.02);
}

TEST(Solve, AnEmptyColumnIsInfinitelyBad) {
  Prepared prepared = example(1, 0);
  for (PreparedTrial& trial : prepared.trials) {
    Matrix table = trial.table();
    table.col(1).setZero();
    trial = PreparedTrial(trial.begin(), 1, 0, table);
  }
  const Design design(prepared, 0.0, kSpans);
  const Fit fit = solve(factorise(design, kSpans), identity(design), Estimator::kLeastSquares);
  EXPECT_TRUE(std::isinf(fit.condition));
}

// sum over |l| <= lag of (1 - |l| / (lag + 1)) s_t s_(t+l)', within runs; bread on both sides.
Matrix direct_newey_west(const Design& design, const std::vector<std::vector<Span>>& runs,
                         const std::vector<const Fit*>& fits, Index lag) {
  const Index q = design.instruments();
  const Index p = design.regressors();
  const Index n = design.axes();
  const Index each = p * n;
  const Index width = each * static_cast<Index>(fits.size());
  Matrix meat = Matrix::Zero(width, width);
  for (const std::vector<Span>& run : runs) {
    const Matrix rows = dense(design, run);
    Matrix scores(rows.rows(), width);
    for (std::size_t f = 0; f < fits.size(); ++f) {
      const Matrix error = rows.rightCols(n) - rows.middleCols(q, p) * fits[f]->theta;
      const Matrix seen = fits[f]->estimator == Estimator::kInstrumental
                              ? Matrix(rows.leftCols(q) * fits[f]->weights)
                              : Matrix(rows.middleCols(q, p));
      for (Index i = 0; i < n; ++i) {
        for (Index j = 0; j < p; ++j) {
          scores.col(static_cast<Index>(f) * each + i * p + j) =
              seen.col(j).cwiseProduct(error.col(i));
        }
      }
    }
    for (Index l = 0; l <= lag && l < rows.rows(); ++l) {
      const double weight = 1.0 - static_cast<double>(l) / static_cast<double>(lag + 1);
      const Matrix product =
          scores.topRows(rows.rows() - l).transpose() * scores.bottomRows(rows.rows() - l);
      meat += l == 0 ? product : Matrix(weight * (product + product.transpose()));
    }
  }
  Matrix bread = Matrix::Zero(width, width);
  for (std::size_t f = 0; f < fits.size(); ++f) {
    const Index at = static_cast<Index>(f) * each;
    bread.block(at, at, each, each) =
        fits[f]->transform * fits[f]->information.inverse() * fits[f]->transform.transpose();
  }
  return bread * meat * bread.transpose();
}

TEST(NeweyWest, EqualsTheDirectSum) {
  const Prepared prepared = example(2, 2);
  const Design design(prepared, 0.0, kSpans);
  const Factor factor = factorise(design, kSpans);
  const Fit iv = solve(factor, identity(design), Estimator::kInstrumental);
  const Fit ls = solve(factor, identity(design), Estimator::kLeastSquares);
  const std::vector<std::vector<Span>> runs = {
      {{0, 3, 400}, {0, 400, 620}}, {{0, 650, 700}}, {{1, 0, 300}}, {{2, 5, 9}}};
  // The lags: none; shorter and longer than the runs of 4 and 50 rows; longer than a block and than
  // every run.
  for (const Index lag : {0, 1, 3, 4, 49, 50, 60, 299, 700}) {
    for (const auto& fits : {std::vector<const Fit*>{&iv}, {&ls}, {&iv, &ls}}) {
      const Matrix expected = direct_newey_west(design, runs, fits, lag);
      EXPECT_LT(relative(newey_west(design, kSpans, fits, lag), expected), 1e-10) << "lag " << lag;
    }
  }
}

// With a stride: the same sum over scores that were first added up, from the start of every span.
TEST(NeweyWest, AStrideChangesNothingForSlowSignals) {
  // 60 s of signals below 2 Hz at 100 Hz: ten rows summed are 5 sums for each period of a product.
  Prepared prepared;
  prepared.report.rate_hz = 100.0;
  prepared.roles.position.resize(1);
  prepared.roles.force.resize(1);
  Random random(31);
  Matrix table = Matrix::Zero(6000, 4);
  for (Index c = 0; c < 4; ++c) {
    for (int line = 1; line <= 20; ++line) {
      const double phase = 2.0 * kPi * random.uniform();
      for (Index i = 0; i < 6000; ++i) {
        table(i, c) += std::cos(2.0 * kPi * 0.1 * line * 0.01 * static_cast<double>(i) + phase);
      }
    }
  }
  prepared.trials.emplace_back(0, 1, 0, table);
  const std::vector<Span> spans = {{0, 0, 3000}, {0, 3007, 6000}};
  const Design design(prepared, 0.0, spans);
  const Fit fit = solve(factorise(design, spans), identity(design), Estimator::kLeastSquares);
  const Matrix every = newey_west(design, spans, {&fit}, 39, 1);
  for (const Index stride : {2, 5, 10}) {
    // Sums make the triangle of weights coarser: (stride / lag)^2 / 4 = 1.6 % at most.
    EXPECT_LT(relative(newey_west(design, spans, {&fit}, 39, stride), every), 0.016) << stride;
  }
}

TEST(NeweyWest, OfAStructuredFitHasItsRank) {
  const Prepared prepared = example(1, 0);
  const Design design(prepared, 0.0, kSpans);
  Matrix transform = Matrix::Zero(4, 2);  // damping and constant alone
  transform(1, 0) = transform(3, 1) = 1.0;
  const Fit fit = solve(factorise(design, kSpans), transform, Estimator::kLeastSquares);
  const Matrix covariance = newey_west(design, kSpans, {&fit}, 5);
  EXPECT_LT(relative(covariance,
                     direct_newey_west(
                         design, {{kSpans[0], kSpans[1]}, {kSpans[2]}, {kSpans[3]}, {kSpans[4]}},
                         {&fit}, 5)),
            1e-10);
  EXPECT_EQ(covariance.row(0).norm(), 0.0);
  EXPECT_GT(covariance(1, 1), 0.0);
}

TEST(NeweyWest, CanBeCancelled) {
  const Prepared prepared = made_prepared({40000}, 1, 0, 3);
  const Design design(prepared, 0.0, {{0, 0, 40000}});
  const Fit fit =
      solve(factorise(design, {{0, 0, 40000}}), identity(design), Estimator::kLeastSquares);
  Token token;
  token.cancel();
  EXPECT_THROW(newey_west(design, {{0, 0, 40000}}, {&fit}, 10, 1, &token), Error);
  EXPECT_THROW(factorise(design, {{0, 0, 40000}}, &token), Error);
}

std::vector<Span> blocks_of(Index rows, Index size) {
  std::vector<Span> blocks;
  for (Index row = 0; row < rows; row += size) blocks.push_back({0, row, row + size});
  return blocks;
}

TEST(BlockBootstrap, DoesNotDependOnThreads) {
  const Prepared prepared = example(2, 2);
  const std::vector<Span> blocks = blocks_of(700, 50);
  const Design design(prepared, 0.0, blocks);
  const auto run = [&](int threads, std::uint64_t seed) {
    return block_bootstrap(design, blocks, identity(design), Estimator::kInstrumental, 40, seed,
                           threads);
  };
  const Matrix one = run(1, 9);
  EXPECT_EQ(run(2, 9), one);
  EXPECT_EQ(run(5, 9), one);
  EXPECT_NE(run(1, 10), one);
  // A longer bootstrap begins with the shorter one.
  EXPECT_EQ(
      Matrix(block_bootstrap(design, blocks, identity(design), Estimator::kInstrumental, 50, 9, 2)
                 .topRows(40)),
      one);
}

// Every replicate is the dense fit to the rows that were drawn.
TEST(BlockBootstrap, RefitsTheDrawnBlocks) {
  const Prepared prepared = example(2, 2);
  const std::vector<Span> blocks = blocks_of(700, 50);
  const Design design(prepared, 0.0, blocks);
  for (const Estimator estimator : {Estimator::kLeastSquares, Estimator::kInstrumental}) {
    const Matrix thetas = block_bootstrap(design, blocks, identity(design), estimator, 5, 9, 1);
    for (Index i = 0; i < 5; ++i) {
      Random random(9, static_cast<std::uint64_t>(i));
      std::vector<Span> drawn;
      for (std::size_t b = 0; b < blocks.size(); ++b) {
        drawn.push_back(blocks[static_cast<std::size_t>(random.below(14))]);
      }
      const Vector row = thetas.row(i);
      EXPECT_LT(relative(row, dense_solution(design, dense(design, drawn), estimator).reshaped()),
                1e-9);  // through a Gram matrix
    }
  }
}

TEST(BlockBootstrap, SpreadsLikeTheErrorOfWhiteResiduals) {
  // White residuals: the classical covariance is right, and 400 replicates know it within 15 %
  // (chi distribution: 1 / sqrt(800) = 3.5 %, four of them).
  Prepared prepared = made_prepared({2000}, 1, 0, 21);
  Random random(22);
  Matrix table = prepared.trials[0].table();
  table.col(3) = table.leftCols(3) * Vector::Ones(3);
  for (Index i = 0; i < 2000; ++i) table(i, 3) += random.normal();
  prepared.trials[0] = PreparedTrial(0, 1, 0, table);
  const std::vector<Span> blocks = blocks_of(2000, 10);
  const Design design(prepared, 0.0, blocks);
  const Matrix thetas =
      block_bootstrap(design, blocks, identity(design), Estimator::kLeastSquares, 400, 1, 2);
  const Matrix phi = dense(design, blocks).leftCols(4);
  const Matrix classical = (phi.transpose() * phi).inverse();
  for (Index j = 0; j < 4; ++j) {
    const double mean = thetas.col(j).mean();
    const double deviation = std::sqrt((thetas.col(j).array() - mean).square().sum() / 399.0);
    EXPECT_NEAR(deviation / std::sqrt(classical(j, j)), 1.0, 0.15) << j;
  }
}

}  // namespace
}  // namespace ulna
