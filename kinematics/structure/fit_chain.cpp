// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"
#include "kinematics/structure/chain_kinematics.h"
#include "kinematics/structure/chain_residuals.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

void apply_step(ChainModel& model, const Eigen::VectorXd& step) {
  Eigen::Index column = 0;
  for (ChainJoint& joint : model.joints) {
    Vector6d d = Vector6d::Zero();
    d.head<2>() = step.segment<2>(column);
    if (joint.type == JointType::kRevolute) d.segment<2>(3) = step.segment<2>(column + 2);
    joint.frame = joint.frame * exp_pose(d);
    column += geometry_size(joint.type);
    for (ChainTerm& term : joint.terms) term.scale += step(column++);
  }
  model.mount = model.mount * exp_pose(step.segment<6>(column));
}

// Moves every free coordinate to where its sighting wants it (one Gauss-Newton step).
void update_coordinates(ChainModel& model, const ChainResiduals& e) {
  const double limit = model.joints.front().type == JointType::kRevolute ? 0.7 : 1e3;
  for (std::size_t i = 0; i < model.coordinates.size(); ++i) {
    model.coordinates[i] += std::clamp(e.parts.along[i] / e.parts.lever[i], -limit, limit);
  }
}

Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& H, double variance) {
  const Eigen::MatrixXd damped =
      H + 1e-9 * Eigen::MatrixXd(H.diagonal().cwiseMax(1e-12).asDiagonal());
  return variance * LdltFactor(damped).inverse();
}

std::vector<double> scale_sigmas(const ChainModel& model, const Eigen::MatrixXd& covariance) {
  std::vector<double> sigma;
  Eigen::Index column = 0;
  for (const ChainJoint& joint : model.joints) {
    column += geometry_size(joint.type);
    for (std::size_t t = 0; t < joint.terms.size(); ++t, ++column) {
      sigma.push_back(std::sqrt(std::max(0.0, covariance(column, column))));
    }
  }
  return sigma;
}

void describe(const Motion& motion, const ChainResiduals& e, const ResidualScale& scale,
              ChainFit& fit) {
  std::vector<double> rotation;
  std::vector<double> translation;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const Vector6d plain =
        whitening_of(motion[i], e.other[i] != 0).triangularView<Eigen::Upper>().solve(e.white[i]);
    rotation.push_back(plain.head<3>().squaredNorm());
    translation.push_back(plain.tail<3>().squaredNorm());
  }
  // The median of three squared normals of variance 1 is 2.366.
  fit.rotation_rms = std::sqrt(3.0 * median_of(std::move(rotation)) / 2.366);
  fit.translation_rms = std::sqrt(3.0 * median_of(std::move(translation)) / 2.366);
  fit.variance = scale.across;
  fit.raw_variance = scale.raw_across;
  fit.axis_variance = scale.along;
  fit.cost = scale.cost;
  fit.correlation = integrated_autocorrelation(e.white);
}

}  // namespace

ChainFit fit_chain(const Motion& motion, const Eigen::MatrixXd& readings, ChainModel start,
                   const ChainFitOptions& options) {
  ChainFit fit;
  fit.samples = static_cast<int>(motion.size());
  fit.parameters = parameter_count(start);
  const bool free = is_free(start);
  const double axis_weight = free ? 0.0 : options.axis_weight;
  ChainModel model = std::move(start);
  ChainResiduals e = chain_residuals(motion, model, readings);
  ResidualScale scale = residual_scale(e.parts, options.most_cost);
  double damping = model.joints.size() > 1 ? 1e-3 : 1e-7;
  NormalEquations normal;
  bool moved = true;  // since the last linearisation
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    if (moved) {
      normal =
          normal_equations(motion, model, readings, axis_weight, e, robust_weights(e.parts, scale));
    }
    ChainModel next = model;
    Eigen::MatrixXd damped = normal.H;
    damped.diagonal() += damping * normal.H.diagonal().cwiseMax(1e-6);
    const Eigen::VectorXd step = solve_symmetric(damped, normal.g);
    if (!step.allFinite()) break;
    apply_step(next, step);
    if (free) update_coordinates(next, chain_residuals(motion, next, readings));
    ChainResiduals e_next = chain_residuals(motion, next, readings);
    const ResidualScale scale_next = residual_scale(e_next.parts, options.most_cost);
    const double gain = scale.cost - scale_next.cost;
    moved = gain > 0.0;
    if (moved) {
      model = std::move(next);
      e = std::move(e_next);
      scale = scale_next;
      damping = std::max(damping * 0.1, 1e-9);
      if (gain < 0.05 + 1e-4 * std::abs(scale.cost)) break;
    } else {
      if (gain > -1e-3 && damping < 1e-2) break;
      damping *= 30.0;
      if (damping > 1e3) break;
    }
  }
  if (normal.H.size() == 0) {
    normal =
        normal_equations(motion, model, readings, axis_weight, e, robust_weights(e.parts, scale));
  }
  fit.covariance = covariance_of(normal.H, std::max(scale.across, scale.along));
  fit.scale_sigma = scale_sigmas(model, fit.covariance);
  fit.model = std::move(model);
  describe(motion, e, scale, fit);
  if (options.with_residuals) fit.residuals = std::move(e.white);
  return fit;
}

}  // namespace kinescope::structure_search
