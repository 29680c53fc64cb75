// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_model.h"

#include <cmath>

#include <Eigen/LU>

namespace kinescope {
namespace {

// A point closer to the camera's plane than this (m) has no image.
constexpr double kMinDepth = 1e-6;

// Distorted normalised coordinates and their derivatives.
struct Distorted {
  Eigen::Vector2d xy;
  Eigen::Matrix2d d_xy;                      // with respect to the undistorted coordinates
  Eigen::Matrix<double, 2, 8> d_distortion;  // with respect to the distortion terms
};

// Brown's model and its rational extension, as OpenCV defines them:
// x'' = x (1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6) + 2 p1 x y + p2 (r2 + 2 x2).
Distorted distort_polynomial(const std::array<double, 8>& k, const Eigen::Vector2d& p) {
  const double x = p.x();
  const double y = p.y();
  const double r2 = x * x + y * y;
  const double r4 = r2 * r2;
  const double r6 = r4 * r2;
  const double numerator = 1.0 + k[0] * r2 + k[1] * r4 + k[4] * r6;
  const double denominator = 1.0 + k[5] * r2 + k[6] * r4 + k[7] * r6;
  const double radial = numerator / denominator;
  // d radial / d r2
  const double slope = ((k[0] + 2.0 * k[1] * r2 + 3.0 * k[4] * r4) -
                        radial * (k[5] + 2.0 * k[6] * r2 + 3.0 * k[7] * r4)) /
                       denominator;
  Distorted out;
  out.xy << x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x),
      y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y;
  out.d_xy << radial + 2.0 * x * x * slope + 2.0 * k[2] * y + 6.0 * k[3] * x,
      2.0 * x * y * slope + 2.0 * k[2] * x + 2.0 * k[3] * y,
      2.0 * x * y * slope + 2.0 * k[2] * x + 2.0 * k[3] * y,
      radial + 2.0 * y * y * slope + 6.0 * k[2] * y + 2.0 * k[3] * x;
  const double n = 1.0 / denominator;
  const double d = -radial / denominator;
  out.d_distortion << x * r2 * n, x * r4 * n, 2.0 * x * y, r2 + 2.0 * x * x, x * r6 * n, x * r2 * d,
      x * r4 * d, x * r6 * d,  //
      y * r2 * n, y * r4 * n, r2 + 2.0 * y * y, 2.0 * x * y, y * r6 * n, y * r2 * d, y * r4 * d,
      y * r6 * d;
  return out;
}

// Kannala and Brandt 2006, eq. 6 with theta_d = theta (1 + k1 theta^2 + .. + k4 theta^8).
Distorted distort_equidistant(const std::array<double, 8>& k, const Eigen::Vector2d& p) {
  constexpr double kSmallRadius = 1e-8;
  Distorted out;
  out.d_distortion.setZero();
  const double r = p.norm();
  if (r < kSmallRadius) {
    out.xy = p;
    out.d_xy.setIdentity();
    return out;
  }
  const double theta = std::atan(r);
  const double t2 = theta * theta;
  const double t4 = t2 * t2;
  const double poly = 1.0 + k[0] * t2 + k[1] * t4 + k[2] * t4 * t2 + k[3] * t4 * t4;
  const double theta_d = theta * poly;
  const double d_theta_d =
      1.0 + 3.0 * k[0] * t2 + 5.0 * k[1] * t4 + 7.0 * k[2] * t4 * t2 + 9.0 * k[3] * t4 * t4;
  const double ratio = theta_d / r;
  const double d_ratio = (d_theta_d / (1.0 + r * r) - ratio) / r;  // d ratio / d r
  out.xy = p * ratio;
  out.d_xy = Eigen::Matrix2d::Identity() * ratio + p * (p / r).transpose() * d_ratio;
  double power = theta * t2;
  for (int i = 0; i < 4; ++i) {
    out.d_distortion.col(i) = p / r * power;
    power *= t2;
  }
  return out;
}

Distorted distort(const CameraModel& camera, const Eigen::Vector2d& p) {
  return camera.model == DistortionModel::kEquidistant ? distort_equidistant(camera.distortion, p)
                                                       : distort_polynomial(camera.distortion, p);
}

}  // namespace

std::string_view to_string(DistortionModel model) {
  switch (model) {
    case DistortionModel::kPlumbBob:
      return "plumb_bob";
    case DistortionModel::kRationalPolynomial:
      return "rational_polynomial";
    case DistortionModel::kEquidistant:
      return "equidistant";
  }
  return "unknown";
}

int distortion_count(DistortionModel model) {
  switch (model) {
    case DistortionModel::kPlumbBob:
      return 5;
    case DistortionModel::kRationalPolynomial:
      return 8;
    case DistortionModel::kEquidistant:
      return 4;
  }
  return 0;
}

std::optional<Projection> project_with_derivatives(const CameraModel& camera,
                                                   const Eigen::Vector3d& point_camera) {
  const double z = point_camera.z();
  if (!(z > kMinDepth)) return std::nullopt;
  const Eigen::Vector2d p = point_camera.head<2>() / z;
  const Distorted distorted = distort(camera, p);
  const Eigen::Vector2d focal(camera.fx, camera.fy);
  Eigen::Matrix<double, 2, 3> d_p;
  d_p << 1.0 / z, 0.0, -p.x() / z, 0.0, 1.0 / z, -p.y() / z;

  Projection out;
  out.pixel = focal.cwiseProduct(distorted.xy) + Eigen::Vector2d(camera.cx, camera.cy);
  out.d_point = focal.asDiagonal() * distorted.d_xy * d_p;
  out.d_intrinsics.setZero();
  out.d_intrinsics(0, 0) = distorted.xy.x();
  out.d_intrinsics(1, 1) = distorted.xy.y();
  out.d_intrinsics(0, 2) = 1.0;
  out.d_intrinsics(1, 3) = 1.0;
  out.d_intrinsics.rightCols<8>() = focal.asDiagonal() * distorted.d_distortion;
  return out;
}

std::optional<Eigen::Vector2d> project(const CameraModel& camera,
                                       const Eigen::Vector3d& point_camera) {
  const double z = point_camera.z();
  if (!(z > kMinDepth)) return std::nullopt;
  const Eigen::Vector2d xy = distort(camera, point_camera.head<2>() / z).xy;
  return Eigen::Vector2d(camera.fx * xy.x() + camera.cx, camera.fy * xy.y() + camera.cy);
}

std::optional<Eigen::Vector2d> unproject(const CameraModel& camera, const Eigen::Vector2d& pixel) {
  constexpr int kMaxSteps = 30;
  constexpr double kTolerance = 1e-12;  // normalised units, far below a millionth of a pixel
  const Eigen::Vector2d target((pixel.x() - camera.cx) / camera.fx,
                               (pixel.y() - camera.cy) / camera.fy);
  Eigen::Vector2d p = target;
  for (int step = 0; step < kMaxSteps; ++step) {
    const Distorted distorted = distort(camera, p);
    // Beyond the fold of the polynomial the image runs backwards: not a place the lens can see.
    if (distorted.d_xy.determinant() <= 0.0) return std::nullopt;
    const Eigen::Vector2d move = distorted.d_xy.inverse() * (target - distorted.xy);
    if (!move.allFinite()) return std::nullopt;
    p += move;
    if (move.norm() < kTolerance) return p;
  }
  return std::nullopt;
}

CameraModel pinhole_guess(int width, int height, double focal_px) {
  CameraModel camera;
  camera.width = width;
  camera.height = height;
  camera.fx = focal_px;
  camera.fy = focal_px;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

}  // namespace kinescope
