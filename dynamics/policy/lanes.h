// SPDX-License-Identifier: Apache-2.0
//
// Eight particles at once, for the passes over particles and basis functions or samples; internal.
// Blocks of particles have a multiple of eight rows.
// The compiler's vectors become whatever registers the instruction set has (KINESCOPE_WIDE).
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

namespace kinescope::policy {

using Lanes [[gnu::vector_size(64)]] = double;
using LaneBits [[gnu::vector_size(64)]] = std::int64_t;
constexpr long kLaneCount = 8;

[[gnu::always_inline]] inline void load(const double* from, Lanes& out) {
  std::memcpy(&out, from, sizeof(Lanes));
}

[[gnu::always_inline]] inline void store(const Lanes& lanes, double* to) {
  std::memcpy(to, &lanes, sizeof(Lanes));
}

[[gnu::always_inline]] inline double sum(const Lanes& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/// exp(x) for x <= 0, relative error below 1e-15; 0 below -708. Range reduction by ln 2 in two
/// parts (Cody and Waite 1980), then the polynomial of degree 10 through exp at the Chebyshev
/// points of
/// +- ln 2 / 2, which is off by 2.9e-16.
[[gnu::always_inline]] inline void exp_of(Lanes& x) {
  constexpr double kLowest = -708.0;
  constexpr double kLog2E = 1.4426950408889634;
  constexpr double kLn2High = 6.93147180369123816490e-01;
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  const LaneBits inside = x > kLowest;
  const Lanes clamped = inside ? x : Lanes{} + kLowest;
  const Lanes shifted = clamped * kLog2E + kRound;
  const Lanes n = shifted - kRound;
  const Lanes r = (clamped - n * kLn2High) - n * kLn2Low;
  Lanes p = Lanes{} + 0x1.28a2c0a7209fbp-22;
  p = p * r + 0x1.72faf024b693bp-19;
  p = p * r + 0x1.a019a66a75dd4p-16;
  p = p * r + 0x1.a01978c6baf81p-13;
  p = p * r + 0x1.6c16c17f43a58p-10;
  p = p * r + 0x1.1111112dd67c5p-7;
  p = p * r + 0x1.55555555520afp-5;
  p = p * r + 0x1.555555554b757p-3;
  p = p * r + 0x1.0000000000005p-1;
  p = p * r + 0x1.000000000001ep+0;
  p = p * r + 1.0;
  constexpr auto kRoundBits = std::bit_cast<std::int64_t>(kRound);
  const LaneBits exponent = (reinterpret_cast<LaneBits>(shifted) - kRoundBits + 1023) << 52;
  x = inside ? p * reinterpret_cast<Lanes>(exponent) : Lanes{};
}

}  // namespace kinescope::policy
