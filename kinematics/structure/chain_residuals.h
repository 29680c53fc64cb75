// SPDX-License-Identifier: Apache-2.0
//
// What a chain leaves of a motion, and the normal equations of its parameters.
#pragma once

#include <vector>

#include "kinematics/structure/chain.h"
#include "kinematics/structure/residual_scale.h"

namespace kinescope::structure_search {

/// Residuals of the better branch of every sample.
struct ChainResiduals {
  ResidualParts parts;
  std::vector<Vector6d> white;      ///< one a sample
  std::vector<char> other;          ///< one a sample: the alternative is the better branch
  std::vector<Vector6d> axis;       ///< whitened axis, one a sample (single joint)
  std::vector<double> coordinates;  ///< samples x joints
};

/// Of the branch that the residuals of a sample are of.
[[nodiscard]] inline const Matrix6d& whitening_of(const MotionSample& sample, bool other) {
  return other ? sample.alternative_whitening : sample.whitening;
}

[[nodiscard]] ChainResiduals chain_residuals(const Motion& motion, const ChainModel& model,
                                             const Eigen::MatrixXd& readings);

struct NormalEquations {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
};

/// Of the weighted residuals, in the order of ChainKinematics::jacobian(); the part along the joint
/// counts `axis_weight` times. `further`: 6 x samples, right perturbations by one more parameter,
/// which then stands last; empty: none.
[[nodiscard]] NormalEquations normal_equations(const Motion& motion, const ChainModel& model,
                                               const Eigen::MatrixXd& readings, double axis_weight,
                                               const ChainResiduals& residuals,
                                               const std::vector<double>& weights,
                                               const Eigen::MatrixXd& further = {});

}  // namespace kinescope::structure_search
