// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace kinescope {

/// A joint's error over its value, linear between the points and nothing beyond them.
struct ErrorTable {
  Eigen::VectorXd value;  ///< of the joint, increasing, rad or m
  Eigen::VectorXd error;  ///< to be added to it
  Eigen::VectorXd sigma;  ///< standard uncertainty of the error
  [[nodiscard]] bool empty() const { return value.size() == 0; }
  /// Errors at values of the joint.
  [[nodiscard]] Eigen::VectorXd at(const Eigen::VectorXd& values) const;
};

}  // namespace kinescope
