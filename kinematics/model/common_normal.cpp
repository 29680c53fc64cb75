// SPDX-License-Identifier: Apache-2.0
#include "kinematics/model/common_normal.h"

#include <cmath>

#include <Eigen/Geometry>

namespace kinescope {

bool is_nearly_parallel(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return a.cross(b).norm() < kParallelSine;
}

NormalFeet normal_feet(const Eigen::Vector3d& origin, const Eigen::Vector3d& z,
                       const PlacedAxis& axis) {
  const Eigen::Vector3d across = z.cross(axis.direction);
  const Eigen::Vector3d between = axis.point - origin;
  const double square = across.squaredNorm();
  return {between.cross(axis.direction).dot(across) / square,
          between.cross(z).dot(across) / square};
}

Eigen::Vector3d in_plane_across(const Eigen::Vector3d& origin, const Eigen::Vector3d& z,
                                const PlacedAxis& axis) {
  const double along = z.dot(origin - axis.point) / z.dot(axis.direction);
  return axis.point + along * axis.direction - origin;
}

double angle_about(const Eigen::Vector3d& z, const Eigen::Vector3d& from,
                   const Eigen::Vector3d& to) {
  return std::atan2(z.dot(from.cross(to)), from.dot(to));
}

}  // namespace kinescope
