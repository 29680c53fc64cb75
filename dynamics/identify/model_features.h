// SPDX-License-Identifier: Apache-2.0
//
// One joint's torque in the parametric model as features of (q, dq, ddq), for Gaussian processes.
#pragma once

#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/gp/feature_map.h"
#include "dynamics/identify/torque_terms.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

/// q, dq, ddq beside each other: samples x 3 joints.
[[nodiscard]] Eigen::MatrixXd motion_inputs(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                            const Eigen::MatrixXd& ddq);

struct ModelFeatures {
  gp::FeatureMap map;      ///< of motion_inputs()
  Eigen::MatrixXd prior;   ///< covariance of their weights: each may make a torque of size 1
  std::vector<int> terms;  ///< of torque_terms()
};

/// The columns of torque_terms() that are independent on these samples.
[[nodiscard]] ModelFeatures model_features(const DynamicModel& model, const TorqueSamples& samples,
                                           int joint, const DriveTerms& drives);
/// Of every joint, for the cost of one.
[[nodiscard]] std::vector<ModelFeatures> model_features_of_joints(const DynamicModel& model,
                                                                  const TorqueSamples& samples,
                                                                  const DriveTerms& drives);

}  // namespace kinescope
