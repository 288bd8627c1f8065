// The filters at the size of a 50 s trial at 1 kHz.
#include <benchmark/benchmark.h>

#include <cmath>

#include "base/random.hpp"
#include "signal/resample.hpp"
#include "signal/savgol.hpp"
#include "signal/spectrum.hpp"
#include "signal/zero_phase.hpp"

namespace {

using ulna::Index;
using ulna::Matrix;
using ulna::Vector;

constexpr double kRate = 1000.0;
constexpr Index kRows = 50000;

Matrix noise(Index rows, Index columns) {
  ulna::Random random(1);
  Matrix y(rows, columns);
  for (double& x : y.reshaped()) x = random.normal();
  return y;
}

// Goal: 2.5 ms.
void savgol_three_outputs(benchmark::State& state) {
  const Vector y = noise(kRows, 1).col(0);
  Matrix out(kRows, 3);
  for (auto _ : state) {
    ulna::savgol_apply({static_cast<int>(state.range(0)), 6}, kRate, y, 2, out);
    benchmark::DoNotOptimize(out.data());
  }
}
BENCHMARK(savgol_three_outputs)->Arg(101)->Arg(151)->Unit(benchmark::kMillisecond);

// Goal: 8 ms for 14 columns.
void zero_phase(benchmark::State& state) {
  const ulna::Sos sos = ulna::butterworth_lowpass(5, 5.0, kRate);
  const Matrix y = noise(kRows, state.range(0));
  Matrix out = y;
  for (auto _ : state) {
    ulna::filter_zero_phase(sos, {}, out);
    benchmark::DoNotOptimize(out.data());
  }
}
BENCHMARK(zero_phase)->Arg(1)->Arg(8)->Arg(14)->Unit(benchmark::kMillisecond);

void welch_four_channels(benchmark::State& state) {
  const Matrix y = noise(kRows, 4);
  for (auto _ : state) benchmark::DoNotOptimize(ulna::welch(y, kRate, 1024));
}
BENCHMARK(welch_four_channels)->Unit(benchmark::kMillisecond);

void resample_jittered(benchmark::State& state) {
  ulna::Random random(2);
  Vector times(kRows), y(kRows);
  for (Index i = 0; i < kRows; ++i) {
    times(i) = (static_cast<double>(i) + 0.2 * (random.uniform() - 0.5)) / kRate;
    y(i) = std::sin(2.0 * ulna::kPi * 20.0 * times(i));
  }
  for (auto _ : state) {
    benchmark::DoNotOptimize(ulna::resample_uniform(times, y, times(0), kRate, kRows - 1));
  }
}
BENCHMARK(resample_jittered)->Unit(benchmark::kMillisecond);

}  // namespace
