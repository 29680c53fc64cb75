// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/linear_motion.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/series.h"
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

using Matrix12d = Eigen::Matrix<double, 12, 12>;
using Vector12d = Eigen::Matrix<double, 12, 1>;

// Residuals of a line and what is along its slope.
ResidualParts line_residuals(const LinearMotion& linear, const Eigen::VectorXd& coordinate,
                             const LineFit& line, bool free) {
  ResidualParts parts;
  const bool moves = line.slope.squaredNorm() > 0.0;
  parts.split = moves;
  parts.free_axis = free;
  for (Eigen::Index i = 0; i < coordinate.size(); ++i) {
    const Matrix6d& W = linear.own[static_cast<std::size_t>(i)];
    const Vector6d r = W * (linear.tangent.col(i) - line.mean - coordinate(i) * line.slope);
    const Vector6d axis = W * line.slope;
    const double along = moves ? axis.dot(r) / axis.norm() : 0.0;
    parts.along.push_back(free ? 0.0 : along);
    parts.across.push_back(std::max(0.0, r.squaredNorm() - along * along));
    parts.penalty.push_back(0.0);
    parts.lever.push_back(axis.norm());
  }
  return parts;
}

// Solves for the parameters whose index is in `used` (mean, then slope); true standard deviations
// need unit noise.
LineFit solve_line(const LinearMotion& linear, const Eigen::VectorXd& coordinate,
                   const std::vector<double>& weight, const std::vector<int>& used) {
  Matrix12d H = Matrix12d::Zero();
  Vector12d g = Vector12d::Zero();
  for (Eigen::Index i = 0; i < coordinate.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (weight[at] <= 0.0) continue;
    const Matrix6d information = weight[at] * (linear.own[at].transpose() * linear.own[at]);
    const Vector6d b = information * linear.tangent.col(i);
    const double c = coordinate(i);
    H.topLeftCorner<6, 6>() += information;
    H.bottomLeftCorner<6, 6>() += c * information;
    H.bottomRightCorner<6, 6>() += (c * c) * information;
    g.head<6>() += b;
    g.tail<6>() += c * b;
  }
  H.topRightCorner<6, 6>() = H.bottomLeftCorner<6, 6>().transpose();
  Eigen::MatrixXd part = H(used, used);
  part.diagonal() *= 1.0 + 1e-9;
  const Eigen::LDLT<Eigen::MatrixXd> factor(part);
  Vector12d x = Vector12d::Zero();
  const Eigen::VectorXd right = g(used);
  const Eigen::VectorXd solved = factor.solve(right);
  for (std::size_t k = 0; k < used.size(); ++k) x(used[k]) = solved(static_cast<Eigen::Index>(k));
  LineFit fit{x.head<6>(), x.tail<6>(), 0.0, 0.0};
  if (used.size() == 12) {
    const Eigen::MatrixXd covariance = factor.solve(Eigen::MatrixXd::Identity(12, 12));
    const double variance = covariance.block<3, 3>(6, 6).trace() / 3.0;
    fit.turn_evidence = fit.slope.head<3>().norm() / std::sqrt(std::max(1e-300, variance));
  }
  return fit;
}

std::vector<int> parameters_of(JointType type) {
  if (type == JointType::kRevolute) return {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  return {0, 1, 2, 3, 4, 5, 9, 10, 11};
}

// Passes of reweighted least squares; the best by cost, since few outliers may lead astray.
template <typename Improve>
LineFit reweighted(const LinearMotion& linear, Eigen::VectorXd& coordinate,
                   const std::vector<int>& used, const LineFit& start, bool free,
                   Improve&& improve) {
  constexpr int kPasses = 3;
  LineFit line = start;
  LineFit best;
  Eigen::VectorXd best_coordinate = coordinate;
  for (int pass = 0; pass < kPasses; ++pass) {
    const ResidualParts before = line_residuals(linear, coordinate, line, free);
    line = solve_line(linear, coordinate, robust_weights(before, residual_scale(before)), used);
    improve(line, coordinate);
    line.cost = residual_scale(line_residuals(linear, coordinate, line, free)).cost;
    if (pass > 0 && line.cost >= best.cost) continue;
    best = line;
    best_coordinate = coordinate;
  }
  coordinate = best_coordinate;
  return best;
}

}  // namespace

LineFit fit_line(const LinearMotion& linear, const Eigen::VectorXd& coordinate, JointType type,
                 const LineFit& start) {
  Eigen::VectorXd kept = coordinate;
  return reweighted(linear, kept, parameters_of(type), start, false,
                    [](const LineFit&, const Eigen::VectorXd&) {});
}

LineFit fit_free_line(const LinearMotion& linear, Eigen::VectorXd& coordinate, JointType type,
                      const LineFit& start) {
  const auto move = [&](const LineFit& line, Eigen::VectorXd& c) {
    for (Eigen::Index i = 0; i < c.size(); ++i) {
      const Matrix6d& W = linear.own[static_cast<std::size_t>(i)];
      const Vector6d axis = W * line.slope;
      c(i) = axis.dot(W * (linear.tangent.col(i) - line.mean)) / axis.squaredNorm();
    }
  };
  LineFit fit = reweighted(linear, coordinate, parameters_of(type), start, true, move);
  const ResidualParts parts = line_residuals(linear, coordinate, fit, true);
  const double variance = (coordinate.array() - coordinate.mean()).square().mean();
  for (const double lever : parts.lever) fit.cost += 1.0 + std::log1p(variance * lever * lever);
  return fit;
}

LineFit fit_point(const LinearMotion& linear, const LineFit& start) {
  Eigen::VectorXd none = Eigen::VectorXd::Zero(linear.tangent.cols());
  return reweighted(linear, none, {0, 1, 2, 3, 4, 5}, {start.mean, Vector6d::Zero(), 0.0, 0.0},
                    false, [](const LineFit&, const Eigen::VectorXd&) {});
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
    // A right perturbation d of the pose moves the logarithm by the inverse right Jacobian, which
    // is Ad(exp(y / 2)) to second order in y.
    out.own.emplace_back(motion[static_cast<std::size_t>(i)].whitening *
                         adjoint(exp_pose(-0.5 * y)));
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
