// Many mobilisations that differ in the plant or the protocol, on several threads.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "sim/mobilisation.hpp"

namespace ulna::sim {

// What is run in a row. Called from several threads at once, and must be functions of the row.
struct BatchWork {
  // Throws Error for an arm that cannot be put into the device: the row's status is kFailedInit.
  std::function<std::shared_ptr<const MobilisedPlant>(Index row, Token* token)> plant;
  std::function<Protocol(Index row)> protocol;
  // What the log of a row that is ok is worth, `values` numbers. Throws Error where it determines
  // none: the row's status is kNonfinite.
  std::function<Vector(Index row, const MobilisedPlant& plant, const Mobilisation& mobilisation)>
      assess;
  Index values = 0;
};

struct BatchRow {
  RunStatus status = RunStatus::kFailedInit;
  std::string reason;          // one sentence; "" for ok
  double wall_s = 0.0;         // of plant, movement and assessment
  double start_s = kNaN;       // when the start was reached
  double largest_slip = kNaN;  // rad
  Vector values;               // NaN unless ok: nothing is filled in
};

// Rows in their order, the same to the last bit for any number of threads (0: one per processor)
// unless the protocol limits the time of computing. Throws Error: kCancelled; kArgument for a
// question that no log answers; kInternal or kMemory when a row meets them.
std::vector<BatchRow> mobilise_rows(Index rows, const BatchWork& work, int threads = 0,
                                    Token* token = nullptr);

}  // namespace ulna::sim
