#include "sim/mobilisation_batch.hpp"

#include <chrono>
#include <cmath>

#include "base/error.hpp"
#include "base/pool.hpp"

namespace ulna::sim {
namespace {

// Faults that say something of the row, not of the batch or of the library. An argument that is
// wrong is the row's where its arm is made, and the caller's where its log is read.
bool of_the_row(Fault fault, RunStatus otherwise) {
  return fault == Fault::kData || fault == Fault::kAnalysis || fault == Fault::kUnsupported ||
         (fault == Fault::kArgument && otherwise == RunStatus::kFailedInit);
}

// Runs a part of a row; what it throws of the row becomes its status.
template <class Part>
bool attempted(BatchRow& row, RunStatus otherwise, const Part& part) {
  try {
    part();
    return true;
  } catch (const Error& error) {
    if (!of_the_row(error.fault(), otherwise)) throw;
    row.status = otherwise;
    row.reason = error.what();
    return false;
  }
}

BatchRow run_row(Index i, const BatchWork& work, Token* token) {
  const auto begin = std::chrono::steady_clock::now();
  BatchRow row;
  row.values = Vector::Constant(work.values, kNaN);
  std::shared_ptr<const MobilisedPlant> plant;
  Mobilisation done;
  // The token of the whole shows how many rows are done; a row's own progress is nobody's business.
  Token part(token);
  const bool moved = attempted(row, RunStatus::kFailedInit, [&] {
    plant = work.plant(i, &part);
    done = mobilise(*plant, work.protocol(i), &part);
  });
  if (moved) {
    row.status = done.status;
    row.reason = done.reason;
    row.start_s = done.start_s;
    row.largest_slip = done.largest_slip;
  }
  if (moved && done.status == RunStatus::kOk) {
    attempted(row, RunStatus::kNonfinite, [&] {
      const Vector values = work.assess(i, *plant, done);
      if (values.size() != work.values) {
        throw Error(Fault::kInternal, "assess", "an assessment has another number of values");
      }
      row.values = values;
    });
  }
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
  row.wall_s = wall.count();
  return row;
}

}  // namespace

std::vector<BatchRow> mobilise_rows(Index rows, const BatchWork& work, int threads, Token* token) {
  require(rows >= 0, "rows", "rows must not be negative");
  std::vector<BatchRow> results(static_cast<std::size_t>(rows));
  parallel_for(
      rows, threads,
      [&](std::ptrdiff_t i) { results[static_cast<std::size_t>(i)] = run_row(i, work, token); },
      token);
  return results;
}

}  // namespace ulna::sim
