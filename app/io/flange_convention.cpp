// SPDX-License-Identifier: Apache-2.0
#include "app/io/flange_convention.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"
#include "kinematics/core/pose.h"

namespace kinescope {
namespace {

using Numbers = Eigen::Vector4d;

Eigen::Quaterniond about_x(double angle) { return exp_rotation({angle, 0.0, 0.0}); }
Eigen::Quaterniond about_y(double angle) { return exp_rotation({0.0, angle, 0.0}); }
Eigen::Quaterniond about_z(double angle) { return exp_rotation({0.0, 0.0, angle}); }

Eigen::Quaterniond by_w_last(const Numbers& q) { return {q[3], q[0], q[1], q[2]}; }
Eigen::Quaterniond by_w_first(const Numbers& q) { return {q[0], q[1], q[2], q[3]}; }
Eigen::Quaterniond by_fixed_xyz(const Numbers& a) {
  return about_z(a[2]) * about_y(a[1]) * about_x(a[0]);
}
Eigen::Quaterniond by_xyz(const Numbers& a) {
  return about_x(a[0]) * about_y(a[1]) * about_z(a[2]);
}
Eigen::Quaterniond by_zyx(const Numbers& a) {
  return about_z(a[0]) * about_y(a[1]) * about_x(a[2]);
}
Eigen::Quaterniond by_zyz(const Numbers& a) {
  return about_z(a[0]) * about_y(a[1]) * about_z(a[2]);
}
Eigen::Quaterniond by_rotation_vector(const Numbers& v) {
  return exp_rotation(Eigen::Vector3d(v.head<3>()));
}

constexpr std::array<RotationConvention, 7> kConventions{{
    {"quaternion_xyzw", "quaternion, w last", 4, by_w_last},
    {"quaternion_wxyz", "quaternion, w first", 4, by_w_first},
    {"fixed_xyz", "angles about fixed x, y, z", 3, by_fixed_xyz},
    {"xyz", "angles about x, then the turned y, then the turned z", 3, by_xyz},
    {"zyx", "angles about z, then the turned y, then the turned x", 3, by_zyx},
    {"zyz", "angles about z, then the turned y, then the turned z", 3, by_zyz},
    {"rotation_vector", "a rotation vector", 3, by_rotation_vector},
}};

}  // namespace

std::span<const RotationConvention> rotation_conventions() { return kConventions; }

const RotationConvention& rotation_convention(std::string_view name) {
  const auto found = std::ranges::find(kConventions, name, &RotationConvention::name);
  KINESCOPE_CHECK(found != kConventions.end(), "a convention of the list");
  return *found;
}

std::vector<std::string> rotation_convention_names() {
  std::vector<std::string> out;
  for (const RotationConvention& convention : kConventions) out.emplace_back(convention.name);
  return out;
}

std::string to_string(const FlangeDeclaration& declaration) {
  std::vector<std::string> parts;
  if (!declaration.rotation.empty()) parts.push_back("rotation: " + declaration.rotation);
  if (declaration.conjugate) parts.emplace_back("conjugate: true");
  if (declaration.degrees) parts.emplace_back(*declaration.degrees ? "unit: deg" : "unit: rad");
  if (declaration.row_offset != 0)
    parts.push_back(fmt::format("row_offset: {}", declaration.row_offset));
  return fmt::format("flange: {{{}}}", fmt::join(parts, ", "));
}

}  // namespace kinescope
