// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/hand_eye.h"

#include <cmath>
#include <limits>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/nearest_rotation.h"

namespace kinescope::bundle {
namespace {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Vector<double, 9>;
using Matrix15d = Eigen::Matrix<double, 15, 15>;
using Vector15d = Eigen::Vector<double, 15>;

// Share of a mount's squared length that counts as misfit: enough to choose where nothing else
// does, too little (a 1e-9th of a squared metre) to be seen where something does.
constexpr double kShortMount = 1e-9;

// What is left of the cost when the translation is at its best for each rotation.
struct RotationCost {
  Matrix9d quadratic;
  Vector9d linear;
  Eigen::Matrix<double, 3, 9> translation_by_rotation;  // t = t0 + this vec(R)
  Eigen::Vector3d t0;

  double at(const Eigen::Matrix3d& R) const {
    const Vector9d r = R.reshaped();
    return r.dot(quadratic * r - 2.0 * linear);
  }
};

RotationCost without_translation(const HandEyeCost& cost) {
  const Eigen::Matrix3d tt = cost.quadratic.bottomRightCorner<3, 3>();
  const Eigen::Matrix<double, 3, 9> tr = cost.quadratic.bottomLeftCorner<3, 9>();
  Eigen::Matrix<double, 3, 10> right;
  right << tr, cost.linear.tail<3>();
  const Eigen::MatrixXd solved = solve_symmetric(Eigen::MatrixXd(tt), Eigen::MatrixXd(right));
  RotationCost out;
  out.translation_by_rotation = -solved.leftCols<9>();
  out.t0 = solved.col(9);
  out.quadratic =
      cost.quadratic.topLeftCorner<9, 9>() + tr.transpose() * out.translation_by_rotation;
  out.linear = cost.linear.head<9>() - tr.transpose() * out.t0;
  return out;
}

// Levenberg and Marquardt on the rotations, R exp(d).
Eigen::Matrix3d descend(const RotationCost& cost, Eigen::Matrix3d R) {
  constexpr int kMaxSteps = 40;
  constexpr double kSettled = 1e-10;  // rad
  double least = cost.at(R);
  double damping = 1e-6;
  for (int i = 0; i < kMaxSteps; ++i) {
    Eigen::Matrix<double, 9, 3> J;
    for (Eigen::Index k = 0; k < 3; ++k) J.col(k) = (R * skew(Eigen::Vector3d::Unit(k))).reshaped();
    const Vector9d r = R.reshaped();
    Eigen::Matrix3d normal = J.transpose() * cost.quadratic * J;
    const Eigen::Vector3d right = J.transpose() * (cost.linear - cost.quadratic * r);
    normal.diagonal().array() += damping * (normal.trace() + std::numeric_limits<double>::min());
    const Eigen::Vector3d d = solve_symmetric(normal, right);
    const Eigen::Matrix3d next = R * exp_rotation(d).toRotationMatrix();
    const double value = cost.at(next);
    if (!(value < least)) {
      if (d.norm() < kSettled) break;
      damping *= 10.0;
      continue;
    }
    R = next;
    least = value;
    damping *= 0.1;
    if (d.norm() < kSettled) break;
  }
  return R;
}

// The 24 rotations of a cube: no rotation is further than 63 degrees from one of them.
std::vector<Eigen::Matrix3d> rotations_of_a_cube() {
  std::vector<Eigen::Matrix3d> out;
  for (Eigen::Index a = 0; a < 3; ++a) {
    for (Eigen::Index b = 0; b < 3; ++b) {
      if (a == b) continue;
      for (const double sign_a : {1.0, -1.0}) {
        for (const double sign_b : {1.0, -1.0}) {
          const Eigen::Vector3d x = sign_a * Eigen::Vector3d::Unit(a);
          const Eigen::Vector3d y = sign_b * Eigen::Vector3d::Unit(b);
          Eigen::Matrix3d R;
          R << x, y, x.cross(y);
          out.push_back(R);
        }
      }
    }
  }
  return out;
}

}  // namespace

void HandEyeCost::add(const HandEyeCost& other, double weight) {
  quadratic += weight * other.quadratic;
  linear += weight * other.linear;
}

HandEyeCost hand_eye_cost(const std::vector<PosePair>& pairs) {
  const auto count = static_cast<double>(pairs.size());
  // Unknowns of the translations: R by columns, t, and w = R_marker_link t_link_marker in
  // t_camera_marker = t + R t_base_link + R_camera_marker w.
  Matrix15d normal = Matrix15d::Zero();
  Vector15d right = Vector15d::Zero();
  // R_marker_link at its best is the mean of R_camera_marker' R R_base_link, linear in R.
  Matrix9d mean = Matrix9d::Zero();
  for (const PosePair& pair : pairs) {
    const Eigen::Matrix3d A = pair.T_base_link.matrix3();
    const Eigen::Matrix3d B = pair.T_camera_marker.matrix3();
    Eigen::Matrix<double, 3, 15> J;
    for (Eigen::Index k = 0; k < 3; ++k) {
      J.block<3, 3>(0, 3 * k) = pair.T_base_link.translation[k] * Eigen::Matrix3d::Identity();
      for (Eigen::Index l = 0; l < 3; ++l)
        mean.block<3, 3>(3 * l, 3 * k) += A(k, l) / count * B.transpose();
    }
    J.block<3, 3>(0, 9).setIdentity();
    J.block<3, 3>(0, 12) = B;
    normal += J.transpose() * J;
    right += J.transpose() * pair.T_camera_marker.translation;
  }
  normal.bottomRightCorner<3, 3>().diagonal().array() += kShortMount * count;
  Eigen::Matrix<double, 3, 13> coupled;
  coupled << normal.bottomLeftCorner<3, 12>(), right.tail<3>();
  const Eigen::Matrix<double, 3, 13> solved =
      solve_symmetric(Eigen::MatrixXd(normal.bottomRightCorner<3, 3>()), Eigen::MatrixXd(coupled));
  HandEyeCost out;
  out.quadratic =
      normal.topLeftCorner<12, 12>() - coupled.leftCols<12>().transpose() * solved.leftCols<12>();
  out.linear = right.head<12>() - coupled.leftCols<12>().transpose() * solved.col(12);
  // Half the squared Frobenius norm of a small rotation less the identity is its squared angle.
  out.quadratic.topLeftCorner<9, 9>() +=
      0.5 * count * (Matrix9d::Identity() - mean.transpose() * mean);
  return out;
}

Pose best_base(const HandEyeCost& cost) {
  // A start that ends lower by rounding alone is no better.
  constexpr double kLower = 1e-9;
  const RotationCost rotation = without_translation(cost);
  Eigen::Matrix3d best = Eigen::Matrix3d::Identity();
  double least = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& start : rotations_of_a_cube()) {
    const Eigen::Matrix3d R = descend(rotation, start);
    const double value = rotation.at(R);
    if (value >= least - kLower * cost.quadratic.trace()) continue;
    least = value;
    best = R;
  }
  const Eigen::Vector3d t = rotation.t0 + rotation.translation_by_rotation * best.reshaped();
  return {Eigen::Quaterniond(best).normalized(), t};
}

MountFit fit_mount(const std::vector<PosePair>& pairs, const Pose& T_camera_base) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  std::vector<Pose> mounts;
  mounts.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    mounts.push_back((T_camera_base * pair.T_base_link).inverse() * pair.T_camera_marker);
    rotation += mounts.back().matrix3();
    translation += mounts.back().translation / static_cast<double>(pairs.size());
  }
  const Pose mean{Eigen::Quaterniond(nearest_rotation(rotation)).normalized(), translation};
  double sum = 0.0;
  for (const Pose& mount : mounts) {
    sum += (mount.translation - translation).squaredNorm() +
           std::pow(angle_between(mount.rotation, mean.rotation), 2);
  }
  return {mean, std::sqrt(sum / static_cast<double>(mounts.size()))};
}

}  // namespace kinescope::bundle
