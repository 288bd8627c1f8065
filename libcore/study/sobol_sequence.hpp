// The scrambled Sobol' sequence, any row at once.
//
// Sobol' 1967 with the direction numbers of Joe and Kuo 2008, scrambled by a random linear matrix
// and a digital shift (Matousek 1998), which keeps the net and makes each point uniform.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/types.hpp"

namespace ulna {

// Row-major block of rows, as designs are made and handed out.
using PointRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

class SobolSequence {
 public:
  // dimensions: 1 to kSobolDimensions. `replicate` numbers independent scrambles of one seed;
  // without scrambling the sequence is Sobol's own, shifted by half of 2^-52.
  SobolSequence(Index dimensions, std::uint64_t seed, std::uint64_t replicate,
                bool scrambled = true);

  // Points first, first + 1, ... of the sequence, below 2^40, each inside (0, 1).
  void fill(Index first, Eigen::Ref<PointRows> out) const;

 private:
  static constexpr int kDigits = 52;     // of a coordinate
  static constexpr int kIndexBits = 40;  // of a row
  using Directions = std::array<std::uint64_t, kIndexBits>;
  std::vector<Directions> directions_;
  std::vector<std::uint64_t> shift_;
};

}  // namespace ulna
