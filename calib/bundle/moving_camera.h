// SPDX-License-Identifier: Apache-2.0
//
// A camera that does not stand still: it rides on a link of the robot, or a person carries it.
#pragma once

#include <vector>

#include "kinematics/core/ids.h"
#include "kinematics/core/pose.h"

namespace kinescope {

/// Exactly one of the two: a link, or a path.
struct MovingCamera {
  LinkId link{0};      ///< of the tree, that carries it; 0: a person carries it
  Pose T_camera_link;  ///< the camera sees that link there, at all times
  /// Of a person's: T_camera_base, one each frame of the measurements; NaN where nothing shows it.
  std::vector<Pose> path{};

  [[nodiscard]] bool on_robot() const { return link.value != 0; }
  [[nodiscard]] bool is_known(std::size_t frame) const {
    return on_robot() || path[frame].translation.allFinite();
  }
};

}  // namespace kinescope
