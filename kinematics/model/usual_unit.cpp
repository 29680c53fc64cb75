// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/usual_unit.h"

#include <cmath>

namespace kinescope {

std::optional<double> usual_unit(JointType type, double scale, double tolerance) {
  const double other = type == JointType::kRevolute ? kRadPerDegree : kMetrePerMillimetre;
  for (const double unit : {1.0, other}) {
    if (std::abs(scale / unit - 1.0) < tolerance) return unit;
  }
  return std::nullopt;
}

}  // namespace kinescope
