// Reading and writing of text tables; bytes per second are those of the text.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <string>

#include "record/csv.hpp"
#include "record/look.hpp"

namespace {

// 60 s of one joint at 1 kHz, as laboratories write it.
std::string table(char delimiter, char decimal) {
  std::string text = "time_s,position_rad,torque_Nm\n";
  for (int i = 0; i < 60000; ++i) {
    char line[64];
    std::snprintf(line, sizeof line, "%d.%03d,0.%07d,-%d.%06d\n", i / 1000, i % 1000,
                  (i * 79) % 9999991, i % 7, (i * 1047) % 999983);
    text += line;
  }
  for (char& c : text) c = c == ',' ? delimiter : c == '.' ? decimal : c;
  return text;
}

void BM_ReadCsv(benchmark::State& state, char delimiter, char decimal) {
  const std::string text = table(delimiter, decimal);
  for (auto _ : state) {
    benchmark::DoNotOptimize(ulna::read_csv_memory(text.data(), text.size()));
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * text.size()));
}
BENCHMARK_CAPTURE(BM_ReadCsv, comma, ',', '.')->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_ReadCsv, blanks, ' ', '.')->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_ReadCsv, decimal_comma, ';', ',')->Unit(benchmark::kMillisecond);

void BM_Look(benchmark::State& state) {
  const std::string text = table(',', '.');
  const ulna::Record record = ulna::read_csv_memory(text.data(), text.size()).record;
  for (auto _ : state) benchmark::DoNotOptimize(ulna::look(record));
}
BENCHMARK(BM_Look)->Unit(benchmark::kMillisecond);

void BM_WriteCsv(benchmark::State& state) {
  const std::string text = table(',', '.');
  const ulna::Record record = ulna::read_csv_memory(text.data(), text.size()).record;
  for (auto _ : state) ulna::write_csv(record, "/dev/null");
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * text.size()));
}
BENCHMARK(BM_WriteCsv)->Unit(benchmark::kMillisecond);

}  // namespace
