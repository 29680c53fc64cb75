// SPDX-License-Identifier: Apache-2.0
//
// One joint's Gaussian process as numbers: from a fit and the samples it learned from.
#pragma once

#include <vector>

#include "dynamics/models/torque_model.h"

namespace kinescope::models {

/// What a joint's process was made of.
struct JointProcess {
  gp::GpModel function;      ///< of the motion alone: without noise that has a memory
  Eigen::MatrixXd inputs;    ///< samples learned from
  Eigen::VectorXd weights;   ///< normalised mean: of kernel values at the inputs, or, where there
                             ///< are some, at the inducing inputs
  Eigen::MatrixXd inducing;  ///< that carry the variance
  bool sparse = false;       ///< the mean comes from the inducing inputs too
  std::vector<int> terms;    ///< of the model's features
  Eigen::VectorXd feature_prior;
};

/// Adds it to the model; `root` is that of gp::compact_variance().
void add_process(TorqueModelKind kind, const JointProcess& process, const Eigen::MatrixXd& root,
                 SavedTorqueModel& model);
/// A joint that needs no process: its mean alone.
void add_constant_process(double mean, SavedTorqueModel& model);

}  // namespace kinescope::models
