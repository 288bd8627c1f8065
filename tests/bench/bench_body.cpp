// Joint torques of the 48-joint body with the suit of the overhead study, one thread.
#include <benchmark/benchmark.h>

#include <Eigen/SparseCholesky>

#include "../core/estimate/literal_map.hpp"
#include "../core/estimate/made_body.hpp"
#include "estimate/map_estimator.hpp"
#include "estimate/map_system.hpp"
#include "estimate/torque_estimator.hpp"

namespace {

using ulna::Index;
using ulna::Vector;

struct Case {
  std::shared_ptr<const ulna::SensorSuite> suite;
  ulna::made::Truth truth;
  Vector y;

  Case() {
    const auto body = ulna::made::human();
    suite = std::make_shared<const ulna::SensorSuite>(body, ulna::made::suit(*body));
    truth =
        ulna::made::make_truth(body, 1, {body->at_link("RightFoot"), body->at_link("LeftFoot")});
    y = ulna::made::noisy(*suite, ulna::made::readings(*suite, truth), 1, 2);
  }
};

// Goals: 60 us for torques, 300 us with all standard deviations.
void closed_form(benchmark::State& state) {
  const Case c;
  ulna::TorqueEstimator estimator(c.suite);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        estimator.update(c.truth.state, c.y, state.range(0) != 0).torque.sum());
  }
}
BENCHMARK(closed_form)->Arg(0)->Arg(1)->ArgName("deviations")->Unit(benchmark::kMicrosecond);

// Uncertain dynamics. Goal: 150 us.
void sparse(benchmark::State& state) {
  const Case c;
  ulna::MapEstimator estimator(c.suite);
  for (auto _ : state) {
    benchmark::DoNotOptimize(estimator.update(c.truth.state, c.y).torque.sum());
  }
}
BENCHMARK(sparse)->Unit(benchmark::kMicrosecond);

// The same problem as one sparse matrix over all of d, its pattern analysed once.
void one_factorisation(benchmark::State& state) {
  const Case c;
  const auto& body = c.suite->body();
  const ulna::ModelDeviation model{1e-2, 1e-2, 1e-2, 1e-2};
  Eigen::SimplicialLDLT<ulna::SparseMatrix> solver;
  solver.analyzePattern(
      ulna::made::normal_equations(ulna::map_system(*c.suite, c.truth.state, c.y), body, model)
          .information);
  const auto normal =
      ulna::made::normal_equations(ulna::map_system(*c.suite, c.truth.state, c.y), body, model);
  for (auto _ : state) {
    solver.factorize(normal.information);
    benchmark::DoNotOptimize(solver.solve(normal.rhs).eval().data());
  }
}
BENCHMARK(one_factorisation)->Unit(benchmark::kMicrosecond);

// The pipeline that is published: matrices assembled and factorised for task 1 and for task 2.
void two_factorisations(benchmark::State& state) {
  const Case c;
  const auto& body = c.suite->body();
  const ulna::ModelDeviation model{1e-2, 1e-2, 1e-2, 1e-2};
  Eigen::SimplicialLDLT<ulna::SparseMatrix> solver;
  for (auto _ : state) {
    for (int task = 0; task < 2; ++task) {
      const auto normal =
          ulna::made::normal_equations(ulna::map_system(*c.suite, c.truth.state, c.y), body, model);
      if (task == 0) solver.analyzePattern(normal.information);
      solver.factorize(normal.information);
      benchmark::DoNotOptimize(solver.solve(normal.rhs).eval().data());
    }
  }
}
BENCHMARK(two_factorisations)->Unit(benchmark::kMicrosecond);

// Kinematics alone, and the torques of a known motion.
void inverse_dynamics(benchmark::State& state) {
  const Case c;
  ulna::BodyMotion motion(c.suite->shared_body());
  Vector torque(48);
  ulna::Vector6 missing;
  for (auto _ : state) {
    motion.move(c.truth.state);
    motion.accelerate(c.truth.base, c.truth.joint);
    motion.inverse_dynamics(c.truth.external, torque, missing);
    benchmark::DoNotOptimize(torque.data());
  }
}
BENCHMARK(inverse_dynamics)->Unit(benchmark::kMicrosecond);

}  // namespace
