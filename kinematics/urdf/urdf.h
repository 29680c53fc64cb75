// SPDX-License-Identifier: Apache-2.0
//
// Takes   URDF text, or a KinematicTree.
// Gives   a KinematicTree, or URDF text that check_urdf, KDL, MuJoCo and RViz load.
// Frames  URDF's own: a link's frame is its joint's frame; rpy is fixed-axis x, y, z. SI units.
//         A marker is a fixed link "tag_<id>", its frame as in the AprilTag library.
// Not here: inertias (dynamic_urdf.h), meshes, SRDF.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// Parses URDF text. Fixed links named tag_<id> become markers of their parent, continuous joints
/// revolute ones without limits; <mimic> gives channel (the other joint), scale and offset. Throws
/// bad_input with `source`, and the line or element where known, for text that is no URDF, a loop,
/// two roots, joint types we do not know (planar, floating), NaN.
[[nodiscard]] KinematicTree parse_urdf(std::string_view text, const std::string& source);
[[nodiscard]] KinematicTree read_urdf(const std::filesystem::path& path);

/// Where a tree's joint limits come from; a comment of the file says it.
enum class LimitSource { kRecording, kRobotFile };

/// URDF text: names, origins, axes, limits, simple visuals (cylinders along the links, spheres or
/// boxes at the joints, thin plates for the markers), markers as fixed links. Deterministic;
/// numbers with 17 significant digits where needed to read back the same pose to 1e-12. A joint
/// with a scale other than 1 or an offset keeps its SI value as the joint value. Throws
/// std::logic_error for an invalid tree.
[[nodiscard]] std::string write_urdf(const KinematicTree& tree,
                                     LimitSource limits = LimitSource::kRecording);

}  // namespace kinescope
