// SPDX-License-Identifier: Apache-2.0
//
// Takes   FittedGp and folds of its samples.
// Gives   for every target the prediction of a model that has not seen its fold.
// Method  from the factor of the one fit, without another one: blocks of the inverse kernel matrix
//         (Rasmussen and Williams 2006, section 5.4.2), or of the leverages in feature space.
//         Hyperparameters are those of all samples.
#pragma once

#include <vector>

#include "dynamics/gp/gaussian_process.h"

namespace kinescope::gp {

struct LeaveOut {
  Eigen::MatrixXd mean;      ///< samples x outputs, units of the targets
  Eigen::MatrixXd variance;  ///< of a measurement: function and noise
  Eigen::MatrixXd residual;  ///< target - mean
  Eigen::MatrixXd z;         ///< residual / sigma
  double log_density = 0.0;  ///< sum over folds, joint within each, of the normalised targets
  Eigen::RowVectorXd nmse;   ///< mean square of the residuals / variance of the targets
};

/// `fold_of`: a fold >= 0 for every sample (a trajectory, say); a negative one is never left out.
[[nodiscard]] LeaveOut leave_out(const FittedGp& fitted, const Dataset& dataset,
                                 const std::vector<int>& fold_of, int threads = 0);
/// Every sample by itself.
[[nodiscard]] LeaveOut leave_one_out(const FittedGp& fitted, const Dataset& dataset,
                                     int threads = 0);
/// k folds of consecutive samples: neighbours in time stay together.
[[nodiscard]] std::vector<int> consecutive_folds(Eigen::Index samples, int folds);

}  // namespace kinescope::gp
