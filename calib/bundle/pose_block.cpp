// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/pose_block.h"

namespace kinescope::bundle {
namespace {

// Left factor of the quaternion product, q * p = Q(q) p, in the order x y z w.
Eigen::Matrix4d left_product(const Eigen::Quaterniond& q) {
  Eigen::Matrix4d m;
  m << q.w(), -q.z(), q.y(), q.x(),  //
      q.z(), q.w(), -q.x(), q.y(),   //
      -q.y(), q.x(), q.w(), q.z(),   //
      -q.x(), -q.y(), -q.z(), q.w();
  return m;
}

}  // namespace

PoseBlock to_block(const Pose& pose) {
  const Eigen::Vector4d q = pose.rotation.normalized().coeffs();
  const Eigen::Vector3d& t = pose.translation;
  return {q[0], q[1], q[2], q[3], t[0], t[1], t[2]};
}

Pose from_block(const double* block) {
  const Eigen::Quaterniond rotation(block[3], block[0], block[1], block[2]);
  return {rotation.normalized(), {block[4], block[5], block[6]}};
}

Eigen::Matrix<double, 7, 6> plus_jacobian(const Pose& pose) {
  Eigen::Matrix<double, 7, 6> J = Eigen::Matrix<double, 7, 6>::Zero();
  J.topLeftCorner<4, 3>() = 0.5 * left_product(pose.rotation).leftCols<3>();
  J.bottomRightCorner<3, 3>() = pose.matrix3();
  return J;
}

Eigen::Matrix<double, 6, 7> minus_jacobian(const Pose& pose) {
  Eigen::Matrix<double, 6, 7> J = Eigen::Matrix<double, 6, 7>::Zero();
  J.topLeftCorner<3, 4>() = 2.0 * left_product(pose.rotation.conjugate()).topRows<3>();
  J.bottomRightCorner<3, 3>() = pose.matrix3().transpose();
  return J;
}

PoseManifold::PoseManifold(const TangentMask& mask) {
  for (int i = 0; i < 6; ++i) {
    if (mask[static_cast<std::size_t>(i)]) free_.push_back(i);
  }
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  Vector6d full = Vector6d::Zero();
  for (std::size_t i = 0; i < free_.size(); ++i) full[free_[i]] = delta[i];
  const PoseBlock moved = to_block(from_block(x) * exp_pose(full));
  std::copy(moved.begin(), moved.end(), x_plus_delta);
  return true;
}

bool PoseManifold::PlusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 7, Eigen::Dynamic, Eigen::RowMajor>> out(jacobian, 7,
                                                                            TangentSize());
  const Eigen::Matrix<double, 7, 6> full = plus_jacobian(from_block(x));
  for (int i = 0; i < TangentSize(); ++i) out.col(i) = full.col(free_[static_cast<std::size_t>(i)]);
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Vector6d full = log_pose(from_block(x).inverse() * from_block(y));
  for (std::size_t i = 0; i < free_.size(); ++i) y_minus_x[i] = full[free_[i]];
  return true;
}

bool PoseManifold::MinusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>> out(jacobian, TangentSize(),
                                                                            7);
  const Eigen::Matrix<double, 6, 7> full = minus_jacobian(from_block(x));
  for (int i = 0; i < TangentSize(); ++i) out.row(i) = full.row(free_[static_cast<std::size_t>(i)]);
  return true;
}

}  // namespace kinescope::bundle
