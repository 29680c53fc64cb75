// SPDX-License-Identifier: Apache-2.0
//
// Rigid transforms. Conventions, fixed here once and tested in tests/kinematics/core/pose_test.cpp:
//   T_a_b      maps coordinates in b to coordinates in a: p_a = T_a_b * p_b.
//   tangent    (rotation [rad], translation [m]), in that order.
//   perturb    on the right: T * exp(d), d expressed in frame b.
//   camera     x right, y down, z forward; tag: x right, y down, z into the tag.
//   pixels     the centre of the top-left pixel is (0, 0).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace kinescope {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A rigid transform, rotation as a unit quaternion.
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< m

  [[nodiscard]] Pose inverse() const;
  [[nodiscard]] Eigen::Matrix3d matrix3() const { return rotation.toRotationMatrix(); }
  [[nodiscard]] Eigen::Matrix4d matrix4() const;
};

[[nodiscard]] Pose operator*(const Pose& T_a_b, const Pose& T_b_c);
[[nodiscard]] Eigen::Vector3d operator*(const Pose& T_a_b, const Eigen::Vector3d& p_b);

/// A pose from a 4x4 (or the upper 3x4 of a) homogeneous matrix; the rotation part is made
/// orthonormal.
[[nodiscard]] Pose pose_from_matrix(const Eigen::Matrix4d& T);

/// [v]x, so that [v]x w = v x w.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Rotation about a vector by its length (rad). Rodrigues.
[[nodiscard]] Eigen::Quaterniond exp_rotation(const Eigen::Vector3d& rotation_vector);
/// Rotation vector of smallest length (rad, 0 to pi).
[[nodiscard]] Eigen::Vector3d log_rotation(const Eigen::Quaterniond& rotation);
/// Left Jacobian V of SO(3), so that exp([w; v]) has translation V(w) v. Barfoot 2017, eq. 7.77b.
[[nodiscard]] Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& rotation_vector);

/// SE(3) exponential of (rotation, translation). Barfoot 2017, eq. 7.85.
[[nodiscard]] Pose exp_pose(const Vector6d& tangent);
/// Inverse of exp_pose for rotations below pi.
[[nodiscard]] Vector6d log_pose(const Pose& pose);

/// J with log(exp(d) exp(e)) = d + J e for small e: the inverse of the right Jacobian of SE(3), to
/// second order in d (the next term is of the fourth); of the left one with -d. Barfoot 2017, eq.
/// 7.84, tangent order rotation, translation.
[[nodiscard]] Matrix6d inverse_right_jacobian(const Vector6d& d);

/// 6x6 adjoint with exp(Ad(T) d) T = T exp(d), tangent order rotation, translation.
[[nodiscard]] Matrix6d adjoint(const Pose& pose);

/// Smallest rotation angle between two rotations, rad.
[[nodiscard]] double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

/// The rotation that turns unit z to the direction of `axis` by the shortest way.
[[nodiscard]] Eigen::Quaterniond rotation_to_axis(const Eigen::Vector3d& axis);

}  // namespace kinescope
