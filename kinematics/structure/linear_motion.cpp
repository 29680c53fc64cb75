// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/linear_motion.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

double profile(double sum, double dof) {
  const double variance = sum / dof;
  return variance > 1.0 ? dof * (1.0 + std::log(variance)) : sum;
}

// Pose on the orbit in the middle of the motion: where the mean logarithm vanishes.
Pose mean_pose(const Motion& motion) {
  Pose mean = motion[motion.size() / 2].pose;
  const std::size_t stride = std::max<std::size_t>(1, motion.size() / 64);
  for (int pass = 0; pass < 3; ++pass) {
    Vector6d sum = Vector6d::Zero();
    int count = 0;
    const Pose inverse = mean.inverse();
    for (std::size_t i = 0; i < motion.size(); i += stride) {
      sum += fast_log(inverse * motion[i].pose);
      ++count;
    }
    mean = mean * exp_pose(sum / count);
  }
  return mean;
}

Matrix6d average_whitening(const Motion& motion) {
  Matrix6d information = Matrix6d::Zero();
  const std::size_t stride = std::max<std::size_t>(1, motion.size() / 16);
  int count = 0;
  for (std::size_t i = 0; i < motion.size(); i += stride, ++count) {
    const Matrix6d W = motion[i].whitening;
    information.noalias() += W.transpose() * W;
  }
  return Eigen::LLT<Matrix6d>(information / count).matrixU();
}

}  // namespace

Matrix6d tangent_whitening(const MotionSample& sample, const Vector6d& y) {
  // A right perturbation d of the pose moves the logarithm by the inverse right Jacobian, which is
  // Ad(exp(y / 2)) to second order in y.
  return sample.whitening * adjoint(exp_pose(-0.5 * y));
}

LinearMotion linear_motion(const Motion& motion) {
  LinearMotion out;
  const auto n = static_cast<Eigen::Index>(motion.size());
  out.mean = mean_pose(motion);
  out.whitening = average_whitening(motion);
  out.y.resize(6, n);
  out.tangent.resize(6, n);
  out.weight.resize(n);
  const Pose inverse = out.mean.inverse();
  const Eigen::Array<double, 6, 1> average = out.whitening.diagonal().array();
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto own = motion[static_cast<std::size_t>(i)].whitening.diagonal().array();
    out.weight(i) = (own / average).square().mean();
    const Vector6d y = fast_log(inverse * motion[static_cast<std::size_t>(i)].pose);
    out.widest = std::max(out.widest, y.head<3>().norm());
    out.y.col(i) = y;
    out.tangent.col(i) = y;
  }
  out.y = out.whitening.triangularView<Eigen::Upper>() * out.y;
  out.kept.assign(motion.size(), 1);
  out.count = static_cast<int>(n);
  const Vector6d centre = out.y * out.weight / out.weight.sum();
  out.y.colwise() -= centre;
  return out;
}

double split_cost(double along_sum, double across_sum, int samples) {
  return profile(along_sum, samples) + profile(across_sum, 5.0 * samples);
}

double free_motion_cost(const LinearMotion& linear) {
  const auto n = static_cast<double>(linear.y.cols());
  const Matrix6d covariance = linear.y * linear.y.transpose() / n;
  const Eigen::LLT<Matrix6d> factor(Matrix6d::Identity() + covariance);
  return n * (6.0 + 2.0 * Matrix6d(factor.matrixL()).diagonal().array().log().sum());
}

}  // namespace kinescope::structure_search
