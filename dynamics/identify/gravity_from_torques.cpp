// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/gravity_from_torques.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "dynamics/rigid/regressor.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/pose.h"

namespace kinescope {
namespace {

constexpr double kMostSamples = 1500.0;
constexpr int kDirections = 200;  // about 13 degrees apart
constexpr double kFirstStep = 0.15;
constexpr double kLastStep = 1e-3;      // rad
constexpr double kUnseen = 1e-9;        // of the largest eigenvalue
constexpr double kAlike = 0.02;         // of the error: opposite directions
constexpr double kClearlyBetter = 0.9;  // of the error
constexpr double kLeastAngle = 0.035;   // rad

// Sums over the samples, from which the fit for any direction follows.
class Sums {
 public:
  Sums(const DynamicModel& model, const TorqueSamples& samples);
  // Of the torques' squares (each joint's mean square is 1), what is left with gravity along
  // `direction`.
  [[nodiscard]] double left_over(const Eigen::Vector3d& direction) const;

 private:
  double length_ = 0.0;
  Eigen::Index bodies_ = 0;    // parameters of the bodies
  Eigen::Index friction_ = 0;  // parameters of the drives
  Eigen::MatrixXd H_;          // of (at rest, along x, y, z) x bodies, then the drives'
  Eigen::VectorXd g_;
  double squares_ = 0.0;
};

Sums::Sums(const DynamicModel& model, const TorqueSamples& samples)
    : length_(model.gravity_m_s2.norm()) {
  const auto step = static_cast<Eigen::Index>(
      std::ceil(std::max(1.0, static_cast<double>(samples.size()) / kMostSamples)));
  const Eigen::Index rows = (samples.size() + step - 1) / step;
  const auto thinned = [&](const Eigen::MatrixXd& all) -> Eigen::MatrixXd {
    return all(Eigen::seqN(0, rows, step), Eigen::all);
  };
  const Eigen::MatrixXd q = thinned(samples.q);
  const Eigen::MatrixXd dq = thinned(samples.dq);
  const Eigen::MatrixXd ddq = thinned(samples.ddq);
  const Eigen::MatrixXd torque = thinned(samples.torque);
  RigidModel rigid = make_rigid_model(model);
  std::vector<std::vector<Eigen::MatrixXd>> Y;
  rigid.gravity_m_s2.setZero();
  Y.push_back(regressors_of_samples(rigid, q, dq, ddq));
  for (int axis = 0; axis < 3; ++axis) {
    rigid.gravity_m_s2 = Eigen::Vector3d::Unit(axis);
    Y.push_back(regressors_of_samples(rigid, q, dq, ddq));
    for (std::size_t j = 0; j < Y.back().size(); ++j) Y.back()[j] -= Y.front()[j];
  }
  const Eigen::Index joints = q.cols();
  bodies_ = Y.front().front().cols();
  constexpr Eigen::Index kTerms = 4;
  friction_ = kTerms * joints;
  H_ = Eigen::MatrixXd::Zero(4 * bodies_ + friction_, 4 * bodies_ + friction_);
  g_ = Eigen::VectorXd::Zero(H_.rows());
  Eigen::MatrixXd A(rows, H_.cols());
  for (Eigen::Index j = 0; j < joints; ++j) {
    const double rms = torque.col(j).norm() / std::sqrt(static_cast<double>(rows));
    if (!(rms > 0.0)) continue;
    A.setZero();
    for (Eigen::Index part = 0; part < 4; ++part) {
      A.middleCols(part * bodies_, bodies_) =
          Y[static_cast<std::size_t>(part)][static_cast<std::size_t>(j)];
    }
    auto drive = A.middleCols(4 * bodies_ + kTerms * j, kTerms);
    drive.col(0).setOnes();
    drive.col(1) = dq.col(j);
    drive.col(2) = dq.col(j).cwiseSign();
    drive.col(3) = ddq.col(j);
    A /= rms;
    const Eigen::VectorXd b = torque.col(j) / rms;
    H_.noalias() += A.transpose() * A;
    g_.noalias() += A.transpose() * b;
    squares_ += b.squaredNorm();
  }
}

double Sums::left_over(const Eigen::Vector3d& direction) const {
  const Eigen::Index size = bodies_ + friction_;
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(H_.rows(), size);
  T.topLeftCorner(bodies_, bodies_).setIdentity();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    T.block((axis + 1) * bodies_, 0, bodies_, bodies_)
        .diagonal()
        .setConstant(length_ * direction[axis]);
  }
  T.bottomRightCorner(friction_, friction_).setIdentity();
  const Eigen::MatrixXd H = T.transpose() * H_ * T;
  const Eigen::VectorXd g = T.transpose() * g_;
  // Parameters that no torque shows are left out.
  const Eigen::VectorXd scale = unit_scale(H);
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * H * scale.asDiagonal());
  const Eigen::VectorXd in_modes = eigen.vectors.transpose() * (scale.cwiseProduct(g));
  double explained = 0.0;
  for (Eigen::Index k = 0; k < size; ++k) {
    if (eigen.values[k] > kUnseen * eigen.values[size - 1])
      explained += in_modes[k] * in_modes[k] / eigen.values[k];
  }
  return std::max(0.0, squares_ - explained);
}

// Evenly over the sphere.
std::vector<Eigen::Vector3d> directions() {
  std::vector<Eigen::Vector3d> out;
  for (int k = 0; k < kDirections; ++k) {
    const double z = 1.0 - (2.0 * k + 1.0) / kDirections;
    const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * k;
    const double radius = std::sqrt(1.0 - z * z);
    out.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
  }
  return out;
}

struct DirectionFit {
  Eigen::Vector3d direction;
  double left_over = 0.0;
};

// Downhill from one of them, in smaller and smaller steps.
DirectionFit refined(const Sums& sums, const Eigen::Vector3d& start) {
  DirectionFit best{start, sums.left_over(start)};
  for (double step = kFirstStep; step > kLastStep;) {
    const Eigen::Quaterniond R = rotation_to_axis(best.direction);
    const DirectionFit before = best;
    for (const auto& [x, y] : {std::pair{step, 0.0}, {-step, 0.0}, {0.0, step}, {0.0, -step}}) {
      const Eigen::Vector3d tried = (R * Eigen::Vector3d(x, y, 1.0)).normalized();
      const double left = sums.left_over(tried);
      if (left < best.left_over) best = {tried, left};
    }
    if (best.left_over >= before.left_over) step *= 0.5;
  }
  return best;
}

}  // namespace

bool GravityFromTorques::contradicts() const {
  return from_model_rad > kLeastAngle && error_ratio < kClearlyBetter;
}

GravityFromTorques gravity_from_torques(const DynamicModel& model, const TorqueSamples& samples) {
  GravityFromTorques out;
  if (!(model.gravity_m_s2.norm() > 0.0) || samples.size() == 0) return out;
  const Eigen::Vector3d own = model.gravity_m_s2.normalized();
  const Sums sums(model, samples);
  DirectionFit best{own, sums.left_over(own)};
  const double before = best.left_over;
  for (const Eigen::Vector3d& direction : directions()) {
    const double left = sums.left_over(direction);
    if (left < best.left_over) best = {direction, left};
  }
  const DirectionFit one = refined(sums, best.direction);
  const DirectionFit opposite = refined(sums, -one.direction);
  const auto away = [&](const DirectionFit& found) { return (found.direction - own).norm(); };
  const bool alike = std::sqrt(opposite.left_over) < (1.0 + kAlike) * std::sqrt(one.left_over);
  best = alike && away(opposite) < away(one) ? opposite : one;
  out.direction = best.direction;
  out.from_model_rad = std::acos(std::clamp(own.dot(best.direction), -1.0, 1.0));
  out.error_ratio = before > 0.0 ? std::sqrt(best.left_over / before) : 1.0;
  return out;
}

}  // namespace kinescope
