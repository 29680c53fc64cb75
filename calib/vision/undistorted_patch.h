// SPDX-License-Identifier: Apache-2.0
//
// Takes   a lens and a box of the image, px.
// Gives   where the box's pixels would be without the lens's distortion, px.
// Method  undistorted exactly at the nodes of a grid, a polynomial of the fourth degree between
//         them: 0.002 px over a marker of 100 px in the corner of a wide lens's picture.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "calib/camera/camera_model.h"

namespace kinescope {

class UndistortedPatch {
  static constexpr std::size_t kNodes = 5;
  using Line = std::array<Eigen::Vector2d, kNodes>;

 public:
  /// Nothing where the lens cannot be undone.
  [[nodiscard]] static std::optional<UndistortedPatch> over(const CameraModel& lens,
                                                            const Eigen::AlignedBox2d& box);

  /// One row of pixels.
  class Row {
   public:
    [[nodiscard]] Eigen::Vector2d at(double x) const;

   private:
    friend class UndistortedPatch;
    double low_ = 0.0;
    double step_ = 1.0;
    Line node_;
  };
  [[nodiscard]] Row row(double y) const;

 private:
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d step_ = Eigen::Vector2d::Ones();
  std::array<Line, kNodes> node_;  // by x, then y
};

/// The way back, for one point; nothing where the lens does not show it.
[[nodiscard]] std::optional<Eigen::Vector2d> distorted(const CameraModel& lens,
                                                       const Eigen::Vector2d& undistorted);

}  // namespace kinescope
