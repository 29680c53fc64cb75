// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace kinescope {

/// What a marker's corners are other than those of a flat square of the declared size.
struct MarkerShape {
  double size = 1.0;    ///< factor
  double width = 0.0;   ///< width over height, minus 1
  double shear = 0.0;   ///< rad that its right angles are off by
  double warp_m = 0.0;  ///< two opposite corners stand as far before its plane, two behind it

  [[nodiscard]] Eigen::Vector3d corner_m(const Eigen::Vector3d& declared_m) const {
    const double before = declared_m.x() * declared_m.y() < 0.0 ? -1.0 : 1.0;
    return {(size + 0.5 * width) * declared_m.x() + 0.5 * shear * declared_m.y(),
            (size - 0.5 * width) * declared_m.y() + 0.5 * shear * declared_m.x(),
            size * declared_m.z() + before * warp_m};
  }
};

}  // namespace kinescope
