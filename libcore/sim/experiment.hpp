// A simulated experiment gives what a recorded one gives: a Record with its provenance.
#pragma once

#include <vector>

#include "base/token.hpp"
#include "record/record.hpp"
#include "sim/description.hpp"

namespace ulna::sim {

// Channels x, y (m), F_x, F_y (N, by the human on the robot), x_ref, y_ref (position control: where
// the handle should be, m) or F_x_ref, F_y_ref (force control: by the robot on the human, N), and
// the extras. Run number `run` of a seed: the same bits whatever else is simulated. Throws Error
// for a description that cannot be simulated (check_experiment) and, kAnalysis, for a loop that is
// unstable or a motion that meets a stop.
Record simulate(const Experiment& experiment, std::uint64_t seed, std::uint64_t run = 0,
                Token* token = nullptr);

// Runs 0 to count - 1 on `threads` threads (0: one per processor).
std::vector<Record> simulate_batch(const Experiment& experiment, std::uint64_t seed, Index count,
                                   int threads, Token* token = nullptr);

}  // namespace ulna::sim
