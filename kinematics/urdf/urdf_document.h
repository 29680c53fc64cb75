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

/// A URDF that was checked and cut down to links, joints and the visuals of markers.
struct KinematicPart {
  std::string text;                      ///< URDF that urdfdom parses
  std::string root;                      ///< name of the link without a parent
  std::vector<std::string> joint_order;  ///< parents before children, otherwise as in the file
};

/// Throws bad_input with line, element and remedy.
[[nodiscard]] KinematicPart kinematic_part(std::string_view text, const std::string& source);

}  // namespace kinescope::urdf_document
