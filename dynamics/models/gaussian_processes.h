// SPDX-License-Identifier: Apache-2.0
//
// Gaussian processes of torque with the kernels of the field (dynamics/gp), and their bands.
#pragma once

#include "dynamics/models/torque_model.h"

namespace kinescope::models {

/// How a Gaussian process of some kind holds its samples.
struct ProcessShare {
  int samples = 0;
  bool sparse = false;
};
[[nodiscard]] ProcessShare share_of(TorqueModelKind kind, Eigen::Index samples,
                                    const TorqueModelOptions& options);

/// Hyperparameters by marginal likelihood. Sigma and bands are those of residuals on motion left
/// out, with a search of its own in every fold (bands.h) that starts where that of all samples
/// ended: of several modes, the folds speak of the one that is used. The folds' processes stay with
/// the fit for their doubt about the function (up to 1 GB). What is claimed by itself
/// covers far too little, as noise is taken for white and the hyperparameters for known. Through
/// inducing points the fit is its SavedTorqueModel; `progress` counts joints of all samples and of
/// every fold.
[[nodiscard]] FittedTorqueModel fit_gaussian_processes(TorqueModelKind kind,
                                                       const DynamicModel& model,
                                                       const TorqueSamples& samples,
                                                       const TorqueModelOptions& options,
                                                       const Progress& progress = {});

}  // namespace kinescope::models
