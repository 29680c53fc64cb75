// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/screening.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "kinematics/structure/linear_motion.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/wide_turn.h"

namespace kinescope::structure_search {
namespace {

// Rotation slopes below this many standard deviations are no evidence for a turn.
constexpr double kTurnEvidence = 3.5;
// Beyond this distance (m) of the axis a slide is looked at as well.
constexpr double kFarAxis = 1.0;
// A sample this many times further than the median from the best line is left out.
constexpr double kTrim = 25.0;

// What one direction of y explains: sums of squares along it after regression, and across it.
struct Direction {
  int channel = -1;
  Vector6d slope = Vector6d::Zero();  // whitened, per unit coordinate
  double cost = 0.0;
};

Direction driven_direction(const Matrix6d& G, const Vector6d& b, double qq, int channel, int samples) {
  Direction d;
  d.channel = channel;
  d.slope = b / qq;
  const Vector6d u = b.normalized();
  const double total = u.dot(G * u);
  d.cost = split_cost(std::max(0.0, total - b.squaredNorm() / qq), std::max(0.0, G.trace() - total), samples);
  return d;
}

Direction principal_direction(const Matrix6d& G, int samples) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(G);
  Direction d;
  const double along = eigen.eigenvalues()(5);
  d.slope = eigen.eigenvectors().col(5) * std::sqrt(along / samples);
  const double variance = along / samples;
  d.cost = split_cost(samples, std::max(0.0, G.trace() - along), samples) + samples * std::log(1.0 + variance);
  return d;
}

void add_candidates(const LinearMotion& linear, const Direction& d, const Motion& motion,
                    std::vector<Candidate>& out) {
  const Vector6d twist = linear.whitening.triangularView<Eigen::Upper>().solve(d.slope);
  const Matrix6d covariance =
      (linear.whitening.transpose() * linear.whitening).inverse() / std::max(1, linear.count);
  const double rotation_sigma = std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3.0);
  const double rotation = twist.head<3>().norm();
  const double translation = twist.tail<3>().norm();
  const bool turn = rotation > kTurnEvidence * rotation_sigma;
  const bool slide = !turn || translation > kFarAxis * rotation;
  for (const JointType type : {JointType::kRevolute, JointType::kPrismatic}) {
    if (type == JointType::kRevolute ? !turn : !slide) continue;
    Candidate c;
    c.channel = d.channel;
    c.cost = d.cost;
    ChainJoint joint = joint_from_twist(linear.mean, twist, type);
    const double scale = type == JointType::kRevolute ? rotation : translation;
    c.start.mount = linear.mean;
    if (d.channel >= 0) {
      joint.terms = {{d.channel, scale}};
    } else {
      const Vector6d unit = d.slope / d.slope.squaredNorm();
      for (Eigen::Index i = 0; i < linear.y.cols(); ++i) {
        c.start.coordinates.push_back(scale * unit.dot(linear.y.col(i)));
      }
    }
    c.start.joints = {std::move(joint)};
    out.push_back(std::move(c));
  }
  static_cast<void>(motion);
}

// Leaves out the samples that lie far from the line along the best direction; true when there are any.
bool trim(LinearMotion& linear, const Eigen::MatrixXd& q, const Direction& best) {
  std::vector<double> squared;
  for (Eigen::Index i = 0; i < linear.y.cols(); ++i) {
    Vector6d r = linear.y.col(i);
    if (best.channel >= 0) {
      r -= best.slope * q(best.channel, i);
    } else if (best.slope.squaredNorm() > 0.0) {
      const Vector6d u = best.slope.normalized();
      r -= u.dot(r) * u;
    }
    squared.push_back(r.squaredNorm());
  }
  const double limit = kTrim * std::max(1.0, median_of(squared) / 5.35);
  bool any = false;
  for (std::size_t i = 0; i < squared.size(); ++i) {
    if (linear.kept[i] == 0 || squared[i] <= limit * 1.5) continue;
    linear.kept[i] = 0;
    --linear.count;
    any = true;
  }
  return any;
}

struct Regression {
  std::vector<Direction> driven;  // by cost
  Direction principal;
  double rest_cost = 0.0;
};

Regression regress(const LinearMotion& linear, const Eigen::MatrixXd& q, const std::vector<char>& usable) {
  Eigen::VectorXd weight(linear.y.cols());
  for (Eigen::Index i = 0; i < weight.size(); ++i) weight(i) = linear.kept[static_cast<std::size_t>(i)];
  const double n = std::max(1, linear.count);
  const Vector6d y_mean = linear.y * weight / n;
  const Eigen::MatrixXd y = (linear.y.colwise() - y_mean) * weight.asDiagonal();
  const Matrix6d G = y * y.transpose();
  Regression out;
  out.rest_cost = split_cost(0.0, G.trace(), linear.count);
  const double variance = std::max(1.0, G.trace() / (6.0 * n));
  out.rest_cost = G.trace() / variance + 6.0 * n * std::log(variance);
  out.principal = principal_direction(G, linear.count);
  if (q.rows() == 0) return out;
  const Eigen::VectorXd q_mean = q * weight / n;
  const Eigen::MatrixXd centred = (q.colwise() - q_mean) * weight.asDiagonal();
  const Eigen::MatrixXd B = y * centred.transpose();
  for (Eigen::Index k = 0; k < q.rows(); ++k) {
    const double qq = centred.row(k).squaredNorm();
    if (usable[static_cast<std::size_t>(k)] == 0 || qq < 1e-6 * n) continue;
    out.driven.push_back(driven_direction(G, B.col(k), qq, static_cast<int>(k), linear.count));
  }
  std::ranges::stable_sort(out.driven, {}, &Direction::cost);
  return out;
}

Eigen::MatrixXd readings_of(const Motion& motion, const Eigen::MatrixXd& readings) {
  Eigen::MatrixXd q(readings.cols(), static_cast<Eigen::Index>(motion.size()));
  for (std::size_t i = 0; i < motion.size(); ++i) {
    q.col(static_cast<Eigen::Index>(i)) = readings.row(motion[i].instant).transpose();
  }
  return q;
}

}  // namespace

ChainJoint joint_from_twist(const Pose& T0, const Vector6d& twist, JointType type) {
  const Eigen::Vector3d w = twist.head<3>();
  const Eigen::Vector3d v = twist.tail<3>();
  ChainJoint joint;
  joint.type = type;
  Pose local;
  if (type == JointType::kRevolute) {
    local.rotation = rotation_to_axis(w.normalized());
    local.translation = w.cross(v) / std::max(w.squaredNorm(), 1e-30);
  } else {
    local.rotation = rotation_to_axis(v.normalized());
  }
  joint.frame = T0 * local;
  return joint;
}

Screening screen_motion(const Motion& motion, const Eigen::MatrixXd& readings, const std::vector<char>& usable,
                        const ScreeningOptions& options) {
  Screening out;
  LinearMotion linear = linear_motion(motion);
  const Eigen::MatrixXd q = readings_of(motion, readings);
  out.free_cost = free_motion_cost(linear);
  out.mean_length = std::sqrt(linear.y.squaredNorm() / std::max<double>(1.0, static_cast<double>(motion.size())));
  Regression r = regress(linear, q, usable);
  const Direction& best =
      r.driven.empty() || r.principal.cost < r.driven.front().cost ? r.principal : r.driven.front();
  if (trim(linear, q, best) && linear.count > 8) r = regress(linear, q, usable);

  Candidate rest;
  rest.start.mount = linear.mean;
  rest.cost = r.rest_cost;
  out.candidates.push_back(std::move(rest));
  if (linear.widest > kWideTurn) {
    for (Candidate& c : wide_turn_candidates(motion, q, usable, linear, options.coordinate_free)) {
      out.candidates.push_back(std::move(c));
    }
  }
  const auto channels = std::min(r.driven.size(), static_cast<std::size_t>(options.max_channels));
  for (std::size_t k = 0; k < channels; ++k) add_candidates(linear, r.driven[k], motion, out.candidates);
  if (options.coordinate_free) add_candidates(linear, r.principal, motion, out.candidates);
  std::ranges::stable_sort(out.candidates, {}, &Candidate::cost);
  return out;
}

}  // namespace kinescope::structure_search
