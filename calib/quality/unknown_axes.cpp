// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/unknown_axes.h"

#include <algorithm>

namespace kinescope {

bool is_axis_estimated(const Calibration& calibration, const Joint& joint) {
  return is_movable(joint) && std::ranges::any_of(calibration.parameters, [&](const Parameter& p) {
           return p.block == joint.name && p.name.starts_with(joint.name + " turn");
         });
}

std::vector<std::string> unknown_axes(const Calibration& calibration) {
  std::vector<std::string> out;
  for (std::size_t j = 0; j < calibration.joints.size(); ++j) {
    const Joint& joint = calibration.tree.joints[j];
    if (!is_axis_estimated(calibration, joint)) continue;
    if (calibration.joints[j].direction_sigma_rad) return {};
    out.push_back(joint.name);
  }
  return out;
}

}  // namespace kinescope
