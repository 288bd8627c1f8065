// Designs: which points of the unit cube a study runs, in what order.
//
// Rows come in blocks; a block is what can be left out, resampled or taken as a prefix as a whole.
//   sample        1 row                          a plain sample of the cube
//   saltelli      A, AB_1 ... AB_G, B            AB_g is A with the factors of group g from B
//                 A, AB_1 ..., BA_1 ..., B       with second order (Saltelli 2002); the order of
//                                                rows within a block is that of SALib
//   radial        a, a with group 1 from b, ...  Campolongo, Saltelli and Cariboni 2011
//   trajectories  G + 1 rows, one group moves    Morris 1991, on a grid of p levels,
//                 by +-p / (2 (p - 1)) each      Campolongo, Cariboni and Saltelli 2007
// Any range of rows is made by itself: memory is that of the range.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/token.hpp"
#include "base/types.hpp"
#include "study/permutation.hpp"
#include "study/sobol_sequence.hpp"

namespace ulna {

enum class Scheme { kSample, kSaltelli, kRadial, kTrajectories };

enum class Sampler {
  kSobol,        // scrambled Sobol' sequence, n a power of two
  kLatin,        // Latin hypercube of n rows; A and B (or a and b) are independent
  kMonteCarlo,   // independent uniform numbers
  kPooledLatin,  // parity with SAFE: one Latin hypercube of 2 n rows; A and B are its halves, a and
                 // b its consecutive rows
};

struct SamplingSpec {
  Scheme scheme = Scheme::kSaltelli;
  Sampler sampler = Sampler::kSobol;
  Index factors = 0;
  std::vector<Index> group_of;  // group of each factor, 0 ... G - 1; empty: each its own
  Index n = 0;                  // blocks of one replicate
  Index replicates = 1;         // independent designs in a row
  bool second_order = false;    // saltelli
  double guard = 0.25;          // radial: smallest step in a quantile; 0: none
  Index levels = 4;             // trajectories: even
  Index candidates = 1;         // latin: of so many, the one with the largest smallest distance
  std::uint64_t seed = 0;
};

class Sampling {
 public:
  explicit Sampling(const SamplingSpec& spec, Token* token = nullptr);
  // Points that were made elsewhere, rows x factors in (0, 1) or at its ends; `spec` says how they
  // are to be read. Radial and trajectory blocks are checked: each group moves once.
  Sampling(const SamplingSpec& spec, PointRows points);
  // The layout alone, for outputs whose points are not known.
  static Sampling layout(const SamplingSpec& spec);

  const SamplingSpec& spec() const noexcept { return spec_; }
  Index groups() const noexcept { return groups_; }
  Index block_rows() const noexcept { return block_rows_; }
  Index blocks() const noexcept { return spec_.n * spec_.replicates; }
  Index rows() const noexcept { return blocks() * block_rows_; }
  bool has_points() const noexcept { return has_points_; }
  // Coordinates of base points that are strata of one Latin hypercube, 0 when there is none.
  Index stratified_coordinates() const noexcept;
  // Those of blocks first, first + 1, ...; out is blocks x stratified_coordinates().
  void fill_strata(Index first, Eigen::Ref<PointRows> out) const;
  // Whether the two points of a step are independent, as a total index needs.
  bool independent_steps() const noexcept;

  // Rows first, first + 1, ... ; out is rows x factors.
  void fill(Index first, Eigen::Ref<PointRows> out) const;

 private:
  struct Empty {};
  Sampling(const SamplingSpec& spec, Empty);
  void choose_candidate(Token* token);
  void make_base(Index replicate);
  void fill_base(Index replicate, Index first, Eigen::Ref<PointRows> out) const;
  void fill_latin(Index replicate, Index first, Index strata, Eigen::Ref<PointRows> out) const;
  void fill_blocks(Index replicate, Index first, Index count, double* out) const;
  void fill_trajectories(Index replicate, Index first, Index count, double* out) const;
  void check_points() const;

  SamplingSpec spec_;
  Index groups_ = 0;
  Index block_rows_ = 1;
  Index dimensions_ = 0;  // of a base point
  bool has_points_ = true;
  std::vector<Index> group_of_;
  std::vector<SobolSequence> sequences_;          // one a replicate
  std::vector<std::vector<Permutation>> orders_;  // one a replicate and dimension
  std::vector<Index> candidate_;                  // chosen, one a replicate
  std::shared_ptr<const PointRows> points_;
};

}  // namespace ulna
