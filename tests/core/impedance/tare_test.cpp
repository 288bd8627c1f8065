// The empty rig taken out: of parameters with their covariance, and of the forces of a record.
#include "impedance/tare.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <string>

#include "base/error.hpp"
#include "base/random.hpp"
#include "impedance/estimate.hpp"
#include "impedance/force_budget.hpp"
#include "impedance/natural.hpp"
#include "made_record.hpp"

namespace ulna {
namespace {

Truth rig() {
  return {Matrix{{0.45, 0.02}, {0.01, 0.5}}, Matrix{{1.2, 0.1}, {0.0, 0.9}},
          Matrix{{30.0, 4.0}, {2.0, 25.0}}, Vector{{0.01, 0.5}}};
}

// Both springs act on one handle: stiffnesses add, and so do K x0.
Truth together(const Truth& a, const Truth& b) {
  Truth out{a.m + b.m, a.b + b.b, a.k + b.k, {}};
  out.x0 = out.k.inverse() * (a.k * a.x0 + b.k * b.x0);
  return out;
}

NaturalParameters exact(const Truth& truth) {
  const Vector value = truth.natural();
  return {value, Matrix::Zero(value.size(), value.size())};
}

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(Tare, GivesTheHandBack) {
  const Truth hand = participant(1);
  const NaturalParameters out = tare_impedance(exact(together(hand, rig())), exact(rig()));
  EXPECT_LT((out.value - hand.natural()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Tare, CovarianceIsThatOfDraws) {
  const Truth hand = participant(2);
  const Vector a = together(hand, rig()).natural();
  const Vector b = rig().natural();
  Random random(3);
  const auto covariance = [&](double size) {
    Matrix root(14, 14);
    for (double& v : root.reshaped()) v = size * random.normal();
    return Matrix(root * root.transpose());
  };
  // Small, so that x0 is linear in them.
  const NaturalParameters measured{a, covariance(2e-3)};
  const NaturalParameters empty{b, covariance(1e-3)};
  const NaturalParameters out = tare_impedance(measured, empty);
  const Matrix one = measured.covariance.llt().matrixL();
  const Matrix other = empty.covariance.llt().matrixL();
  const int draws = 4000;
  Matrix table(draws, 14);
  for (int i = 0; i < draws; ++i) {
    Vector u(14), v(14);
    for (Index k = 0; k < 14; ++k) u[k] = random.normal(), v[k] = random.normal();
    table.row(i) =
        tare_impedance({a + one * u, measured.covariance}, {b + other * v, empty.covariance})
            .value.transpose();
  }
  const Matrix centred = table.rowwise() - table.colwise().mean();
  const Vector scatter = (centred.colwise().squaredNorm() / (draws - 1)).cwiseSqrt().transpose();
  for (Index k = 0; k < 14; ++k) {
    // Four standard errors of a standard deviation from 4000 draws: 4.5 %.
    EXPECT_NEAR(scatter[k] / std::sqrt(out.covariance(k, k)), 1.0, 0.05) << k;
  }
}

TEST(Tare, ARigWithoutSpringsHasNoEquilibrium) {
  Truth mass = rig();
  mass.b.setZero();
  mass.k.setZero();
  mass.x0.setConstant(NAN);
  NaturalParameters empty = exact(mass);
  empty.covariance.bottomRows(2).setConstant(NAN);
  empty.covariance.rightCols(2).setConstant(NAN);
  const Truth hand = participant(3);
  Truth measured = hand;
  measured.m += mass.m;
  const NaturalParameters out = tare_impedance(exact(measured), empty);
  EXPECT_LT((out.value - hand.natural()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Tare, RefusesWhatDoesNotFit) {
  const NaturalParameters two = exact(rig());
  const NaturalParameters one{Vector::Ones(4), Matrix::Identity(4, 4)};
  EXPECT_NE(message_of([&] { tare_impedance(two, one); }).find("another number of axes"),
            std::string::npos);
  EXPECT_NE(message_of([&] {
              tare_impedance({Vector::Ones(5), Matrix::Identity(5, 5)}, two);
            }).find("3 n^2 + n"),
            std::string::npos);
  EXPECT_NE(message_of([&] {
              tare_impedance({two.value, Matrix::Identity(3, 3)}, two);
            }).find("covariance"),
            std::string::npos);
  NaturalParameters lost = two;
  lost.value[13] = NAN;
  EXPECT_NE(message_of([&] { tare_impedance(two, lost); }).find("x0 of rig"), std::string::npos);
  lost = two;
  lost.value[0] = NAN;
  EXPECT_NE(message_of([&] { tare_impedance(lost, two); }).find("finite"), std::string::npos);
}

TEST(TareRecord, WhatIsIdentifiedAfterwardsIsTheHand) {
  const Truth hand = participant(1);
  Recording recording;
  recording.reference = false;
  recording.duration_s = 60.0;
  const Record record = make_record(together(hand, rig()), recording);
  const Roles roles = find_roles(record, "", "", "");
  const TaredRecord tared = tare_record(record, exact(rig()), roles, {});
  const ImpedanceEstimate estimate = identify_impedance(tared.record, {});
  const Vector truth = hand.natural();
  Vector found(14);
  found << estimate.fit.m.transpose().reshaped(), estimate.fit.b.transpose().reshaped(),
      estimate.fit.k.transpose().reshaped(), estimate.fit.x0;
  for (Index k = 0; k < 14; ++k) {
    // The wide smoother of the rig's motion deviates by 1e-6 at the edge of the narrow band.
    EXPECT_NEAR(found[k], truth[k], 2e-5 * std::max(1.0, std::abs(truth[k]))) << k;
  }
  EXPECT_LT(tared.record.rows(), record.rows());
  EXPECT_NE(tared.record.provenance().back().find("tared"), std::string::npos);
}

TEST(TareRecord, TheRigsErrorsTravelToTheHand) {
  // F is linear in the rig's parameters with the hand's own regressors: what the rig is wrong by,
  // the hand is wrong by, whatever the recording.
  Recording recording;
  recording.reference = false;
  const Record record = make_record(together(participant(1), rig()), recording);
  NaturalParameters empty = exact(rig());
  for (Index k = 0; k < 12; ++k) empty.covariance(k, k) = 0.01 * static_cast<double>(k + 1);
  const TaredRecord tared = tare_record(record, empty, find_roles(record, "", "", ""), {});
  const ImpedanceEstimate estimate = identify_impedance(tared.record, {});
  const ForceBudget budget = force_budget(estimate, tared.errors);
  for (Index k = 0; k < 12; ++k) {
    EXPECT_NEAR(budget.systematic(k, k) / empty.covariance(k, k), 1.0, 1e-4) << k;
  }
}

TEST(TareRecord, RefusesAnotherNumberOfAxes) {
  Recording recording;
  const Record record = make_record(participant(1), recording);
  const NaturalParameters one{Vector::Ones(4), Matrix::Identity(4, 4)};
  EXPECT_NE(message_of([&] {
              tare_record(record, one, find_roles(record, "", "", ""), {});
            }).find("axes"),
            std::string::npos);
}

}  // namespace
}  // namespace ulna
