// Checksums of a study's files: SHA-256 names a plan, SipHash-2-4 keyed by it seals each record, so
// that a record of another plan is as wrong as a damaged one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace ulna {

using Digest = std::array<std::uint8_t, 32>;

// FIPS 180-4.
Digest sha256(std::string_view bytes);

std::string hex(const Digest& digest);

// Aumasson and Bernstein 2012; the key is the first 16 bytes of the digest.
std::uint64_t siphash(const Digest& key, const void* bytes, std::size_t size);

}  // namespace ulna
