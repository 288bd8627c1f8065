// Table 3.3 of Dyck 2013 from Table 3.2, antisymmetry, and the cases without an answer.
#include "impedance/ellipse.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "made_record.hpp"

namespace ulna {
namespace {

constexpr double kDegree = kPi / 180.0;

TEST(Ellipse, AllEighteenOfTheTable) {
  // Area, shape and angle (degrees) of inertia, damping and stiffness, P1 to P6.
  static constexpr double kTable[6][9] = {{5.1, 4.1, 126.7, 176.8, 2.3, 110.9, 14139.5, 4.0, 107.3},
                                          {3.5, 4.1, 134.0, 144.3, 2.4, 118.6, 12251.8, 4.1, 112.8},
                                          {5.4, 3.9, 132.3, 162.9, 2.9, 118.1, 10981.1, 4.0, 109.6},
                                          {5.1, 4.5, 128.6, 111.3, 3.5, 116.4, 11554.9, 7.5, 108.5},
                                          {5.5, 4.2, 123.5, 159.8, 3.2, 107.7, 17693.1, 5.2, 102.1},
                                          {3.9, 3.9, 125.1, 76.2, 3.0, 103.7, 4892.9, 6.5, 106.9}};
  for (int p = 1; p <= 6; ++p) {
    const Truth arm = participant(p);
    const Matrix* const matrices[] = {&arm.m, &arm.b, &arm.k};
    for (int term = 0; term < 3; ++term) {
      SCOPED_TRACE(::testing::Message() << "P" << p << " matrix " << term);
      const Ellipse e = ellipse_of(*matrices[term]);
      const double* expected = kTable[p - 1] + 3 * term;
      // The table's matrices have two decimals: 0.3 %, and half a unit of the printed last digit.
      EXPECT_NEAR(e.area, expected[0], std::max(0.003 * expected[0], 0.05));
      EXPECT_NEAR(e.shape, expected[1], 0.06);
      EXPECT_NEAR(e.angle_rad / kDegree, expected[2], 0.15);
      EXPECT_TRUE(e.angle_defined);
      EXPECT_NEAR(e.area, kPi * e.major * e.minor, 1e-12 * e.area);
      EXPECT_NEAR(e.major * e.minor,
                  (*matrices[term])(0, 0) * (*matrices[term])(1, 1) -
                      std::pow(0.5 * ((*matrices[term])(0, 1) + (*matrices[term])(1, 0)), 2),
                  1e-9 * e.area);
    }
  }
}

// Errata: the means of Table 3.2 give these, not the 11.5 % of the text.
TEST(Ellipse, AntisymmetryOfTheStiffness) {
  static constexpr double kPercent[] = {8.5, 1.5, 3.6, 0.4, 4.3, 16.4};
  for (int p = 1; p <= 6; ++p) {
    const Truth arm = participant(p);
    EXPECT_NEAR(100.0 * ellipse_of(arm.k).antisymmetry, kPercent[p - 1], 0.05) << p;  // one decimal
    EXPECT_NEAR(antisymmetry_of(arm.k), ellipse_of(arm.k).antisymmetry, 1e-14);
    EXPECT_EQ(ellipse_of(arm.k).antisymmetric, 0.5 * (arm.k(0, 1) - arm.k(1, 0)));
  }
}

TEST(Ellipse, AngleIsThatOfTheMajorAxisFromZeroTo180Degrees) {
  for (int degree = 0; degree < 180; ++degree) {
    const double a = degree * kDegree;
    const Matrix turn{{std::cos(a), -std::sin(a)}, {std::sin(a), std::cos(a)}};
    const Ellipse e = ellipse_of(turn * Eigen::Vector2d(3.0, 1.0).asDiagonal() * turn.transpose());
    EXPECT_NEAR(std::remainder(e.angle_rad - a, kPi), 0.0, 1e-14) << degree;
    EXPECT_GE(e.angle_rad, 0.0);
    EXPECT_LT(e.angle_rad, kPi);
    EXPECT_NEAR(e.shape, 3.0, 1e-13);
  }
}

TEST(Ellipse, AnIsotropicMatrixHasNoAngle) {
  EXPECT_FALSE(ellipse_of(Matrix{{2.0, 0.0}, {0.0, 2.0}}).angle_defined);
  EXPECT_FALSE(ellipse_of(Matrix{{2.0, 0.7}, {-0.7, 2.0}}).angle_defined);  // only antisymmetric
  EXPECT_FALSE(ellipse_of(Matrix::Zero(2, 2)).angle_defined);
  EXPECT_TRUE(ellipse_of(Matrix{{2.0, 1e-6}, {1e-6, 2.0}}).angle_defined);
}

TEST(Ellipse, IndefiniteMatricesSaySo) {
  const Ellipse e = ellipse_of(Matrix{{1.0, 0.2}, {-0.2, -1.0}});
  EXPECT_LT(e.minor, 0.0);
  EXPECT_LT(e.area, 0.0);
  EXPECT_TRUE(std::isinf(e.antisymmetry));
  EXPECT_EQ(ellipse_of(Matrix{{1.0, 0.0}, {0.0, -1.0}}).antisymmetry, 0.0);
  EXPECT_TRUE(std::isnan(e.shape));
  EXPECT_TRUE(std::isnan(ellipse_of(Matrix{{1.0, 0.0}, {0.0, 0.0}}).shape));
}

TEST(Ellipse, RefusesWhatIsNotATwoByTwoMatrix) {
  EXPECT_THROW(ellipse_of(Matrix::Identity(3, 3)), Error);
  EXPECT_THROW(ellipse_of(Matrix::Constant(2, 2, std::nan(""))), Error);
}

TEST(Antisymmetry, OfThreeAxesIsTheSpectralNormOverTheGeometricMean) {
  // Antisymmetric part of (0, 0, 2): norm 2; symmetric part diag(1, 2, 4): mean 2.
  const Matrix z{{1.0, -2.0, 0.0}, {2.0, 2.0, 0.0}, {0.0, 0.0, 4.0}};
  EXPECT_NEAR(antisymmetry_of(z), 1.0, 1e-14);
  EXPECT_EQ(antisymmetry_of(Matrix::Identity(6, 6)), 0.0);
  EXPECT_EQ(antisymmetry_of(Matrix::Constant(1, 1, -3.0)), 0.0);
}

// Eigen 3.4.0 reshapes a row of a column-major table without its stride: this is the way around it.
TEST(MatrixOfRow, ReadsAStridedRowInRowOrder) {
  Matrix table(3, 8);
  for (Index i = 0; i < 3; ++i) {
    for (Index j = 0; j < 8; ++j)
      table(i, j) = 10.0 * static_cast<double>(i) + static_cast<double>(j);
  }
  EXPECT_EQ(matrix_of_row(table, 1, 0, 2), (Matrix{{10.0, 11.0}, {12.0, 13.0}}));
  EXPECT_EQ(matrix_of_row(table, 2, 4, 2), (Matrix{{24.0, 25.0}, {26.0, 27.0}}));
}

Matrix repeated(const Matrix& z, Index rows) {
  Matrix out(rows, 4);
  for (Index i = 0; i < rows; ++i) out.row(i) << z(0, 0), z(0, 1), z(1, 0), z(1, 1);
  return out;
}

TEST(EllipseInterval, HoldsTheEstimateAndKnowsItsWidth) {
  const Truth arm = participant(1);
  Matrix draws = repeated(arm.k, 4000);
  Random random(3);
  for (Index i = 0; i < draws.rows(); ++i) draws.row(i).array() += 2.0 * random.normal();
  const EllipseInterval e = ellipse_interval(arm.k, draws, 0.95);
  // A common shift c of all entries moves the eigenvalues by c (v . 1)^2.
  const double along = e.value.angle_rad;
  const double share = std::pow(std::cos(along) + std::sin(along), 2.0);
  EXPECT_LT(e.major[0], e.value.major);
  EXPECT_GT(e.major[1], e.value.major);
  // First order, and 4000 draws know a 97.5 % quantile within 3 %.
  EXPECT_NEAR(e.major[1] - e.major[0], 2.0 * 1.96 * 2.0 * share, 0.06 * 2.0 * 1.96 * 2.0 * share);
  EXPECT_LT(e.angle_rad[0], along);
  EXPECT_GT(e.angle_rad[1], along);
  EXPECT_TRUE(e.value.angle_defined);
  const EllipseInterval narrow = ellipse_interval(arm.k, draws, 0.5);
  EXPECT_LT(narrow.area[1] - narrow.area[0], 0.5 * (e.area[1] - e.area[0]));
}

// Angles about 0 and 180 degrees are neighbours.
TEST(EllipseInterval, DoesNotTearTheAngleAtItsEnd) {
  const Matrix z{{3.0, 1e-4}, {1e-4, 1.0}};
  Matrix draws = repeated(z, 1000);
  Random random(4);
  for (Index i = 0; i < draws.rows(); ++i) {
    const double shear = 0.05 * random.normal();
    draws(i, 1) += shear;
    draws(i, 2) += shear;
  }
  const EllipseInterval e = ellipse_interval(z, draws, 0.95);
  EXPECT_LT(e.angle_rad[1] - e.angle_rad[0], 0.2);
  EXPECT_LT(e.angle_rad[0], e.value.angle_rad);
  EXPECT_TRUE(e.value.angle_defined);
}

TEST(EllipseInterval, AnAngleThatTheDrawsDoNotKnowIsUndefined) {
  const Matrix z{{1.01, 0.0}, {0.0, 1.0}};
  Matrix draws = repeated(z, 1000);
  Random random(5);
  for (double& d : draws.reshaped()) d += 0.3 * random.normal();
  EXPECT_FALSE(ellipse_interval(z, draws, 0.95).value.angle_defined);
}

TEST(EllipseInterval, LeavesOutDrawsThatAreNotFinite) {
  const Truth arm = participant(2);
  Matrix draws = repeated(arm.k, 100);
  draws.row(7).setConstant(std::nan(""));
  const EllipseInterval e = ellipse_interval(arm.k, draws, 0.95);
  EXPECT_EQ(e.major[0], e.value.major);
  EXPECT_EQ(e.major[1], e.value.major);
}

}  // namespace
}  // namespace ulna
