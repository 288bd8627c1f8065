// Eight signals or samples in lockstep. A hot loop is a template over the width of the processor's
// registers, compiled once for every x86-64 and once for AVX2, and chosen when it is called.
// Without contraction both do the same operations in the same order on every lane, so the bits do
// not depend on the processor.
#pragma once

#include "base/types.hpp"

#define ULNA_INLINE __attribute__((always_inline)) inline
#if defined(__x86_64__)
#define ULNA_AVX2 __attribute__((target("avx2")))
#endif

namespace ulna::lanes {

inline constexpr Index kLanes = 8;

// A register of doubles whose loads and stores need no alignment. The type is a member because a
// template argument would lose the attributes.
struct Base {
  typedef double V __attribute__((vector_size(16), aligned(8), may_alias));
  static constexpr int kWidth = 2;
};
struct Avx2 {
  typedef double V __attribute__((vector_size(32), aligned(8), may_alias));
  static constexpr int kWidth = 4;
};

template <class R>
ULNA_INLINE const typename R::V& load(const double* p) {
  return *reinterpret_cast<const typename R::V*>(p);
}
template <class R>
ULNA_INLINE typename R::V& store(double* p) {
  return *reinterpret_cast<typename R::V*>(p);
}

inline bool have_avx2() noexcept {
#if defined(__x86_64__)
  return __builtin_cpu_supports("avx2") != 0;
#else
  return false;
#endif
}

}  // namespace ulna::lanes
