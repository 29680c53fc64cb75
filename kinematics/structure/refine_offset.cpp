// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/refine_offset.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/structure/attachment_path.h"
#include "kinematics/structure/chain_kinematics.h"
#include "kinematics/structure/chain_residuals.h"

namespace kinescope::structure_search {
namespace {

// Steps below this (s), or this many standard deviations, are the last.
constexpr double kFinest = 1e-5;
constexpr double kSmallStep = 0.3;

// Twist of every link (in its frame, 6 x instants) for one second of offset.
using Twists = std::vector<Eigen::MatrixXd>;

// What the clock does to a body in its own frame: its joints' rates, and its link's twist.
class Follower {
 public:
  Follower(const Attachment& attachment, const Readings& readings)
      : attachment_(attachment), readings_(readings), chain_(attachment.fit.model) {}

  [[nodiscard]] Vector6d twist_at(int instant, const Vector6d& parent, double share) {
    const std::vector<ChainJoint>& joints = attachment_.fit.model.joints;
    values_.assign(joints.size(), 0.0);
    rates_.assign(joints.size(), 0.0);
    for (std::size_t k = 0; k < joints.size(); ++k) {
      values_[k] = chain_coordinate(joints[k], readings_.value, instant);
      rates_[k] = share * chain_coordinate(joints[k], readings_.rate, instant);
    }
    return adjoint(chain_.pose(values_.data()).inverse()) * parent +
           chain_.twist(values_.data(), rates_.data());
  }

 private:
  const Attachment& attachment_;
  const Readings& readings_;
  ChainKinematics chain_;
  std::vector<double> values_;
  std::vector<double> rates_;
};

// A path between what the channel says and what is seen follows the clock by the channel's share.
double share_of(const Attachment& attachment) {
  const bool inexact =
      attachment.fit.model.joints.size() == 1 && attachment.fit.axis_variance > kInexact;
  return inexact ? 1.0 / attachment.fit.axis_variance : 1.0;
}

Twists link_twists(const GrownTree& tree, const Readings& readings) {
  const auto instants = static_cast<Eigen::Index>(readings.valid.size());
  Twists out(tree.links.size(), Eigen::MatrixXd::Zero(6, instants));
  for (std::size_t l = 1; l < tree.links.size(); ++l) {
    const GrownLink& link = tree.links[l];
    const Eigen::MatrixXd& parent = out[static_cast<std::size_t>(link.parent)];
    Follower follower(link.attachment, readings);
    const double share = share_of(link.attachment);
    for (Eigen::Index i = 0; i < instants; ++i) {
      out[l].col(i) = follower.twist_at(static_cast<int>(i), parent.col(i), share);
    }
  }
  return out;
}

// Gauss-Newton of the offset alone, with everything else eliminated.
struct Normal1d {
  double curvature = 0.0;
  double gradient = 0.0;
};

Normal1d normal_of(const Attachment& attachment, const Body& body, const LinkPath& path,
                   const Eigen::MatrixXd& parent_twist, const Readings& readings) {
  const Motion motion = relative_motion(body, path, readings).motion;
  const ChainModel& model = attachment.fit.model;
  if (motion.empty() || is_free(model)) return {};
  Follower follower(attachment, readings);
  Eigen::MatrixXd twist(6, static_cast<Eigen::Index>(motion.size()));
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const int instant = motion[i].instant;
    twist.col(static_cast<Eigen::Index>(i)) =
        follower.twist_at(instant, parent_twist.col(instant), 1.0);
  }
  const ChainResiduals residuals = chain_residuals(motion, model, readings.value);
  const ResidualScale scale = residual_scale(residuals.parts);
  std::vector<double> weights = robust_weights(residuals.parts, scale);
  for (double& w : weights) w /= scale.across;
  const double axis_weight = std::min(1.0, scale.across / scale.along);
  const NormalEquations n =
      normal_equations(motion, model, readings.value, axis_weight, residuals, weights, twist);
  const Eigen::Index own = n.g.size() - 1;
  Eigen::MatrixXd H = n.H.topLeftCorner(own, own);
  H.diagonal() *= 1.0 + 1e-9;
  const Eigen::VectorXd cross = n.H.col(own).head(own);
  const Eigen::VectorXd solved = solve_symmetric(H, cross);
  return {n.H(own, own) - cross.dot(solved), n.g(own) - solved.dot(n.g.head(own))};
}

Normal1d normal_of(const GrownTree& tree, const Series& series, const Readings& readings) {
  const Twists twists = link_twists(tree, readings);
  Normal1d sum;
  for (std::size_t b = 0; b < tree.bodies.size(); ++b) {
    if (tree.bodies[b].link < 0) continue;
    const Attachment& attachment = tree.bodies[b].attachment;
    const auto parent = static_cast<std::size_t>(attachment.parent);
    const Normal1d n =
        normal_of(attachment, series.bodies[b], tree.links[parent].path, twists[parent], readings);
    sum.curvature += std::max(0.0, n.curvature);
    sum.gradient += n.gradient;
  }
  return sum;
}

double most_correlated(const GrownTree& tree) {
  double correlation = 1.0;
  for (const GrownBody& b : tree.bodies) {
    if (b.link > 0) correlation = std::max(correlation, b.attachment.fit.correlation);
  }
  return correlation;
}

// Data cost as if the log covered every instant.
double cost_of(const GrownTree& tree, const Readings& readings) {
  const auto valid = static_cast<double>(std::ranges::count(readings.valid, 1));
  return tree_cost(tree) * static_cast<double>(readings.valid.size()) / std::max(1.0, valid);
}

}  // namespace

TimeOffset refine_offset(const GrownTree& tree, const Series& series, const Readings& readings,
                         const JointLog& log, double start_s, const OffsetBounds& bounds) {
  constexpr int kMostSteps = 12;
  TimeOffset best{start_s, 0.0};
  double least = std::numeric_limits<double>::infinity();
  double step = 0.0;
  for (int k = 0; k < kMostSteps; ++k) {
    const double at = best.value_s + step;
    const bool as_grown = k == 0 && tree.links.front().path.pose.size() == series.times_s.size();
    const Readings here =
        as_grown ? readings : readings_like(readings, log, series, at, bounds.max_gap_s);
    const GrownTree fitted = as_grown ? tree : refit_tree(tree, series, here);
    const double cost = cost_of(fitted, here);
    if (cost > least) {
      // Too far: half the way.
      step *= 0.5;
      if (std::abs(step) < std::max(kFinest, kSmallStep * best.sigma_s)) break;
      continue;
    }
    least = cost;
    best.value_s = at;
    const Normal1d n = normal_of(fitted, series, here);
    if (!(n.curvature > 0.0)) break;
    best.sigma_s = std::sqrt(most_correlated(fitted) / n.curvature);
    step = std::clamp(n.gradient / n.curvature, -bounds.step_s, bounds.step_s);
    step = std::clamp(at + step, -bounds.most_s, bounds.most_s) - at;
    if (std::abs(step) >= std::max(kFinest, kSmallStep * best.sigma_s)) continue;
    best.value_s += step;
    break;
  }
  return best;
}

}  // namespace kinescope::structure_search
