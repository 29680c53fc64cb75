// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/undistorted_patch.h"

namespace kinescope {
namespace {

// Lagrange's, at nodes 0 to 4.
std::array<double, 5> lagrange_weights(double t) {
  const double a = t;
  const double b = t - 1.0;
  const double c = t - 2.0;
  const double d = t - 3.0;
  const double e = t - 4.0;
  return {b * c * d * e / 24.0, -a * c * d * e / 6.0, a * b * d * e / 4.0, -a * b * c * e / 6.0,
          a * b * c * d / 24.0};
}

}  // namespace

std::optional<UndistortedPatch> UndistortedPatch::over(const CameraModel& lens,
                                                       const Eigen::AlignedBox2d& box) {
  UndistortedPatch out;
  out.low_ = box.min();
  out.step_ = box.sizes() / (kNodes - 1);
  for (std::size_t i = 0; i < kNodes; ++i) {
    for (std::size_t j = 0; j < kNodes; ++j) {
      const Eigen::Vector2d node(static_cast<double>(i), static_cast<double>(j));
      const auto ray = unproject(lens, out.low_ + node.cwiseProduct(out.step_));
      if (!ray) return std::nullopt;
      out.node_[i][j] = {lens.fx * ray->x() + lens.cx, lens.fy * ray->y() + lens.cy};
    }
  }
  return out;
}

UndistortedPatch::Row UndistortedPatch::row(double y) const {
  const auto weights = lagrange_weights((y - low_.y()) / step_.y());
  Row out;
  out.low_ = low_.x();
  out.step_ = step_.x();
  for (std::size_t i = 0; i < kNodes; ++i) {
    out.node_[i].setZero();
    for (std::size_t j = 0; j < kNodes; ++j) out.node_[i] += weights[j] * node_[i][j];
  }
  return out;
}

Eigen::Vector2d UndistortedPatch::Row::at(double x) const {
  const auto weights = lagrange_weights((x - low_) / step_);
  Eigen::Vector2d out = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < kNodes; ++i) out += weights[i] * node_[i];
  return out;
}

std::optional<Eigen::Vector2d> distorted(const CameraModel& lens,
                                         const Eigen::Vector2d& undistorted) {
  return project(
      lens, {(undistorted.x() - lens.cx) / lens.fx, (undistorted.y() - lens.cy) / lens.fy, 1.0});
}

}  // namespace kinescope
