// SPDX-License-Identifier: Apache-2.0
//
// The shortest rotation that turns one direction into another.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace kinescope {

/// The unit quaternion that turns the direction of `from` to that of `to` by the shortest way;
/// lengths do not matter. Opposite directions: a half turn about an axis across them, for z about
/// x. A vector without length has no direction: identity. Closed form, where Eigen's FromTwoVectors
/// takes a singular value decomposition for opposite directions.
[[nodiscard]] Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from,
                                                  const Eigen::Vector3d& to);

}  // namespace kinescope
