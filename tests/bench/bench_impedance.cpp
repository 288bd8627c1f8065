// From a record to its impedance: a 50 s trial of two axes with their references at 1 kHz, one
// thread, its parts, and many trials. Goals: 30 ms with Newey-West errors, 2 s for 1000 bootstrap
// refits.
#include <benchmark/benchmark.h>

#include "../core/impedance/made_record.hpp"
#include "ident/linear.hpp"
#include "impedance/estimate.hpp"

namespace {

using ulna::Index;

ulna::Record record_of(int trials) {
  ulna::Recording recording;
  recording.rate_hz = 1000.0;
  recording.duration_s = 50.0;
  recording.trials = trials;
  recording.force_noise = 0.05;
  return ulna::make_record(ulna::participant(1), recording);
}

void prepare_one_trial(benchmark::State& state) {
  const ulna::Record record = record_of(1);
  const ulna::Roles roles = ulna::find_roles(record, "", "", "");
  for (auto _ : state) benchmark::DoNotOptimize(ulna::prepare(record, roles, {}, 1));
}
BENCHMARK(prepare_one_trial)->Unit(benchmark::kMillisecond);

void identify_newey_west(benchmark::State& state) {
  const ulna::Record record = record_of(1);
  ulna::ImpedanceOptions options;
  options.threads = 1;
  for (auto _ : state) benchmark::DoNotOptimize(ulna::identify_impedance(record, options));
}
BENCHMARK(identify_newey_west)->Unit(benchmark::kMillisecond);

void bootstrap_of_1000_refits(benchmark::State& state) {
  const ulna::Record record = record_of(1);
  const ulna::Prepared prepared =
      ulna::prepare(record, ulna::find_roles(record, "", "", ""), {}, 1);
  std::vector<ulna::Span> blocks;
  const Index rows = prepared.trials[0].rows();
  for (Index b = 0; b < 25; ++b) blocks.push_back({0, rows * b / 25, rows * (b + 1) / 25});
  const ulna::Design design(prepared, 0.0, blocks);
  const ulna::Matrix free = ulna::Matrix::Identity(14, 14);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        ulna::block_bootstrap(design, blocks, free, ulna::Estimator::kInstrumental, 1000, 0, 1));
  }
}
BENCHMARK(bootstrap_of_1000_refits)->Unit(benchmark::kMillisecond);

// Arguments: trials, threads. Real time, since the work is spread.
void identify_trials(benchmark::State& state) {
  const ulna::Record record = record_of(static_cast<int>(state.range(0)));
  ulna::ImpedanceOptions options;
  options.threads = static_cast<int>(state.range(1));
  for (auto _ : state) benchmark::DoNotOptimize(ulna::identify_impedance(record, options));
}
BENCHMARK(identify_trials)
    ->ArgsProduct({{1, 10, 100}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
