// SPDX-License-Identifier: Apache-2.0
//
// The checks that urdfdom does not make (or makes without naming a line), and the part of a URDF
// that kinematics needs. What is not read (meshes, inertias, transmissions) cannot make a file
// unreadable.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace kinescope::urdf_document {

/// URDF asks for both, and where nobody knows them zero would stop every planner: wide enough to
/// bind nowhere. Both together, read back, are as unknown as when they were written.
inline constexpr double kAnyEffort = 1000.0;
inline constexpr double kAnyVelocity = 100.0;

/// A URDF that was checked and cut down to links, joints and the visuals of markers.
struct KinematicPart {
  std::string text;                      ///< URDF that urdfdom parses
  std::string root;                      ///< name of the link without a parent
  std::vector<std::string> joint_order;  ///< parents before children, otherwise as in the file
};

/// Throws bad_input with line, element and remedy.
[[nodiscard]] KinematicPart kinematic_part(std::string_view text, const std::string& source);

}  // namespace kinescope::urdf_document
