// SPDX-License-Identifier: Apache-2.0
//
// A camera as links of a robot, by ROS's convention (REP 103): camera_link is a body, x forward, y
// left, z up; camera_optical_frame its child, x right, y down, z forward.
#pragma once

#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

/// Two links and the fixed joints to them, behind all others; a name that is taken gets a number.
[[nodiscard]] KinematicTree with_camera_links(KinematicTree tree, LinkId carrier,
                                              const Pose& T_carrier_optical);

}  // namespace kinescope
