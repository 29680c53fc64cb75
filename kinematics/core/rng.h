// SPDX-License-Identifier: Apache-2.0
//
// Seeded random numbers with the same values on every platform (std distributions differ between
// libraries). PCG32, O'Neill 2014.
#pragma once

#include <cstdint>
#include <string_view>

#include <Eigen/Core>

namespace kinescope {

class Rng {
 public:
  explicit Rng(std::uint64_t seed);
  /// Seed from a name (and a number), stable across runs and platforms.
  [[nodiscard]] static Rng from_name(std::string_view name, std::uint64_t salt = 0);

  [[nodiscard]] std::uint32_t next();
  /// Uniform in [lower, upper).
  [[nodiscard]] double uniform(double lower = 0.0, double upper = 1.0);
  /// Uniform integer in [0, count).
  [[nodiscard]] int index(int count);
  /// Normal with mean 0 (Box-Muller, one value a call).
  [[nodiscard]] double normal(double sigma = 1.0);
  [[nodiscard]] Eigen::Vector3d normal3(double sigma = 1.0);
  [[nodiscard]] Eigen::Vector3d unit3();

 private:
  std::uint64_t state_;
};

/// 64-bit FNV-1a, a stable hash of bytes.
[[nodiscard]] std::uint64_t stable_hash(std::string_view bytes);

}  // namespace kinescope
