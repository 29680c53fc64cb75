// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/links_in_camera.h"

namespace kinescope::bundle {

std::vector<std::vector<Pose>> links_in_camera(const Calibration& calibration) {
  std::vector<std::vector<Pose>> out;
  for (Eigen::Index f = 0; f < calibration.joint_values.rows(); ++f) {
    std::vector<Pose>& links = out.emplace_back();
    const Eigen::VectorXd q = calibration.joint_values.row(f);
    if (!q.allFinite()) continue;
    links = forward_kinematics(calibration.tree, q);
    for (Pose& link : links) link = calibration.T_camera_base * link;
  }
  return out;
}

}  // namespace kinescope::bundle
