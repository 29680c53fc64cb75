// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/acceleration_share.h"

#include <algorithm>
#include <cmath>

#include "dynamics/data/rough_torque.h"
#include "dynamics/data/statistics.h"
#include "dynamics/data/zero_phase_filter.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/log/smoothing_spline.h"

namespace kinescope {
namespace {

constexpr double kRoughCutoff = 0.05;  // of the sampling rate
constexpr double kRoughestHz = 5.0;
constexpr double kSmallest =
    1e-3;  // share of a joint that moves: its acceleration never counts nothing
constexpr double kFrictionWidth = 0.05;  // of the largest speed
constexpr Eigen::Index kMostSamples = 2000;

struct Rough {
  Eigen::MatrixXd q, dq, ddq, torque;
};

void append(Eigen::MatrixXd& top, const Eigen::MatrixXd& bottom) {
  const Eigen::Index rows = top.rows();
  top.conservativeResize(rows + bottom.rows(), bottom.cols());
  top.bottomRows(bottom.rows()) = bottom;
}

Rough rough_motion(const TorqueLog& log, double step_s) {
  const double cutoff_hz = std::min(kRoughestHz, kRoughCutoff / step_s);
  const Eigen::Index stride = std::max<Eigen::Index>(
      {1, log.rows() / kMostSamples, std::lround(0.25 / (cutoff_hz * step_s))});
  const Eigen::Index joints = log.q.cols();
  Rough out;
  const std::vector<Eigen::Index> bounds = log.bounds();
  for (std::size_t b = 0; b + 1 < bounds.size(); ++b) {
    const Eigen::Index n = bounds[b + 1] - bounds[b];
    if (n < kFewestFilteredRows) continue;
    Eigen::MatrixXd all(n, 2 * joints);
    all << log.q.middleRows(bounds[b], n), log.torque.middleRows(bounds[b], n);
    const Eigen::VectorXd t = log.t_s.segment(bounds[b], n);
    const SmoothingSpline spline(t, all, cutoff_hz);
    Eigen::VectorXd at(1 + (n - 1) / stride);
    for (Eigen::Index k = 0; k < at.size(); ++k) at(k) = t(k * stride);
    const Eigen::MatrixXd value = spline.evaluate(at);
    append(out.q, value.leftCols(joints));
    append(out.torque, value.rightCols(joints));
    append(out.dq, spline.evaluate(at, 1).leftCols(joints));
    append(out.ddq, spline.evaluate(at, 2).leftCols(joints));
  }
  return out;
}

double variance(const Eigen::VectorXd& x) { return (x.array() - x.mean()).square().mean(); }

double share_of_joint(const Rough& rough, Eigen::Index joint) {
  const Eigen::Index n = rough.q.rows();
  const double slow = kFrictionWidth * rough.dq.col(joint).cwiseAbs().maxCoeff() + 1e-12;
  const Eigen::MatrixXd rest = rough_torque_features(rough.q, rough.dq, joint, slow);
  Eigen::MatrixXd both(n, 2);
  both << rough.ddq.col(joint), rough.torque.col(joint);
  const Eigen::MatrixXd fitted = least_squares(rest, both);
  const Eigen::VectorXd ddq = both.col(0) - rest * fitted.col(0);
  const Eigen::VectorXd torque = both.col(1) - rest * fitted.col(1);
  const double whole = variance(rough.torque.col(joint));
  if (ddq.squaredNorm() <= 0.0 || whole <= 0.0) return kSmallest;
  const double inertia = ddq.dot(torque) / ddq.squaredNorm();
  const double share = inertia * inertia * variance(rough.ddq.col(joint)) / whole;
  return std::clamp(share, kSmallest, 1.0);
}

}  // namespace

Eigen::VectorXd acceleration_shares(const TorqueLog& log, double step_s) {
  const Eigen::Index joints = log.q.cols();
  Eigen::VectorXd shares = Eigen::VectorXd::Ones(joints);
  Rough rough;
  if (log.torque.cols() == joints) rough = rough_motion(log, step_s);
  for (Eigen::Index joint = 0; joint < joints; ++joint) {
    if (variance(log.q.col(joint)) < kStillSpread * kStillSpread)
      shares(joint) = 0.0;
    else if (rough.q.rows() > 4 * (3 + 2 * joints))
      shares(joint) = share_of_joint(rough, joint);
  }
  return shares;
}

}  // namespace kinescope
