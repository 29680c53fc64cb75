// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/links_in_camera.h"

namespace kinescope::bundle {

std::vector<std::vector<Pose>> links_in_camera(const Calibration& calibration) {
  std::vector<std::vector<Pose>> out;
  for (Eigen::Index f = 0; f < calibration.joint_values.rows(); ++f) {
    std::vector<Pose>& links = out.emplace_back();
    const Eigen::VectorXd q = calibration.joint_values.row(f);
    if (!q.allFinite()) continue;
    if (calibration.moving && !calibration.moving->is_known(static_cast<std::size_t>(f))) continue;
    links = forward_kinematics(calibration.tree, q);
    const Pose T_camera_base = calibration.moving
                                   ? camera_from_base(calibration, static_cast<int>(f), links)
                                   : calibration.T_camera_base;
    for (Pose& link : links) link = T_camera_base * link;
  }
  return out;
}

}  // namespace kinescope::bundle
