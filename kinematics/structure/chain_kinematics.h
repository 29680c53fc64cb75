// SPDX-License-Identifier: Apache-2.0
//
// A chain made ready for many samples: poses, what they leave of a sighting, and derivatives.
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"

namespace kinescope::structure_search {

inline constexpr int kMostChainParameters = 160;
using ChainJacobian =
    Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMostChainParameters>;

/// Tilts and shifts of a joint's axis.
[[nodiscard]] constexpr int geometry_size(JointType type) {
  return type == JointType::kRevolute ? 4 : 2;
}

/// Columns of chain_jacobian().
[[nodiscard]] int parameter_count(const ChainModel& model);

/// A single joint whose coordinate is free at every sample.
[[nodiscard]] bool is_free(const ChainModel& model);

/// Keeps a reference to the model.
class ChainKinematics {
 public:
  explicit ChainKinematics(const ChainModel& model);

  /// `coordinates`: one a joint.
  [[nodiscard]] Pose pose(const double* coordinates) const;
  /// pose(coordinates)^-1 * seen.
  [[nodiscard]] Pose left_over(const double* coordinates, const Pose& seen) const;
  /// d(right perturbation of pose) / d(tilts, shifts, scales of every joint, mount), for one row of
  /// readings.
  void jacobian(const double* coordinates, const Eigen::MatrixXd& readings, int instant,
                ChainJacobian& J) const;
  /// Twist of the child, in its frame, while the coordinates change at `rates`.
  [[nodiscard]] Vector6d twist(const double* coordinates, const double* rates) const;
  /// The last joint's axis as a body twist of the child.
  [[nodiscard]] const Vector6d& last_axis() const { return last_axis_; }

 private:
  const ChainModel& model_;
  std::vector<Pose> links_;     // F_1, F_1^-1 F_2, .., F_m^-1 M
  std::vector<Pose> inverses_;  // of these
  Vector6d last_axis_ = Vector6d::Zero();
};

}  // namespace kinescope::structure_search
