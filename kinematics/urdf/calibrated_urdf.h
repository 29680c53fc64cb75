// SPDX-License-Identifier: Apache-2.0
//
// Takes   the text of a robot's own URDF, and the tree that was calibrated from it.
// Gives   the same text with the calibrated joints: what stands for the file on a robot.
// Frames  as in urdf.h. The calibrated tree has the file's link frames (a prior ties each to where
//         the file draws it on its link, the zero of its joint apart), so that inertias, shapes and
//         sensors, which are given in them, hold as they stand.
// Method  tags of the text are exchanged, nothing is written anew: comments, order, white space and
//         elements that nobody here knows stay, byte for byte.
// Not here: what the file has no joint for (markers, a camera).
#pragma once

#include <string>
#include <string_view>

#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// <origin> and <axis> of every joint that the tree knows by its name and that is another one than
/// in the text (beyond 1e-12 m or rad), and the <origin> of links tag_<id> that are its markers.
/// Read back, every link is where the tree has it to 1e-12. Throws bad_input as parse_urdf(), and
/// std::logic_error where a joint of that name joins other links or moves otherwise.
[[nodiscard]] std::string with_calibrated_joints(std::string_view text, const std::string& source,
                                                 const KinematicTree& calibrated);

}  // namespace kinescope
