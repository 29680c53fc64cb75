// SPDX-License-Identifier: Apache-2.0
//
// What the calibrated model predicts of a sighting, and how that moves with one joint.
#pragma once

#include <map>
#include <vector>

#include <Eigen/Core>

#include "calib/bundle/calibration.h"

namespace kinescope::report {

/// True where the base frame is the camera's own: nothing of the robot is at its origin.
[[nodiscard]] bool base_is_camera(const Calibration& calibration);

/// One residual component and how the prediction of it grows with a joint's value.
struct ResidualAndRate {
  double residual = 0.0;
  double rate = 0.0;  ///< per rad or m
};

/// Forward kinematics of every frame, computed once.
class Predictor {
 public:
  explicit Predictor(const Calibration& calibration);

  /// Links in the base frame; empty where a joint value of the frame is unknown.
  [[nodiscard]] const std::vector<Pose>& links(int frame) const;

  /// Pixels of the marker's corners (a marker that is no square: its origin, as often as it has
  /// corners); empty where they cannot be predicted.
  [[nodiscard]] std::vector<Eigen::Vector2d> corners(const SightingResidual& sighting) const;

  /// Residual components with their rates; empty when the joint does not move the marker. Corners:
  /// px. Poses and points: m, in the axes of the displacement.
  [[nodiscard]] std::vector<ResidualAndRate> rates(const SightingResidual& sighting,
                                                   std::size_t joint) const;

 private:
  /// Velocity of a point of the base frame per unit of the joint.
  [[nodiscard]] Eigen::Vector3d velocity(const std::vector<Pose>& links, std::size_t joint,
                                         const Eigen::Vector3d& point_base) const;
  [[nodiscard]] std::vector<Eigen::Vector3d> corners_base(const SightingResidual& sighting,
                                                          const std::vector<Pose>& links,
                                                          const Marker& marker) const;

  const Calibration& calibration_;
  std::vector<std::vector<Pose>> links_;  ///< by frame
  std::vector<std::vector<bool>> moves_;  ///< [joint][link]
};

}  // namespace kinescope::report
