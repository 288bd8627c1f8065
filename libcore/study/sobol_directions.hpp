// The table behind the Sobol' sequence.
#pragma once

#include <cstdint>

namespace ulna {

inline constexpr int kSobolDimensions = 512;

// Primitive polynomials of dimensions 2, 3, ...: bit k is the coefficient of x^k, ends included.
extern const std::uint16_t kSobolPolynomials[];

// Initial numbers m_1 ... m_s of those dimensions in a row, s the degree of the polynomial.
extern const std::uint16_t kSobolInitial[];

}  // namespace ulna
