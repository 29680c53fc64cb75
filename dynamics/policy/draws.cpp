// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/draws.h"

#include <array>
#include <cmath>
#include <numbers>

#include "dynamics/gp/simd.h"
#include "dynamics/policy/philox.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

PhiloxKey key_of(std::uint64_t seed) {
  return {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U)};
}

std::uint32_t tag(Use use, Index group) {
  return (static_cast<std::uint32_t>(use) << 24U) | static_cast<std::uint32_t>(group);
}

// 53 bits of two words.
double uniform(std::uint32_t high, std::uint32_t low) {
  return ((high >> 5U) * 67108864.0 + (low >> 6U)) / 9007199254740992.0;
}

// Two uniform numbers a counter, for the columns 2 group and 2 group + 1.
std::array<double, 2> uniform_pair(const DrawPlace& place, Index particle, Index group) {
  const PhiloxCounter bits = philox4x32(
      {static_cast<std::uint32_t>(particle), place.time, place.step, tag(place.use, group)},
      key_of(place.seed));
  return {uniform(bits[0], bits[1]), uniform(bits[2], bits[3])};
}

// Bits of one counter for many particles at once. Words are kept in 64-bit lanes for the products.
constexpr Index kLanes = 64;
using Words = std::array<std::uint64_t, kLanes>;

KINESCOPE_WIDE void philox_rounds(Words& c0, Words& c1, Words& c2, Words& c3, std::uint32_t key0,
                                  std::uint32_t key1) {
  constexpr std::uint64_t kLow = 0xFFFFFFFFU;
  for (int round = 0; round < philox::kRounds; ++round) {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const std::uint64_t a = philox::kMultiplier0 * c0[i];
      const std::uint64_t b = philox::kMultiplier1 * c2[i];
      c0[i] = (b >> 32U) ^ c1[i] ^ key0;
      c1[i] = b & kLow;
      c2[i] = (a >> 32U) ^ c3[i] ^ key1;
      c3[i] = a & kLow;
    }
    key0 += philox::kWeyl0;
    key1 += philox::kWeyl1;
  }
}

KINESCOPE_WIDE void keep_or_drop(const std::uint64_t* words, unsigned shift,
                                 std::uint64_t threshold, double kept, Index rows, double* out) {
  for (Index i = 0; i < rows; ++i) {
    out[i] = ((words[i] >> shift) & 0xFFU) < threshold ? 0.0 : kept;
  }
}

}  // namespace

void draw_uniforms(const DrawPlace& place, Index first, gp::Block out) {
  for (Index c = 0; c < out.cols(); c += 2) {
    for (Index i = 0; i < out.rows(); ++i) {
      const std::array<double, 2> u = uniform_pair(place, first + i, c / 2);
      out(i, c) = u[0];
      if (c + 1 < out.cols()) out(i, c + 1) = u[1];
    }
  }
}

void draw_normals(const DrawPlace& place, Index first, gp::Block out) {
  for (Index c = 0; c < out.cols(); c += 2) {
    for (Index i = 0; i < out.rows(); ++i) {
      const std::array<double, 2> u = uniform_pair(place, first + i, c / 2);
      const double radius = std::sqrt(-2.0 * std::log(1.0 - u[0]));
      const double angle = 2.0 * std::numbers::pi * u[1];
      out(i, c) = radius * std::cos(angle);
      if (c + 1 < out.cols()) out(i, c + 1) = radius * std::sin(angle);
    }
  }
}

void draw_dropout(const DrawPlace& place, double rate, Index first, gp::Block out) {
  constexpr Index kColumnsEach = 16;  // of 8 bits
  const auto threshold = static_cast<std::uint64_t>(std::lround(256.0 * rate));
  if (threshold == 0) {
    out.setOnes();
    return;
  }
  const double kept = 256.0 / (256.0 - static_cast<double>(threshold));
  const PhiloxKey key = key_of(place.seed);
  std::array<Words, 4> words;
  for (Index begin = 0; begin < out.rows(); begin += kLanes) {
    const Index rows = std::min(kLanes, out.rows() - begin);
    for (Index group = 0; group * kColumnsEach < out.cols(); ++group) {
      for (std::size_t i = 0; i < kLanes; ++i) {
        words[0][i] = static_cast<std::uint32_t>(first + begin + static_cast<Index>(i));
      }
      words[1].fill(place.time);
      words[2].fill(place.step);
      words[3].fill(tag(place.use, group));
      philox_rounds(words[0], words[1], words[2], words[3], key[0], key[1]);
      const Index columns = std::min(kColumnsEach, out.cols() - group * kColumnsEach);
      for (Index c = 0; c < columns; ++c) {
        keep_or_drop(words[static_cast<std::size_t>(c / 4)].data(),
                     8U * static_cast<unsigned>(c % 4), threshold, kept, rows,
                     out.data() + (group * kColumnsEach + c) * out.outerStride() + begin);
      }
    }
  }
}

}  // namespace kinescope::policy
