// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/rng.h"

#include <cmath>
#include <numbers>

namespace kinescope {

Rng::Rng(std::uint64_t seed) : state_(seed * 6364136223846793005ULL + 1442695040888963407ULL) {
  for (int i = 0; i < 4; ++i) static_cast<void>(next());
}

Rng Rng::from_name(std::string_view name, std::uint64_t salt) {
  return Rng(stable_hash(name) ^ (salt * 0x9E3779B97F4A7C15ULL));
}

std::uint32_t Rng::next() {
  const std::uint64_t old = state_;
  state_ = old * 6364136223846793005ULL + 1442695040888963407ULL;
  const auto xorshifted = static_cast<std::uint32_t>(((old >> 18U) ^ old) >> 27U);
  const auto rot = static_cast<std::uint32_t>(old >> 59U);
  return (xorshifted >> rot) | (xorshifted << ((32U - rot) & 31U));
}

double Rng::uniform(double lower, double upper) {
  const double high = next() >> 5U;
  const double low = next() >> 6U;
  const double unit = (high * 67108864.0 + low) / 9007199254740992.0;
  return lower + (upper - lower) * unit;
}

int Rng::index(int count) { return static_cast<int>(uniform() * count); }

double Rng::normal(double sigma) {
  const double u = 1.0 - uniform();
  const double v = uniform();
  return sigma * std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
}

Eigen::Vector3d Rng::normal3(double sigma) {
  const double x = normal(sigma);
  const double y = normal(sigma);
  const double z = normal(sigma);
  return {x, y, z};
}

Eigen::Vector3d Rng::unit3() {
  Eigen::Vector3d v = normal3();
  while (v.norm() < 1e-9) v = normal3();
  return v.normalized();
}

std::uint64_t stable_hash(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return hash;
}

}  // namespace kinescope
