// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace kinescope {

/// The rotation nearest to a 3 x 3 matrix in the sense of Frobenius (Kabsch 1976).
[[nodiscard]] Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace kinescope
