// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/pose.h"

#include <cmath>

#include "kinematics/core/rotation_between.h"

namespace kinescope {
namespace {

// Below this angle (rad) the Taylor series is exact to double precision.
constexpr double kSmallAngle = 1e-4;

}  // namespace

Pose Pose::inverse() const {
  const Eigen::Quaterniond r = rotation.conjugate();
  return {r, -(r * translation)};
}

Eigen::Matrix4d Pose::matrix4() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = matrix3();
  m.topRightCorner<3, 1>() = translation;
  return m;
}

Pose operator*(const Pose& T_a_b, const Pose& T_b_c) {
  return {(T_a_b.rotation * T_b_c.rotation).normalized(),
          T_a_b.translation + T_a_b.rotation * T_b_c.translation};
}

Eigen::Vector3d operator*(const Pose& T_a_b, const Eigen::Vector3d& p_b) {
  return T_a_b.translation + T_a_b.rotation * p_b;
}

Pose pose_from_matrix(const Eigen::Matrix4d& T) {
  const Eigen::Quaterniond rotation(Eigen::Matrix3d(T.topLeftCorner<3, 3>()));
  return {rotation.normalized(), T.topRightCorner<3, 1>()};
}

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Quaterniond exp_rotation(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  // sin(a/2)/a
  const double s = angle < kSmallAngle ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  return Eigen::Quaterniond(std::cos(0.5 * angle), s * w.x(), s * w.y(), s * w.z()).normalized();
}

Eigen::Vector3d log_rotation(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * rotation.vec();
  const double n = v.norm();
  const double w = sign * rotation.w();
  if (n < kSmallAngle) return (2.0 / w) * (1.0 - n * n / (3.0 * w * w)) * v;
  return (2.0 * std::atan2(n, w) / n) * v;
}

Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d W = skew(w);
  double a = 0.5 - angle * angle / 24.0;
  double b = 1.0 / 6.0 - angle * angle / 120.0;
  if (angle >= kSmallAngle) {
    a = (1.0 - std::cos(angle)) / (angle * angle);
    b = (angle - std::sin(angle)) / (angle * angle * angle);
  }
  return Eigen::Matrix3d::Identity() + a * W + b * W * W;
}

Pose exp_pose(const Vector6d& d) {
  const Eigen::Vector3d w = d.head<3>();
  return {exp_rotation(w), left_jacobian(w) * d.tail<3>()};
}

Vector6d log_pose(const Pose& pose) {
  Vector6d d;
  d.head<3>() = log_rotation(pose.rotation);
  d.tail<3>() = left_jacobian(d.head<3>()).partialPivLu().solve(pose.translation);
  return d;
}

Matrix6d inverse_right_jacobian(const Vector6d& d) {
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = skew(d.head<3>());
  ad.bottomRightCorner<3, 3>() = skew(d.head<3>());
  ad.bottomLeftCorner<3, 3>() = skew(d.tail<3>());
  return Matrix6d::Identity() + 0.5 * ad + ad * ad / 12.0;
}

Matrix6d adjoint(const Pose& pose) {
  const Eigen::Matrix3d R = pose.matrix3();
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = R;
  ad.bottomRightCorner<3, 3>() = R;
  ad.bottomLeftCorner<3, 3>() = skew(pose.translation) * R;
  return ad;
}

double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return log_rotation(a.conjugate() * b).norm();
}

Eigen::Quaterniond rotation_to_axis(const Eigen::Vector3d& axis) {
  return rotation_between(Eigen::Vector3d::UnitZ(), axis);
}

}  // namespace kinescope
