// SPDX-License-Identifier: Apache-2.0
//
// Predictive bands that hold what they say. A model's sigma assumes that noise is white and normal
// and that the model lacks nothing; on measured robots neither is so. Hence the width of a band is
// a multiple of sigma that is read from residuals on motion that was left out of the fit: whole
// trajectories, or blocks with a gap (cross-conformal prediction, Vovk 2015; Barber, Candes,
// Ramdas, Tibshirani 2021). Everything must be estimated anew in every fold: Gaussian processes
// that keep the hyperparameters of all samples cover less with such factors than without
// (tests/experiments/torque_bands), so theirs are not calibrated.
#pragma once

#include <functional>

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/prediction.h"

namespace kinescope {

/// Half-widths of predictive bands in predicted sigmas, one a joint. Empty: the normal
/// distribution's.
struct BandFactors {
  Eigen::VectorXd of_90;
  Eigen::VectorXd of_95;
  int folds = 0;  ///< that they come from

  [[nodiscard]] double width_90(Eigen::Index joint) const;
  [[nodiscard]] double width_95(Eigen::Index joint) const;
};

/// Fits the model on some samples and predicts others.
using FoldPredictor =
    std::function<TorquePrediction(const TorqueSamples& train, const TorqueSamples& test)>;

/// From residuals over at most `folds` folds (dynamics/data/splits.h). The normal distribution's
/// where there are too few samples for two folds.
[[nodiscard]] BandFactors cross_validated_bands(const TorqueSamples& samples, int folds,
                                                const FoldPredictor& predict);

/// From residuals of samples that the prediction has not seen.
[[nodiscard]] BandFactors bands_of(const Eigen::MatrixXd& residual, const Eigen::MatrixXd& sigma);

}  // namespace kinescope
