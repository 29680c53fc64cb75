// SPDX-License-Identifier: Apache-2.0
//
// A Pose as a Ceres parameter block of seven numbers (qx qy qz qw tx ty tz) whose step is T exp(d)
// with only some of the six components of d free: an axis has no turn about and no shift along
// itself.
#pragma once

#include <array>

#include <ceres/manifold.h>

#include "kinematics/core/pose.h"

namespace kinescope::bundle {

using PoseBlock = std::array<double, 7>;
/// Which of (rx ry rz tx ty tz) may move.
using TangentMask = std::array<bool, 6>;

[[nodiscard]] PoseBlock to_block(const Pose& pose);
[[nodiscard]] Pose from_block(const double* block);

/// d(T exp(d)) / dd at d = 0, 7 x 6.
[[nodiscard]] Eigen::Matrix<double, 7, 6> plus_jacobian(const Pose& pose);
/// d log(T^-1 y) / dy at y = T, 6 x 7; minus_jacobian * plus_jacobian = I.
[[nodiscard]] Eigen::Matrix<double, 6, 7> minus_jacobian(const Pose& pose);

class PoseManifold final : public ceres::Manifold {
 public:
  explicit PoseManifold(const TangentMask& mask);
  [[nodiscard]] int AmbientSize() const override { return 7; }
  [[nodiscard]] int TangentSize() const override { return static_cast<int>(free_.size()); }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

 private:
  std::vector<int> free_;
};

}  // namespace kinescope::bundle
