// SPDX-License-Identifier: Apache-2.0
//
// Takes   a nominal robot, joint values and measured marker poses (or points).
// Gives   where the base stands in the camera's frame, which link each marker sits on, and where on
//         it: the start of a calibration against a nominal robot.
// Method  robot-world and hand-eye of all markers together (hand_eye.h); absolute orientation for
//         points (Umeyama 1991), alternated with the points' places on their links.
#pragma once

#include <optional>
#include <vector>

#include "calib/bundle/measurements.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope {

namespace bundle {

// A marker on an inner link misses by the motion of the joints behind that link, which is large;
// errors of the nominal robot alone can make an inner link fit a little better. So the outermost
// link stays unless another one's misfit is below this share of its own.
inline constexpr double kClearlyBetter = 0.8;

}  // namespace bundle

struct Placement {
  Pose T_camera_base;
  std::vector<Marker> markers;
};

/// `joint_values`: frames x joints (rad, m), NaN where unknown. Throws undetermined when no marker
/// moves enough with the robot to place it.
[[nodiscard]] Placement place_markers(const KinematicTree& nominal,
                                      const Eigen::MatrixXd& joint_values,
                                      const PoseTracks& tracks);

/// The same for points; where there are several, one may be on the base. Points held in targets (no
/// measured place) leave T_camera_base at the identity.
[[nodiscard]] Placement place_points(const KinematicTree& nominal,
                                     const Eigen::MatrixXd& joint_values,
                                     const PointObservations& points);

}  // namespace kinescope
