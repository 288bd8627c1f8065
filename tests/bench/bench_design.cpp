// Designs of 50 s at 1 kHz: their making, optimising, holding against limits, and planning.
#include <benchmark/benchmark.h>

#include "../core/impedance/made_record.hpp"
#include "impedance/plan.hpp"
#include "impedance/safety.hpp"
#include "signal/multisine.hpp"
#include "signal/steps.hpp"

namespace {

ulna::MultisineSpec spec(ulna::Phases phases) {
  ulna::MultisineSpec out;
  out.amplitude = ulna::Vector::Constant(2, 0.01);
  out.phases = phases;
  return out;
}

ulna::ArmModel arm() {
  const ulna::Truth p1 = ulna::participant(1);
  return {p1.m, p1.b, p1.k, ulna::Vector::Zero(2)};
}

ulna::RobotModel robot() {
  const ulna::Matrix one = ulna::Matrix::Identity(2, 2);
  return {3000.0 * one, 90.0 * one, 1.1 * one};
}

void multisine_of_random_phases(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(ulna::multisine(spec(ulna::Phases::kRandom)));
}
BENCHMARK(multisine_of_random_phases)->Unit(benchmark::kMillisecond);

void multisine_of_optimised_phases(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(ulna::multisine(spec(ulna::Phases::kOptimised)));
}
BENCHMARK(multisine_of_optimised_phases)->Unit(benchmark::kMillisecond);

void sixteen_steps(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(ulna::steps({}));
}
BENCHMARK(sixteen_steps)->Unit(benchmark::kMillisecond);

void safety_of_a_multisine(benchmark::State& state) {
  const ulna::Excitation e = ulna::multisine(spec(ulna::Phases::kRandom));
  const ulna::ArmLoop loop(arm(), robot(), ulna::Drive::kPosition);
  ulna::SafetyOptions options;
  options.limits = {20.0, 0.1, 1.0, false};
  options.tremor.sigma = 1.0;
  for (auto _ : state) benchmark::DoNotOptimize(ulna::check_safety(e, loop, options));
}
BENCHMARK(safety_of_a_multisine)->Unit(benchmark::kMillisecond);

void plan_of_a_multisine(benchmark::State& state) {
  const ulna::Excitation e = ulna::multisine(spec(ulna::Phases::kRandom));
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        ulna::plan_experiment(e, arm(), robot(), {1.0, 0.0, 5.0}, {0.04, 1e-6}, {}));
  }
}
BENCHMARK(plan_of_a_multisine)->Unit(benchmark::kMillisecond);

}  // namespace
